"""Conducted emission: commutation, source, path to the LISN, receiver, limits, and diagnosis of spectra."""
