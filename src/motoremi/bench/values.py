"""Arrays of numbers from an instrument, checked to be complete and finite."""

from __future__ import annotations

import numpy as np

from motoremi.arrays import FloatArray
from motoremi.bench.driver import Driver
from motoremi.errors import InstrumentError


def block_values(driver: Driver, query: str, dtype: str = ">f8") -> FloatArray:
    """Values of a definite-length block.

    Parameters
    ----------
    driver : Driver
    query : str
    dtype : str
        numpy's name of the numbers' binary format; the default is 64 bit, big-endian.

    Raises
    ------
    InstrumentError
        If the answer is no block of such numbers, or one of them is not finite.
    """
    block = driver.transport.query_block(query)
    size = np.dtype(dtype).itemsize
    if len(block) % size:
        raise InstrumentError(f"{driver}: the block in answer to {query!r} has {len(block)} bytes, not {size} for each value")
    return _checked(driver, query, np.frombuffer(block, dtype=dtype).astype(np.float64))


def text_values(driver: Driver, query: str) -> FloatArray:
    """Values that are separated by commas; see `block_values`."""
    answer = driver.transport.query(query)
    try:
        values = np.array([float(field) for field in answer.split(",")])
    except ValueError as error:
        raise InstrumentError(f"{driver}: {answer[:40]!r} in answer to {query!r} is no list of numbers") from error
    return _checked(driver, query, values)


def _checked(driver: Driver, query: str, values: FloatArray) -> FloatArray:
    driver.check_errors(query)
    if not np.all(np.isfinite(values)):
        raise InstrumentError(f"{driver}: the answer to {query!r} holds values that are not finite")
    return values
