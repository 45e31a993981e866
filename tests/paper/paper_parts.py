"""What ``do.py paper`` reproduces: part by part in the paper's order."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from paper_job import PaperJob
from paper_page.section import Section
from paper_page.table_1_section import table_1_section
from paper_page.table_2_section import table_2_section
from paper_page.table_4_section import table_4_section
from table_1 import Table1Row, table_1
from table_2 import Table2Row, table_2
from table_4 import QUICK_SAMPLES, SAMPLES, SIZES, Table4Row, size_row, trial

from glovecal_models.calibration.training_settings import Report


@dataclass(frozen=True)
class PaperPart:
    """One table or figure."""

    title: str
    jobs: tuple[PaperJob, ...]
    row: Callable[..., Any]
    section: Callable[[Sequence[Any]], Section]


def _table_1(seed: int, quick: bool, report: Report) -> Sequence[Table1Row]:
    return table_1(seed)


def _table_2(seed: int, quick: bool, report: Report) -> Sequence[Table2Row]:
    return table_2(seed, every=QUICK_EVERY if quick else 1, report=report)


def _table_4(size: int | None, seed: int, quick: bool, report: Report) -> Sequence[Table4Row]:
    return [size_row(trial(seed), size, QUICK_SAMPLES if quick else SAMPLES, report)]


QUICK_EVERY = 16

PARTS: dict[str, PaperPart] = {
    "table-1": PaperPart(
        "Table 1: which sensors stretch which others",
        (PaperJob("table-1", _table_1),),
        Table1Row,
        table_1_section,
    ),
    "table-2": PaperPart(
        "Table 2: the choice of the model",
        (PaperJob("table-2", _table_2, weight=100),),
        Table2Row,
        table_2_section,
    ),
    "table-4": PaperPart(
        "Table 4 and Figure 14: time and accuracy of SPGP by the number of pseudo-inputs",
        tuple(
            PaperJob(f"table-4-{size or 'exact'}", partial(_table_4, size), weight=size or 10)
            for size in (*SIZES, None)
        ),
        Table4Row,
        table_4_section,
    ),
}
