"""A report as PDF: every text can be searched, nothing leaves its page, and the same stands in HTML."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from datetime import UTC, datetime
from html import unescape
from typing import Any

import pypdfium2
import pytest

from glovecal_models.calibration.answer import ModelEffect
from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.presentation.document import (
    Block,
    Chart,
    Column,
    Explanation,
    Folded,
    Lines,
    Note,
    Part,
    Pictures,
    Presentation,
    Section,
    Table,
)
from glovecal_models.presentation.drawing import svg
from glovecal_service.report.calibration_answer import (
    CalibrationReport,
    PastCheck,
    ReportedRotation,
    ReportedTake,
    ToRecord,
)
from glovecal_service.report.coverage import CoveredRange
from glovecal_service.report.html import page_of
from glovecal_service.report.pdf import pdf_of

MADE = datetime(2026, 11, 22, 9, 30, tzinfo=UTC)
LONGEST_CHANNEL = "I_" + "very" * 15 + "_x"
"""64 characters, which is as many as a channel may have."""
LONGEST_TAKE = "a take of Łukasz & Ülkü <b> " + "with_a_name_that_never_ends" * 6
ROTATIONS = ("T_TMC", "I_MCP", "I_PIP", "M_MCP", "M_PIP", LONGEST_CHANNEL)
FLOOR = NoiseFloor(0.5, 0.45, 0.56, 0.1, "still hand", 12)


@pytest.fixture(scope="module")
def report() -> CalibrationReport:
    """With more takes than a page has lines, and names as long as they may be."""
    covered = [CoveredRange(name, -3.0, 60.0 + at, 2.0, 55.0) for at, name in enumerate(ROTATIONS)]
    return CalibrationReport(
        subject="anna", model="a" * 64, method="lmc_gpr", title="anna, version 2 of 22 November 2026",
        made_at=MADE, how_held_out="whole takes left out",
        errors_deg={"model": 1.4, "linear": 2.2, "raw": 8.1},
        rotations=[
            ReportedRotation(name, ("A", "B"), 1.0 + at, 2.0 + at, 9.0 + at, FLOOR if at % 2 else None)
            for at, name in enumerate(ROTATIONS)
        ],
        wearing_sentences=["In a wearing not seen: 2.30 degrees."],
        trained_on=[
            ReportedTake(LONGEST_TAKE if at == 7 else f"w1-t{at}", f"{at:032x}", "w1", 30.0, 6, MADE)
            for at in range(60)
        ],
        takes_gone=1, sentences=["60 takes, 3600 frames."],
        effects=[
            ModelEffect(
                "no_such_effect", "", ["I_MCP"], {}, {}, [], True, 2.0,
                {"rmse_before_deg": 3.25, "rmse_after_deg": 1.25, "rmse_control_deg": 3.05}, None,
            )
        ],
        covered_angles=covered, covered_readings=covered, diagnosis=None, ceiling=None,
        to_record=[ToRecord("fist", "Make a fist and hold it. " * 12, 6.0, 0.123)], advice=["Next: fist."],
        checks=[PastCheck(MADE, "wearing-4", 3.1, 1.2, "b" * 64)], check_sentences=["As found: 3.1 degrees."],
        is_active=True,
    )  # fmt: skip


def texts_of(parts: Iterable[Part]) -> list[str]:
    """All that stands in words and numbers."""
    found: list[str] = []
    for part in parts:
        match part:
            case Table():
                found += [*part.headings, *(cell for row in part.texts for cell in row), part.legend]
                found += [] if part.rows else [part.empty]
            case Chart():
                found.append(part.sentence)
            case Pictures(charts):
                found += texts_of(charts)
            case Lines(sentences) | Note(_, sentences):
                found += sentences
            case Folded(heading, inner) | Block(heading, inner):
                found += [heading, *texts_of(inner)]
            case Explanation(sentence) | str(sentence):
                found.append(sentence)
    return found


def without_space(text: str) -> str:
    """However lines are broken."""
    return "".join(text.split())


def require_whole(shown: Presentation) -> pypdfium2.PdfDocument:
    """Every text of it is in the PDF, and all of that lies on the paper."""
    document = pypdfium2.PdfDocument(pdf_of(shown))
    written = ""
    for number in range(len(document)):
        page = document[number]
        width, height = page.get_size()
        text = page.get_textpage()
        written += without_space(text.get_text_range()).removeprefix(
            without_space(f"Glovecal0.1.0{number + 1}")
        )
        for item in page.get_objects():
            left, bottom, right, top = item.get_bounds()
            assert 0 <= left <= right <= width
            assert 0 <= bottom <= top <= height
            if isinstance(item, pypdfium2.PdfImage):
                assert right - left > 36, "a picture can be seen"
    for words in (
        shown.title, *(fact.text for fact in shown.summary), *(part.heading for part in shown.shown),
        *texts_of(shown.notes), *texts_of(shown.parts()),
    ):  # fmt: skip
        assert without_space(words) in written, words
    return document


@pytest.mark.filterwarnings("error")
def test_all_of_a_report_is_on_its_pages(report: CalibrationReport) -> None:
    document = require_whole(report.presentation())
    assert document.get_metadata_value("Title") == "Calibration of anna, version 2 of 22 November 2026"
    assert len(document) >= 3
    page = unescape(page_of(report.presentation()))
    for words in texts_of(report.presentation().parts()):
        assert words in page
    for chart in (part for part in report.presentation().parts() if isinstance(part, Chart)):
        assert "I_PIP" in svg(chart), "names are text"


def test_what_does_not_fit_is_broken_and_goes_on(report: CalibrationReport) -> None:
    wide = Table([Column(f"column_{at}") for at in range(24)], [["x" * 40, *range(23)]] * 3)
    high = Table([Column("words", "")], [["word " * 2500], ["end"]])
    tall = Chart(lambda axes: axes.plot([0, 1]), 3, 30, "A picture that is higher than the paper.")
    parts: list[Any] = [wide, high, tall, Pictures([replace(tall, height=2)] * 5)]
    require_whole(
        Presentation("What does not fit " * 30, notes=[Note("", ["n" * 300])], sections=[Section("S", parts)])
    )


def test_an_unknown_error_is_said(report: CalibrationReport) -> None:
    nothing = replace(
        report, errors_deg={}, rotations=[replace(report.rotations[0], held_out_rmse_deg=None)],
        trained_on=(), covered_angles=(), covered_readings=(), to_record=(), checks=(), effects=(),
    )  # fmt: skip
    said = str(nothing)
    assert "The error is unknown" in said
    assert "None of its takes is stored here" in said
    assert "No wearing was checked yet" in said
