"""Benchmarks: `python -m benchmarks` (or `make bench`). They time; tests never do."""
