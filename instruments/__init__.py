"""Instrument drivers: one file and one readable table of commands each."""
