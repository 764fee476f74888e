"""Simulated instruments and motors, as data."""
