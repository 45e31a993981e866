"""What the diagnosis asks for settles what it could not tell apart: gloves whose answers are known."""

from __future__ import annotations

import pytest
from glove_choices import undecided
from next_take_answer import next_take_answer


@pytest.mark.parametrize(
    ("effect", "number", "rival", "motion"),
    [
        ("temperature", 17, "humidity", "air"),
        ("warmup_drift", 84, "garment_slip", "crossed"),
    ],
)
def test_a_recording_settles_it(effect: str, number: int, rival: str, motion: str) -> None:
    glove = undecided(effect, number)
    assert glove is not None
    answer = next_take_answer(glove)
    first, last = answer["confidence_sets"]
    assert (set(first), last) == ({effect, rival}, [effect])
    assert answer["motions"] == [motion]
