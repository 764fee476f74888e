"""Fits: from sweeps to a circuit with error bars."""

from motoremi.fitting import alternatives, fit, identify

# Imported with the package, since they register what a fit can do.
__all__ = ["alternatives", "fit", "identify"]
