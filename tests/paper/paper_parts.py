"""What ``do.py paper`` reproduces: part by part in the paper's order."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from colour_glove import SAMPLINGS, CodeRow, CoverageRow, codes, coverage
from colour_glove import SIZES as DATABASE_SIZES
from colour_glove_chain import ChainRow, DepthRow, chain
from colour_glove_motion import MotionRow, motion
from figure_11 import Figure11Row
from figure_12 import Figure12Row
from multiple_wearings import WearingRow
from paper_job import PaperJob, Rows
from paper_page.colour_glove_section import colour_glove_section
from paper_page.figure_11_section import figure_11_section
from paper_page.figure_12_section import figure_12_section
from paper_page.section import Section
from paper_page.table_1_section import table_1_section
from paper_page.table_2_section import table_2_section
from paper_page.table_3_section import table_3_section
from paper_page.table_4_section import table_4_section
from paper_page.wearings_section import wearings_section
from paper_session import paper_session
from paper_subject import Curve, subject_rows, subject_session
from table_1 import Table1Row, table_1
from table_2 import Table2Row, table_2
from table_3 import Table3Row
from table_4 import SIZES, SIZES_HZ, SIZES_SAMPLES, Table4Row, size_row, started

from glovecal_models.progress import Report

SUBJECTS = 3
QUICK_EVERY = 16


@dataclass(frozen=True)
class PaperPart:
    """One table or figure."""

    title: str
    jobs: tuple[PaperJob, ...]
    kinds: Mapping[str, Callable[..., Any]]
    """Of the rows that the section is made of."""
    section: Callable[..., Section]
    """From the rows of each kind."""
    asked_for: bool = False
    """Computed only when it is named: it takes long."""


def _table_1(seed: int, quick: bool, report: Report) -> Mapping[str, Sequence[Table1Row]]:
    return {"table-1": table_1(seed)}


def _table_2(seed: int, quick: bool, report: Report) -> Mapping[str, Sequence[Table2Row]]:
    return {"table-2": table_2(seed, every=QUICK_EVERY if quick else 1, report=report)}


def _table_4(size: int | None, seed: int, quick: bool, report: Report) -> Mapping[str, Sequence[Table4Row]]:
    report("sampling the subject, training exactly", 0.0)
    if quick:
        session = subject_session(seed, quick)
    else:
        session = paper_session(seed, rate_hz=SIZES_HZ, samples=SIZES_SAMPLES)
    return {"table-4": [size_row(started(session), size, report)]}


_SUBJECTS = tuple(
    PaperJob(f"subject-{number + 1}", partial(subject_rows, number), weight=400) for number in range(SUBJECTS)
)
_SIZED = tuple(
    PaperJob(f"table-4-{size or 'exact'}", partial(_table_4, size), weight=size or 10)
    for size in (*SIZES, None)
)


_GLOVE_KINDS = {
    "coverage": CoverageRow,
    "codes": CodeRow,
    "chain": ChainRow,
    "depth": DepthRow,
    "motion": MotionRow,
}


def _of_glove(name: str, rows: Rows, weight: float) -> PaperJob:
    return PaperJob(name, partial(_glove_rows, rows), weight)


def _glove_rows(rows: Rows, seed: int, quick: bool, report: Report) -> Mapping[str, Sequence[Any]]:
    """Each job has rows of some kinds, and none of the others."""
    return {kind: [] for kind in _GLOVE_KINDS} | dict(rows(seed, quick, report))


_COLOUR_GLOVE = (
    *(
        _of_glove(f"colour-glove-{size}-{sampling}", partial(coverage, size, sampling), size / 100)
        for size in DATABASE_SIZES
        for sampling in SAMPLINGS
    ),
    _of_glove("colour-glove-codes", codes, 2000),
    *(_of_glove(f"colour-glove-poses-{count}", partial(chain, count), 1000 * count) for count in (1, 2)),
    _of_glove("colour-glove-motion", motion, 1500),
)

PARTS: dict[str, PaperPart] = {
    "table-1": PaperPart(
        "Table 1: which sensors stretch which others",
        (PaperJob("table-1", _table_1),),
        {"table-1": Table1Row},
        table_1_section,
    ),
    "table-2": PaperPart(
        "Table 2: the choice of the model",
        (PaperJob("table-2", _table_2, weight=100),),
        {"table-2": Table2Row},
        table_2_section,
    ),
    "table-3": PaperPart(
        "Table 3: nine poses by four calibrations", _SUBJECTS, {"table-3": Table3Row}, table_3_section
    ),
    "figure-11": PaperPart(
        "Figure 11: the gap between two fingers held while they bend",
        _SUBJECTS,
        {"figure-11": Figure11Row, "figure-11-curves": Curve},
        figure_11_section,
    ),
    "figure-12": PaperPart(
        "Figure 12: distance of fingertips that touch",
        _SUBJECTS,
        {"figure-12": Figure12Row},
        figure_12_section,
    ),
    "table-4": PaperPart(
        "Table 4 and Figure 14: time and accuracy of SPGP by the number of pseudo-inputs",
        _SIZED,
        {"table-4": Table4Row},
        table_4_section,
    ),
    "wearings": PaperPart(
        "Section 8.2: one training, many wearings", _SUBJECTS, {"wearings": WearingRow}, wearings_section
    ),
    "colour-glove": PaperPart(
        "Wang & Popovic 2009, Figures 8, 9, 11 and 12: the colour glove, on rendered images",
        _COLOUR_GLOVE,
        _GLOVE_KINDS,
        colour_glove_section,
        asked_for=True,
    ),
}
