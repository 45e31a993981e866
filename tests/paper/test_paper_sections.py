"""Sections of the page: what several subjects come to, what must be reached, and where it is missed."""

from __future__ import annotations

import numpy as np
import pytest
from figure_11 import Figure11Row
from figure_12 import Figure12Row
from multiple_wearings import WearingRow
from paper_page.figure_11_section import figure_11_section
from paper_page.figure_12_section import figure_12_section
from paper_page.table_3_section import pooled, table_3_section
from paper_page.wearings_section import wearings_section
from paper_session import CALIBRATIONS
from paper_subject import Curve
from table_3 import Table3Row


def table_3_rows(subjects: np.ndarray, pose: str = "fist") -> list[Table3Row]:
    """``subjects``: absolute errors (subjects, calibrations, N)."""
    paper = ((16.1, 24.8), (3.2, 3.5), (1.5, 2.5), (1.6, 2.5))
    return [
        Table3Row(pose, method, *figures, float(own.mean()), float(own.std()), 1.0, 0.5)
        for subject in subjects
        for method, figures, own in zip(CALIBRATIONS, paper, subject, strict=True)
    ]


def testpooled_errors_are_those_of_all_subjects_together() -> None:
    errors = np.random.default_rng(3).gamma(2.0, size=(3, 4, 22))
    for place, row in enumerate(pooled(table_3_rows(errors))):
        assert row.mean_deg == pytest.approx(errors[:, place].mean())
        assert row.sd_deg == pytest.approx(errors[:, place].std())


def test_table_3_marks_what_is_above_the_papers_mean() -> None:
    errors = np.tile(np.array([12.0, 3.0, 1.4, 1.7])[None, :, None], (2, 1, 5))
    section = table_3_section(table_3_rows(errors))
    assert [demand.is_reached for demand in section.demands] == [True, False]
    assert section.demands[1].sentence() == "fist, SPGP 100: 1.7 degrees, must be at most 1.6."
    html = "".join(section.parts)
    assert "reached: at most 1.5" in html
    assert "MISSED: at most 1.6" in html
    assert "2 simulated subjects" in html
    assert "16.1° ± 24.8°" in html


def test_figure_11_judges_bias_and_sd_of_lmc_gpr() -> None:
    rows = [
        Figure11Row(seed, wearing, 25.0, method, bias, sd, 0.2)
        for seed, bias, sd in ((1, -0.8, 0.9), (2, 0.6, 1.3))
        for wearing in (0, 1)
        for method in CALIBRATIONS
    ]
    curves = [Curve(1, 25.0, method, 60.0, [24.0, 25.5, 25.0]) for method in CALIBRATIONS]
    section = figure_11_section(rows, curves)
    assert [demand.is_reached for demand in section.demands] == [True, False, True, False]
    assert section.demands[0].found == pytest.approx(0.7)
    assert "gap held at 25 degrees, other wearing, LMC-GPR: sd" in section.demands[3].what


def test_figure_12_has_the_papers_distances_for_the_index_finger_alone() -> None:
    rows = [
        Figure12Row(1, wearing, finger, method, 1.75 if finger == "I" else None, cm, (cm / 2, cm, 2 * cm), cm)
        for wearing in (0, 1)
        for finger in "IM"
        for method, cm in zip(CALIBRATIONS, (6.0, 4.0, 0.09, 0.6), strict=True)
    ]
    section = figure_12_section(rows)
    reached = {demand.what: demand.is_reached for demand in section.demands}
    assert reached["thumb and index touching, same wearing, LMC-GPR"]
    assert not reached["thumb and middle touching, other wearing, SPGP 100"]
    assert len(reached) == 8
    assert "".join(section.parts).count("1.75 cm") == 8


def test_the_wearing_of_training_needs_no_check() -> None:
    rows = [WearingRow(seed, 0, 1.0, None) for seed in (1, 2)]
    rows += [WearingRow(seed, 1, 1.5, 1.5 - 0.2 * seed) for seed in (1, 2)]
    html = "".join(wearings_section(rows).parts)
    for cells in (
        "that of training</td><td>1.00°</td><td>-</td>",
        "put on again, 1</td><td>1.50°</td><td>1.20°</td>",
    ):
        assert cells in html
