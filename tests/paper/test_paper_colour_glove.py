"""The colour glove's part of the page: what a small database gives, and what the section says of its rows."""

from __future__ import annotations

import pytest
from colour_glove import CodeRow, CoverageRow, coverage
from paper_page.colour_glove_section import colour_glove_section


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


@pytest.mark.slow
def test_the_papers_rank_is_reached_on_a_tenth_of_its_database() -> None:
    from colour_glove import codes

    (row,) = [row for row in codes(1, True, lambda *_: None)["codes"] if row.code == "192 bits"]
    assert row.rank_mean <= 16
