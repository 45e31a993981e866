"""How a glove is, in one word, one colour and one sentence."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from glovecal_client.wire.pose import Pose

Word = Literal["lost", "uncalibrated", "stale", "settling", "faulty sensor", "check", "ok", "unwatched"]

SENTENCES: dict[Word, str] = {
    "lost": "No frames arrive: glove, cable or capture daemon.",
    "uncalibrated": "Frames arrive, but no model is active for this subject and layout.",
    "stale": "The last pose is old: do not use it.",
    "settling": "An effect with a memory started anew; its correction is not complete yet.",
    "faulty sensor": "A sensor fails now: its joints keep their last good angles.",
    "check": "Something is wrong with glove or wearer.",
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
    lost: int | None
    """Frames that were sent and never reached the service since it started; None: it has not said."""
    refused: int
    """Frames that reached it and could not be used."""
    model: str | None
    """Of the newest pose, 64 hexadecimal digits; None: uncalibrated. Of a glove that is not watched, as the
    service says."""


def glove_state(
    status: Mapping[str, Any],
    is_silent: bool,
    pose: Pose | None,
    is_stale: bool,
    account: Mapping[str, Any] | None = None,
) -> GloveState:
    """From the capture daemon's ``status``, whether that is old, the newest pose of a watched glove, and the
    service's own ``account`` of the glove."""
    word, account = _word(status, is_silent, pose, is_stale), account or {}
    warning = _warning(account)
    if warning and word in ("ok", "settling"):
        word = "check"
    told = {
        "lost": "" if is_silent else status.get("sentence"),
        "uncalibrated": account.get("sentence"),
        "check": warning,
    }
    is_here = word not in ("lost", "stale")
    refused = account.get("refused")
    return GloveState(
        word=word,
        sentence=_as_sentence(str(told.get(word) or "")) or SENTENCES[word],
        rate_hz=None if word == "lost" else _number(status.get("rate_hz")),
        is_simulated=pose is not None and pose.simulated,
        age_ms=pose.age_us / 1000.0 if pose is not None and is_here else None,
        skipped=0 if pose is None else pose.skipped,
        lost=None if (lost := _number(account.get("missing"))) is None else int(lost),
        refused=int(sum(_number(each) or 0 for each in refused.values())) if isinstance(refused, dict) else 0,
        model=_identity(account.get("model")) if pose is None else pose.model_sha256,
    )


def _warning(account: Mapping[str, Any]) -> str:
    """What the service noticed in the last seconds, and that glove and wearer are of different hands."""
    warnings, said = account.get("warnings"), account.get("sentence")
    told = [said] if isinstance(said, str) and said.startswith("wrong hand") else []
    for one in warnings if isinstance(warnings, list) else ():
        if isinstance(one, dict):
            told.append(f"{one.get('sentence')} {one.get('advice')}")
    return " ".join(told)


def _number(value: Any) -> float | None:
    """What came over the network may be anything."""
    is_number = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    return float(value) if is_number else None


def _identity(value: Any) -> str | None:
    """What came over the network may be anything."""
    return value if isinstance(value, str) else None


def _as_sentence(text: str) -> str:
    """The service's reasons are clauses."""
    text = text.strip()
    return f"{text[0].upper()}{text[1:]}{'' if text[-1] in '.!?' else '.'}" if text else ""


def _word(status: Mapping[str, Any], is_silent: bool, pose: Pose | None, is_stale: bool) -> Word:
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
