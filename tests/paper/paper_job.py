"""One piece of work of ``do.py paper``: a function that returns rows, run in a process of its own."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from paper_machine import commit, computer

from glovecal_models.progress import Report

Rows = Callable[[int, bool, Report], Mapping[str, Sequence[Any]]]
"""Seed, quick, and where to report progress -> dataclass rows by their kind."""


@dataclass(frozen=True)
class PaperJob:
    """Parts share a job where they share a training; a part has several where they can run side by side."""

    name: str
    rows: Rows
    weight: float = 1.0
    """How long it takes, compared with others: the longest are begun first."""


@dataclass(frozen=True)
class PaperResult:
    """What a job found, in the form a file can hold."""

    job: str
    seed: int
    quick: bool
    rows: Mapping[str, Sequence[Mapping[str, Any]]]
    took_s: float
    computed: str
    """Local date and time."""
    commit: str
    computer: str


def run_job(job: PaperJob, seed: int, quick: bool, report: Report) -> PaperResult:
    begin = time.monotonic()
    found = job.rows(seed, quick, report)
    rows = {kind: [asdict(row) for row in some] for kind, some in found.items()}
    took_s = time.monotonic() - begin
    computed = time.strftime("%Y-%m-%d %H:%M")
    return PaperResult(job.name, seed, quick, rows, took_s, computed, commit(), computer())
