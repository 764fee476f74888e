"""The directions in which columns reach, orthonormal, and how far."""

from __future__ import annotations

import numpy as np

from motoremi.arrays import FloatArray


def directions(columns: np.ndarray, least: float = 0.0) -> tuple[np.ndarray, FloatArray]:
    """Orthonormal directions of columns, and their variances.

    Costs the points times the square of the columns, also where the points are very many.

    Parameters
    ----------
    columns : ndarray, shape (n, q)
        Complex or real; so are the directions.
    least : float
        Directions of less variance are left out, and those that are rounding.

    Returns
    -------
    directions : ndarray, shape (n, p)
    variances : ndarray, shape (p,)
    """
    if columns.shape[1] == 0:
        return np.zeros((len(columns), 0), dtype=np.complex128), np.zeros(0)
    if columns.shape[1] > len(columns):
        variances, vectors = np.linalg.eigh(columns @ columns.conj().T)
        keep = variances > max(least, 0.0)
        return vectors[:, keep], variances[keep]
    variances, vectors = np.linalg.eigh(columns.conj().T @ columns)
    keep = variances > max(least, 1e-14 * float(variances[-1]))
    # Of small ones beside large ones only the largest digits are orthogonal so far; the large ones come first, since they are exact.
    orthonormal = np.linalg.qr((columns @ vectors[:, keep])[:, ::-1] / np.sqrt(variances[keep][::-1]))[0]
    return orthonormal, variances[keep][::-1]
