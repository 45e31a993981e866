"""One glove of the blind study: what is hidden in it, how it is built, and its recording.

A diagnosis gets the takes and the layout. What is hidden stays here, for the marking.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
from further_forms import every_form
from wandering_reference import WANDER_DEG, with_wander

from glovecal_models.layout import Layout
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import RecordedSession, record_session
from glovecal_models.simulation.session_plan import (
    FIVE_SENSORS,
    SessionPlan,
    TakeMotion,
    TakeStart,
)
from glovecal_models.takes.take import Take

PALM_SENSORS = ("I_MCP", "M_MCP", "R_MCP", "P_MCP", "P_PIP", "T_TMC", "PALM_ARCH")
"""Six joints, and the sensor without which no palm arch can be seen; the thumb, as its opposition enters."""
BYSTANDER_DEG = 1e-3
"""A recorded column whose cause is this small explains nothing."""

Nuisance = Literal["white", "drift", "posture", "reference"]
"""What a healthy glove has beside white noise (``SessionPlan``); or such a glove with only white noise, and a
reference that wanders (``wandering_reference.py``)."""
Bystander = Literal["none", "contact_pressure", "unknown:context"]


@dataclass(frozen=True)
class BlindGlove:
    """Plain settings; the same settings are the same glove, to the byte."""

    part: str
    truth: str
    """The row it is marked in: an effect's name, two joined by "+", "none", or "unknown:..."."""
    number: int
    size: float
    """Strength of each cause in noise floors; 0 for a clean glove."""
    seed: int
    causes: tuple[Cause, ...] = ()
    bits: int = 8
    rate_hz: float = 60.0
    nuisance: Nuisance = "drift"
    linear: bool = False
    """Whether the calibration is a straight line of the own sensor; else it bends (the flexible base)."""
    bystander: Bystander = "none"
    """A cause's column that is recorded without the cause."""
    palm: bool = False
    joints: tuple[str, ...] = FIVE_SENSORS
    """Each with a sensor of its own; a glove with a palm sensor has its own six."""
    set_aside: bool = False
    wearings: int = 3
    takes_per_wearing: int = 4
    take_s: float = 40.0
    motion: TakeMotion = "natural"
    """Of every take."""
    lead_s: float = 0.0
    """So long the glove streams before the reference of each take begins."""

    @property
    def key(self) -> str:
        """All settings as text: two gloves are the same if their keys are."""
        return json.dumps(self.to_document(), sort_keys=True)

    def to_document(self) -> dict[str, Any]:
        return asdict(self)

    @property
    def plan(self) -> SessionPlan:
        return SessionPlan(
            seed=self.seed,
            sensors=PALM_SENSORS if self.palm else self.joints,
            bits=self.bits,
            nuisance="white" if self.nuisance == "reference" else self.nuisance,
            rate_hz=self.rate_hz,
            wearings=self.wearings,
            takes_per_wearing=self.takes_per_wearing,
            take_s=self.lead_s + self.take_s,
            motions=(self.motion,),
        )

    @property
    def layout(self) -> Layout:
        """Each joint from its own sensor; the palm's sensor is read by none of them."""
        rotations = {name: [name] for name in self.plan.rotations if name != "PALM_ARCH"}
        counts = [1, 2**self.bits - 1]
        document = {"name": "study", "sensors": list(self.plan.sensors), "rotations": rotations}
        return Layout.from_document(document | {"counts": counts})

    @cached_property
    def session(self) -> RecordedSession:
        """The recording; a bystander's column stands in it, its cause does not show."""
        extra = () if self.bystander == "none" else (Cause(self.bystander, strength_deg=BYSTANDER_DEG),)
        return record_session(self.plan, (*self.causes, *extra), forms_of=every_form)

    @property
    def takes(self) -> tuple[Take, ...]:
        """What the diagnosis sees."""
        return tuple(self._measured(take) for take in self.session.takes)

    @property
    def clean_takes(self) -> tuple[Take, ...]:
        """The same glove and noise without causes."""
        return tuple(self._measured(take) for take in self.session.clean)

    def also(self, motion: TakeMotion, take_s: float, wearing: int, *, repeat: int = 0) -> Take:
        """One more take after the session, as ``RecordedSession.also``, of the same glove and reference."""
        return self._wandering(self.session.also(motion, take_s, wearing, repeat=repeat).take)

    def at(self, start: TakeStart) -> Take:
        """One more take in circumstances of its own, as ``RecordedSession.at``."""
        return self._wandering(self.session.at(start).take)

    @property
    def duration_s(self) -> float:
        """Measured seconds of the whole session."""
        return self.wearings * self.takes_per_wearing * self.take_s

    @property
    def floor_deg(self) -> float:
        """RMS over joints of what a perfect static calibration of the healthy glove leaves."""
        wander = WANDER_DEG if self.nuisance == "reference" else 0.0
        return float(np.sqrt(np.mean(np.square(list(self.session.floor_deg.values()))) + wander**2))

    @property
    def column(self) -> str | None:
        """The context column that records an unknown cause, where there is one."""
        return next((item.column for item in self.session.causes[: len(self.causes)] if item.column), None)

    def told(self) -> dict[str, Any]:
        """The strength that was reached, for the record; forms and sensors stand among the settings."""
        return {
            "reached_deg": [
                round(float(np.sqrt(np.mean(np.square(list(item.reached_deg.values()))))), 3)
                for item in self.session.causes[: len(self.causes)]
            ],
            "floor_deg": round(self.floor_deg, 3),
        }

    def _measured(self, take: Take) -> Take:
        return self._wandering(_reference_from(take, self.lead_s))

    def _wandering(self, take: Take) -> Take:
        return with_wander(take, self.seed) if self.nuisance == "reference" else take


def _reference_from(take: Take, begin_s: float) -> Take:
    """The same frames with a reference that begins later."""
    measured = take.reference_time_s >= take.time_s[0] + begin_s
    return replace(take, reference_time_s=take.reference_time_s[measured], reference=take.reference[measured])
