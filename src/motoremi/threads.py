"""One thread in linear algebra: for the small matrices of this package, more threads take more time than they save."""

from __future__ import annotations

import functools
import sys
import threading
from collections.abc import Callable
from typing import ParamSpec, TypeVar

from threadpoolctl import ThreadpoolController

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


class _OneThread:
    """Limits the threads of the whole process: the first thread that enters sets the limit, the last one that leaves restores the former one."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._inside = 0
        self._modules = 0

    def __enter__(self) -> None:
        with self._lock:
            if not self._inside:
                self._limits = self._libraries().limit(limits=1, user_api="blas")
            self._inside += 1

    def __exit__(self, *error: object) -> None:
        with self._lock:
            self._inside -= 1
            if not self._inside:
                self._limits.restore_original_limits()

    def _libraries(self) -> ThreadpoolController:
        """The libraries that this process has loaded. To look for them takes milliseconds; new ones only come when a module is imported."""
        modules = len(sys.modules)
        if modules != self._modules:
            self._controller, self._modules = ThreadpoolController(), modules
        return self._controller


_one_thread = _OneThread()


def one_blas_thread(work: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """The same function, with one thread in linear algebra."""

    @functools.wraps(work)
    def limited(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Result:
        with _one_thread:
            return work(*args, **kwargs)

    return limited
