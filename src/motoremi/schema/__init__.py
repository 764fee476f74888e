"""Procedures and bench files: their keys and limits, checked before any instrument is connected."""
