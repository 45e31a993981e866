"""How a glove is, in one word, one colour and one sentence."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from glovecal_client.wire.pose import Pose

Word = Literal["lost", "uncalibrated", "stale", "settling", "faulty sensor", "ok", "unwatched"]

SENTENCES: dict[Word, str] = {
    "lost": "No frames arrive: glove, cable or capture daemon.",
    "uncalibrated": "Frames arrive, but no model is active for this subject and layout.",
    "stale": "The last pose is old: do not use it.",
    "settling": "An effect with a memory started anew; its correction is not complete yet.",
    "faulty sensor": "A sensor fails now: its joints keep their last good angles.",
    "ok": "Calibrated poses arrive.",
    "unwatched": "Frames arrive.",
}


@dataclass(frozen=True)
class GloveState:
    """What a page shows of a glove before anything else."""

    word: Word
    sentence: str
    rate_hz: float | None
    """Measured by the capture daemon, frames a second."""
    is_simulated: bool
    age_ms: float | None
    """From the service's receipt of the frame to the pose."""
    skipped: int
    """Frames of this run that the service left out for newer ones."""


def glove_state(status: dict[str, Any], is_silent: bool, pose: Pose | None, is_stale: bool) -> GloveState:
    """From the capture daemon's ``status``, whether that is old, and the newest pose of a watched glove."""
    word = _word(status, is_silent, pose, is_stale)
    told = str(status.get("sentence") or "") if word == "lost" and not is_silent else ""
    return GloveState(
        word=word,
        sentence=told or SENTENCES[word],
        rate_hz=None if word == "lost" else status.get("rate_hz"),
        is_simulated=pose is not None and pose.simulated,
        age_ms=None if pose is None or word in ("lost", "stale") else pose.age_us / 1000.0,
        skipped=0 if pose is None else pose.skipped,
    )


def _word(status: dict[str, Any], is_silent: bool, pose: Pose | None, is_stale: bool) -> Word:
    if is_silent or status.get("state") != "streaming":
        return "lost"
    if pose is None:
        return "unwatched"
    if pose.uncalibrated:
        return "uncalibrated"
    if is_stale:
        return "stale"
    if pose.faulty_sensor:
        return "faulty sensor"
    return "settling" if pose.settling else "ok"
