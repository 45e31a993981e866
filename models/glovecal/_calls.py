"""What a long call of the library does around its work: one BLAS thread, and word of its progress."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from threadpoolctl import threadpool_limits

from glovecal_models.progress import Report

Progress = bool | Report | None
"""None or False: silent. True: a line on stderr that rewrites itself. Else it is called with a sentence and
the fraction done, 0 to 1; what it raises ends the work."""
LINE = 100


@contextmanager
def library_call(progress: Progress = None) -> Iterator[Report]:
    """Within the block BLAS and OpenMP have one thread, which is faster for small matrices; before and after
    they have what the caller gave them. Gives what progress is reported to."""
    import scipy.linalg  # noqa: F401  the thread pools exist only once the libraries are loaded

    line = _Line() if progress is True else None
    report = line or (progress if callable(progress) else _silent)
    try:
        with threadpool_limits(limits=1):
            yield report
    finally:
        if line is not None:
            line.end()


class _Line:
    """One line on stderr that is written over."""

    def __init__(self) -> None:
        self._length = 0

    def __call__(self, text: str, share: float) -> None:
        line = f"{100 * min(share, 1.0):3.0f} % {text}"[:LINE]
        sys.stderr.write(f"\r{line.ljust(self._length)}")
        sys.stderr.flush()
        self._length = len(line)

    def end(self) -> None:
        if self._length:
            sys.stderr.write("\n")
            sys.stderr.flush()


def _silent(text: str, share: float) -> None:
    """Nobody asked."""
