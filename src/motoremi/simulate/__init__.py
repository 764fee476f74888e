"""The motor under test and virtual instruments: physics of their own, never the formulas of the fit."""
