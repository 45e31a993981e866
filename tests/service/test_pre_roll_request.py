"""How far back a pre-roll may reach: never into another wearing."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import pytest
from realtime_support import LAYOUT

from glovecal_service.recorder.pre_roll import pre_roll_request
from glovecal_service.store.recordings import with_pre_roll
from glovecal_service.store.records import GloveRecord, RecordingRecord

GLOVE = "g1"
NOON = datetime(2026, 5, 1, 12, tzinfo=UTC)


def said(id: str, seconds: float, subject: str | None = "anna", wearing: str | None = "w") -> RecordingRecord:
    """A recording requested, and last changed, so many seconds after noon; it asks for a minute."""
    at = NOON + timedelta(seconds=seconds)
    facts = {"pre_roll": {"asked_s": 60.0}}
    return RecordingRecord(id, GLOVE, id, subject, wearing, "done", facts, at, at)


def worn(assigned_s: float | None = None) -> GloveRecord:
    at = None if assigned_s is None else NOON + timedelta(seconds=assigned_s)
    return GloveRecord(GLOVE, LAYOUT.name, "anna", "w", "right", False, {}, NOON, NOON, at)


@pytest.mark.parametrize(
    ("record", "glove", "others", "most_s"),
    [
        (said("now", 100), worn(), [], 60.0),
        (said("now", 100), worn(assigned_s=10), [], 60.0),
        (said("now", 100), worn(assigned_s=70), [], 30.0),
        (said("now", 100), worn(), [said("other", 80, wearing="v")], 20.0),
        (said("now", 100), worn(assigned_s=90), [said("other", 80, wearing="v")], 10.0),
        (said("now", 100), worn(), [said("same", 80), said("other", 70, wearing="v")], 30.0),
        (said("now", 100, wearing="new"), worn(), [], 0.0),
        (said("now", 100, wearing="new"), worn(), [said("same", 75, wearing="new")], 25.0),
        (said("now", 100, wearing="new"), worn(), [said("same", 75, wearing="new"), said("o", 70)], 25.0),
        (said("now", 100, subject=None), worn(), [], 0.0),
    ],
)
def test_it_never_reaches_into_another_wearing(record, glove, others, most_s) -> None:
    wish = pre_roll_request(record, glove, [record, *others], NOON + timedelta(seconds=100))
    assert wish.most_s == most_s
    assert bool(wish.why_less) == (most_s < 60.0)


def test_a_data_folder_from_before_says_it_under_another_key() -> None:
    assert with_pre_roll({"lead_in": {"asked_s": 60.0}, "sent": 3}) == {
        "pre_roll": {"asked_s": 60.0},
        "sent": 3,
    }
