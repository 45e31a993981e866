"""A new person of the ankle recordings, by the others: what docs/train.md tells, with some room."""

from __future__ import annotations

from pathlib import Path

import new_person_hands
import numpy as np
import pytest
from new_person import AMOUNTS, ANKLE, PEOPLE, Errors, asked, coverage, draw, read_people, rmse, table


@pytest.mark.needs_shared_data
def test_half_a_minute_of_a_new_person_is_as_good_as_all_of_it_alone() -> None:
    if not ANKLE.is_dir():
        pytest.skip("the ankle recordings are not here")
    takes, blocks = asked(read_people(), PEOPLE)
    new, alone = takes["new person", "30 s"], takes["without", "30 s"]
    assert rmse(new) < 1.2 * rmse(takes["without", "all"])
    assert rmse(new) < 0.75 * rmse(alone)
    assert rmse(takes["known person", "30 s"]) < rmse(new) < rmse(takes["new person", "prior alone"])
    assert coverage(new) > 0.88
    assert coverage(takes["known person", "30 s"]) > 0.9
    assert rmse(blocks["new person", "30 s"]) < 1.6 * rmse(blocks["without", "30 s"])


def test_the_table_tells_degrees_and_how_many_the_interval_holds(tmp_path: Path) -> None:
    some = {"P1": [Errors(np.array([[3.0], [4.0]]), np.array([[True], [False]]))]}
    found = {("new person", amount): some for amount in AMOUNTS}
    assert "| 30 s |  | 3.5 (50 %) |  |" in table(found)
    draw(found, tmp_path / "errors.png")
    assert (tmp_path / "errors.png").stat().st_size > 5_000


def test_simulated_hands_are_known_before_they_move_and_better_after_three_poses() -> None:
    errors = new_person_hands.asked((600, 601, 602, 603))
    degrees = {key: float(np.sqrt(np.mean([square for square, _ in own]))) for key, own in errors.items()}
    assert degrees["3 poses", "new person"] < min(degrees["none", "new person"], degrees["3 poses", "alone"])
    assert degrees["none", "known person"] < degrees["none", "new person"]
    assert "| none |  | " in new_person_hands.table(errors)
