"""Table 1 of the paper comes out of the simulated glove's readings."""

from __future__ import annotations

import numpy as np
import pytest
from table_1 import table_1

from glovecal_models.simulation.simulated_hand import POSTURES, Stretch, bent_share, deviations, stretches


def moved_alone(stretch: Stretch, neighbour: str) -> np.ndarray:
    """What the simulated cloth does, in shares of the range, while the rest of the hand is flat."""
    flat = {
        pull.neighbour: bent_share(pull.neighbour, np.full(200, POSTURES["flat"][pull.neighbour]))
        for pull in stretch.pulls
    }
    return stretch.share(flat | {neighbour: np.linspace(0, 1, 200)})


def test_table_1():
    rows = table_1(seed=2)
    assert len(rows) == 7 + 18
    made = {stretch.sensor: stretch for stretch in stretches()}
    for row in rows:
        assert row.is_named, row
        if row.affecting is None:
            if row.rotation != "PALM_ARCH":  # its pulls add up in the simulation, in the paper they do not
                assert row.std_pct == pytest.approx(row.paper_std_pct, rel=0.35)
                assert row.max_pct == pytest.approx(row.paper_max_pct, rel=0.35)
            continue
        assert row.std_pct == pytest.approx(row.paper_std_pct, rel=0.35)
        assert row.max_pct == pytest.approx(row.paper_max_pct, rel=0.35)
        std, largest = deviations(100 * moved_alone(made[row.rotation], row.affecting))
        assert row.std_pct == pytest.approx(std, rel=0.2, abs=0.4)
        assert row.max_pct == pytest.approx(largest, rel=0.2, abs=1.5)
        assert row.interval_pct is not None
        assert row.interval_pct[0] <= row.std_pct <= row.interval_pct[1] < 1.5 * row.std_pct
