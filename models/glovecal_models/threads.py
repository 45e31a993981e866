"""One BLAS thread per process (two made small fits 16 times slower on two cores)."""

from __future__ import annotations

from threadpoolctl import threadpool_limits

_limits: threadpool_limits | None = None


def pin_blas_to_one_thread() -> None:
    """Limit BLAS and OpenMP pools of this process to one thread, for as long as it lives."""
    global _limits
    if _limits is None:
        import numpy.linalg  # noqa: F401  the pools exist only once the libraries are loaded
        import scipy.linalg  # noqa: F401

        _limits = threadpool_limits(limits=1)
