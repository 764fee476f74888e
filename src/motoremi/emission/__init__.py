"""Conducted emission: commutation, source, path to the LISN, receiver, limits, and which source-side effect is missing."""
