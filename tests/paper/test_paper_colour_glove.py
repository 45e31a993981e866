"""The colour glove's part of the page: what a small database gives, and what the section says of its rows."""

from __future__ import annotations

import numpy as np
import pytest
from colour_glove import CodeRow, CoverageRow, coverage
from colour_glove_chain import ChainRow, DepthRow, chain
from colour_glove_motion import METHODS, MotionRow, sequence_states
from colour_glove_scene import HANDS
from paper_page.colour_glove_section import colour_glove_section

from glovecal_models.colour_glove.hand_state import FINGER_ROTATIONS
from glovecal_models.colour_glove.skin import hand_skin


def test_no_image_leads_nearer_than_the_nearest_pose() -> None:
    said: list[float] = []
    rows = [
        coverage(size, "random", 1, True, lambda _, share: said.append(share))["coverage"][0]
        for size in (500, 3000)
    ]
    assert [row.entries for row in rows] == [50, 300]
    for row in rows:
        assert 5 < row.pose_nearest_mm <= row.found_mm
    assert rows[1].pose_nearest_mm < rows[0].pose_nearest_mm
    assert rows[1].image_nearest_px2 < rows[0].image_nearest_px2
    assert 0 <= min(said) < max(said) <= 1


def test_the_section_has_the_papers_rank_and_gain_beside_ours() -> None:
    sizes = [
        CoverageRow(entries, sampling, 30.0, 9.0, 34.5, 20.0)
        for entries in (100, 1000)
        for sampling in ("low-dispersion", "random")
    ]
    codes = [
        CodeRow(code, 1000, 40, rank, 20.0, 3.0, 0.995, 2.0, ms, 300.0)
        for code, rank, ms in (("PCA 32", 4.0, 3.0), ("64 bits", 60.0, 6.0), ("192 bits", 13.9, 3.0))
    ]
    section = colour_glove_section(sizes, codes)
    html = "".join(section.parts)
    for told in ("<td>16 ± 78</td><td>13.9 ± 20.0</td>", "<td>50</td><td>100</td>", "99.5 %", "rendered"):
        assert told in html
    found = {demand.what: demand.is_reached for demand in section.demands}
    assert found["rank of the true neighbour, 192 bits"]
    assert not found["look-up, 64 bits"]
    assert html.count("<svg") == 2


def test_the_section_has_errors_by_stage_beside_what_is_asked() -> None:
    chain = [
        ChainRow(cameras, whose, stage, 100, 0, 6.5, 3.0, 12.0, 4.0, 4.5, 0.94, 0.41, 4.1, 0.93, 4.0, 10.0)
        for cameras in (1, 2)
        for whose in HANDS
        for stage in ("blend", "ik", "dense")
    ]
    depth = [
        DepthRow(cameras, whose, mm, 0.01 * mm / cameras)
        for cameras in (1, 2)
        for whose in HANDS
        for mm in (350.0, 500.0)
    ]
    motions = [
        MotionRow("rigid", whose, stage, follows, 9, 8.0, 20.0, 5.0, 2.0, 0.1, 5.0, 0.1)
        for whose in HANDS
        for stage, follows in METHODS
    ]
    section = colour_glove_section([], [], chain, depth, motions)
    html = "".join(section.parts)
    assert html.count("<svg") == 2
    assert "drawn" in html
    reached = {demand.what: demand.is_reached for demand in section.demands}
    assert reached["mean joint error, ik, 1 camera, the tracker's hand"]
    assert not reached["mean joint error, dense, 1 camera, the tracker's hand"]
    assert reached["joints not accepted, dense, 2 cameras, another hand"]
    assert reached["whole chain, ik, 1 camera, the tracker's hand"]


@pytest.mark.slow
def test_a_small_chain_has_every_row(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few frames, a tiny database: that it works, not how well."""
    monkeypatch.setattr("colour_glove_chain.QUICK_FRAMES", 2)
    found = chain(1, 1, True, lambda *_: None)
    rows = [row for row in found["chain"] if isinstance(row, ChainRow)]
    assert [(row.hand, row.stage) for row in rows] == [
        (whose, stage) for whose in HANDS for stage in ("blend", "ik", "dense")
    ]
    assert all(row.frames == 2 and 0 <= row.coverage <= 1 for row in rows)
    assert len(found["depth"]) == 4


def test_fingers_move_as_a_sequence_says() -> None:
    skin = hand_skin()
    rigid, one_by_one = (
        np.array([state.angles_deg for state in sequence_states(skin, name, 5.0, 3)])
        for name in ("rigid", "finger by finger")
    )
    assert not np.ptp(rigid, axis=0).any()
    bending = np.abs(np.diff(one_by_one, axis=0)).max(axis=1) > 0
    moved = np.abs(np.diff(one_by_one, axis=0))[bending]
    fingers = np.array([name[0] for name in FINGER_ROTATIONS])
    assert all(len(set(fingers[row > 1e-9])) <= 2 for row in moved)


@pytest.mark.slow
def test_the_papers_rank_is_reached_on_a_tenth_of_its_database() -> None:
    from colour_glove import codes

    (row,) = [row for row in codes(1, True, lambda *_: None)["codes"] if row.code == "192 bits"]
    assert row.rank_mean <= 16
