"""Benchmarks: `make bench` (or `python -m benchmarks`). They time; tests never do."""

import os

# One thread each: the methods are compared by processor time, and two run at once.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
