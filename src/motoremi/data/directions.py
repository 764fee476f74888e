"""Principal directions of a set of columns."""

from __future__ import annotations

import numpy as np

from motoremi.arrays import FloatArray
from motoremi.threads import one_blas_thread


@one_blas_thread
def directions(columns: np.ndarray, least: float = 0.0) -> tuple[np.ndarray, FloatArray]:
    """Orthonormal principal directions of columns, and their variances.

    The cost is proportional to the number of points and to the square of the number of columns.

    Parameters
    ----------
    columns : ndarray, shape (n, q)
        Complex or real; the directions are of the same kind.
    least : float
        Directions with less variance are left out, and those that are only rounding errors.

    Returns
    -------
    directions : ndarray, shape (n, p)
    variances : ndarray, shape (p,)
    """
    if columns.shape[1] == 0:
        return np.zeros((len(columns), 0), dtype=np.complex128), np.zeros(0)
    if not columns.any():  # such as those of correlated noise where there is none
        return np.zeros((len(columns), 0), dtype=columns.dtype), np.zeros(0)
    if columns.shape[1] > len(columns):
        variances, vectors = np.linalg.eigh(columns @ columns.conj().T)
        keep = variances > max(least, 0.0)
        return vectors[:, keep], variances[keep]
    variances, vectors = np.linalg.eigh(columns.conj().T @ columns)
    keep = variances > max(least, 1e-14 * float(variances[-1]))
    # Directions of small variance are orthogonal to the others to a few digits only. QR makes them so; those of large variance come first,
    # because they are accurate.
    orthonormal = np.linalg.qr((columns @ vectors[:, keep])[:, ::-1] / np.sqrt(variances[keep][::-1]))[0]
    return orthonormal, variances[keep][::-1]
