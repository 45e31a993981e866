"""What the diagnosis asks for settles what it could not tell apart: gloves whose answers are known."""

from __future__ import annotations

import pytest
from glove_choices import undecided
from next_take_answer import next_take_answer


@pytest.mark.parametrize(
    ("effect", "number", "rivals", "motions"),
    [
        ("temperature", 17, {"humidity"}, ["air"]),
        ("warmup_drift", 84, {"garment_slip"}, ["crossed"]),
        ("garment_slip", 145, {"humidity"}, ["air"]),
        ("glove_latency", 98, {"clock_offset", "lag"}, ["taps", "fast"]),
    ],
)
def test_recordings_settle_it(effect: str, number: int, rivals: set[str], motions: list[str]) -> None:
    glove = undecided(effect, number)
    assert glove is not None
    answer = next_take_answer(glove)
    first, *_, last = answer["confidence_sets"]
    assert (set(first), last) == ({effect, *rivals}, [effect])
    assert answer["motions"] == motions
