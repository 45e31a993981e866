"""Table 4 of the paper on few samples: SPGP stays near the exact process, and its page tells both."""

from __future__ import annotations

import pytest
from paper_page.table_4_section import table_4_section
from paper_session import paper_session
from table_4 import PAPER, SIZES, Table4Row, size_row, started


@pytest.fixture(scope="module")
def rows() -> list[Table4Row]:
    begun = started(paper_session(1, rate_hz=30, samples=40))
    return [size_row(begun, size, fingers="I") for size in (20, None)]


def test_sparse_processes_are_near_the_exact_one(rows) -> None:
    assert set(PAPER) == set(SIZES)
    *sparse, exact = rows
    assert exact.fk_deg < 4
    assert exact.ik_cm < 1
    assert exact.rotations == 22
    for row in sparse:
        assert row.fk_deg < exact.fk_deg + 0.5
        assert row.ik_cm < exact.ik_cm + 0.3
        assert 0 < row.kept <= row.rotations
    assert [row.paper_train_s for row in rows] == [6.224, None]


def test_its_section_has_the_papers_figures_beside(rows) -> None:
    html = "".join(table_4_section(rows).parts)
    assert "LMC-GPR, exact" in html
    assert f"{rows[0].ik_cm:.2f} cm" in html
    assert "6.22 s" in html
    assert html.count("<svg") == 2
