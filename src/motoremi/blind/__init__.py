"""Blind tests: sealed challenges and scoreboards. The data come from `simulate`, which has no formula in common with the catalogue."""
