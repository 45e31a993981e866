"""An effect hidden in a simulated glove, kept in the data folder until somebody has looked for it.

Its subject's name holds the seed, so that ``glovecal demo --seed`` makes the same glove; nothing that a page
shows names the effect before one was added, or the answer was asked for.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from glovecal_models.documents import read_json
from glovecal_models.errors import BadInput
from glovecal_models.simulation.causes.form import HiddenCause
from glovecal_models.simulation.session_plan import FIVE_SENSORS
from glovecal_service.plain import read

Verdict = Literal["right", "partly right", "wrong"]
TRUTH = "hidden.json"
SEEDS = 10_000
"""Drawn below this: short enough to be typed again."""
TRAINING = {"samples": 600, "folds": 2}
"""Five joints with one sensor each need no more. The folds give each version the error that the studio shows;
what the demo prints is measured on the test takes."""


def hidden_sentence(truth: HiddenCause, sensors: Sequence[str]) -> str:
    """What was hidden, and where among the glove's ``sensors``."""
    where = "all sensors" if len(truth.channels) == len(sensors) else ", ".join(truth.channels)
    return f"Hidden effect: {truth.name} (form: {truth.form}) on {where}. {truth.description}"


@dataclass(frozen=True)
class HiddenEffect:
    """Of one subject."""

    seed: int
    hidden: HiddenCause

    @property
    def sentence(self) -> str:
        return hidden_sentence(self.hidden, FIVE_SENSORS)

    def verdict(self, added: Sequence[str]) -> tuple[Verdict, str]:
        """Of the effects that somebody added, in a word and a sentence."""
        name, others = self.hidden.name, [effect for effect in added if effect != self.hidden.name]
        if name not in added:
            return "wrong", f"Wrong: you added {' and '.join(others)}; {name} was hidden."
        if others:
            return "partly right", f"Partly right: {name} was hidden; you also added {' and '.join(others)}."
        return "right", f"Right: {name} was hidden."


def subject_of(seed: int) -> str:
    return f"hidden-{seed}"


class HiddenEffects:
    """All that were hidden on this service, each in the folder of its subject."""

    def __init__(self, data: Path) -> None:
        self._folder = data / "hidden-effects"

    def folder(self, subject: str) -> Path:
        """Where the answer is written."""
        return self._folder / subject

    def subjects(self) -> Iterator[str]:
        """The newest first."""
        files = sorted(self._folder.glob(f"*/{TRUTH}"), key=lambda file: file.stat().st_mtime, reverse=True)
        return (file.parent.name for file in files)

    def of(self, subject: str) -> HiddenEffect | None:
        """None for a subject that was not made here."""
        file = self.folder(subject) / TRUTH
        try:
            return read(HiddenEffect, read_json(file.read_bytes(), TRUTH))
        except (OSError, ValueError, BadInput):
            return None
