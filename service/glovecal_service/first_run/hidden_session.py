"""A simulated subject whose glove has one physical cause hidden in it, as takes to learn from and to test on.

The service sees the tables only; what was hidden stays here until the demo reveals it.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean
from glovecal_models.simulation.causes.catalogue import KNOWN_CAUSES, UNKNOWN_CAUSES
from glovecal_models.simulation.causes.form import Cause, HiddenCause
from glovecal_models.simulation.session import RecordedSession, RecordedTake, record_session
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_models.takes.take import Take
from glovecal_models.takes.write_table import write_takes
from glovecal_service.first_run.hidden_effect import TRUTH

RANDOM_EFFECTS = (
    "hysteresis", "creep", "lag", "clock_offset", "warmup_drift", "temperature", "donning_shift",
    "supply_sag", "cross_coupling", "contact_pressure",
)  # fmt: skip
"""What a session of this length shows."""
UNSEEN = {"nonlinearity": "LMC-GPR bends with it", "palm_arch": "this glove has no sensor in the palm"}
"""Causes that this session cannot show, and why."""
RANDOM_UNKNOWN = ("unknown:common_swing", "unknown:tilt")
"""Causes with no neighbour in the catalogue. ``unknown:posture_locked`` can be asked for by its name: grip
pressure that nobody recorded looks like cross coupling, and is named so with that reservation."""
STRENGTH_DEG = 3.0
"""Some four noise floors: a pinch that visibly does not close."""
WEARINGS, TAKES_PER_WEARING, TAKE_S = 3, 4, 20.0
LIVE_S = 5.0


@dataclass(frozen=True)
class HiddenSession:
    """The last take of every wearing is for testing; the others are for learning."""

    session: RecordedSession
    seed: int

    @property
    def truth(self) -> HiddenCause | None:
        """What is hidden; None in a healthy glove."""
        return self.session.causes[0] if self.session.causes else None

    @property
    def training(self) -> list[Take]:
        return [take for place, take in enumerate(self.session.takes) if not self._is_test(place)]

    @property
    def test(self) -> list[Take]:
        return [take for place, take in enumerate(self.session.takes) if self._is_test(place)]

    def live(self, seconds: float = LIVE_S) -> RecordedTake:
        """One more take, in the last wearing, with what the hand really did."""
        return self.session.also("natural", seconds, self.session.plan.wearings - 1)

    def write(self, folder: Path) -> tuple[Path, Path]:
        """``training.csv`` and ``test.csv``, marked as simulated; the folder is made."""
        folder.mkdir(parents=True, exist_ok=True)
        files = folder / "training.csv", folder / "test.csv"
        for file, takes in zip(files, (self.training, self.test), strict=True):
            write_takes(takes, file)
        return files

    def write_truth(self, folder: Path) -> Path:
        """``hidden.json``: what was hidden, for whoever walked the loop alone. The folder is made."""
        folder.mkdir(parents=True, exist_ok=True)
        truth = None if self.truth is None else asdict(self.truth)
        file = folder / TRUTH
        file.write_text(json.dumps({"seed": self.seed, "hidden": truth}, indent=2) + "\n")
        return file

    def _is_test(self, place: int) -> bool:
        return (place + 1) % self.session.plan.takes_per_wearing == 0


def hidden_session(effect: str, seed: int, *, take_s: float = TAKE_S) -> HiddenSession:
    """``effect`` is a cause's name, or ``random``, ``none`` or ``unknown``. The same seed, the same session.

    Raises BadInput for another name.
    """
    plan = SessionPlan(seed=seed, wearings=WEARINGS, takes_per_wearing=TAKES_PER_WEARING, take_s=take_s)
    name = _drawn(check_effect(effect), seed)
    causes = [] if name == "none" else [Cause(name, strength_deg=STRENGTH_DEG)]
    return HiddenSession(record_session(plan, causes), seed)


def check_effect(effect: str) -> str:
    """The name itself. Raises BadInput when nothing of that name can be hidden."""
    if effect in UNSEEN:
        raise BadInput(f"effect {effect!r} cannot be hidden in the demo: {UNSEEN[effect]}")
    known = tuple(name for name in KNOWN_CAUSES if name not in UNSEEN)
    choices = ("random", "none", "unknown", *known, *UNKNOWN_CAUSES)
    if effect not in choices:
        raise BadInput(f"no effect {effect!r} can be hidden; {did_you_mean(effect, choices)}")
    return effect


def _drawn(effect: str, seed: int) -> str:
    choices = {"random": RANDOM_EFFECTS, "unknown": RANDOM_UNKNOWN}.get(effect)
    if choices is None:
        return effect
    return choices[int(np.random.default_rng([seed, 53]).integers(len(choices)))]
