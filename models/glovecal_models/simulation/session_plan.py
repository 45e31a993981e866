"""What to record in a simulated session: which channels, how many takes, what motion, how clean a glove.

The sizes are typical values: 60 frames a second; a reference of 0.4 degrees white noise and as much again
that lasts 0.3 s; sensor noise of 0.3 degrees; a garment that creeps by 0.4 degrees within half a minute.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

from glovecal_models.errors import BadInput
from glovecal_models.layout import Layout
from glovecal_models.names import did_you_mean

TakeMotion = Literal["natural", "fast", "ramps", "holds", "one_finger", "poses", "still", "palm"]
TAKE_MOTIONS: tuple[TakeMotion, ...] = get_args(TakeMotion)
SHORTEST_TAKE_S = 5.0
FIVE_SENSORS = ("I_MCP", "I_PIP", "M_MCP", "M_PIP", "R_MCP")


@dataclass(frozen=True)
class SessionPlan:
    """A session to be simulated. The same plan is the same glove, hand, motion and noise, to the byte."""

    seed: int = 0
    sensors: tuple[str, ...] = FIVE_SENSORS
    rotations: tuple[str, ...] = ()
    """Rotations with a sensor of the same place or name; none given means one per sensor, named alike."""
    wearings: int = 3
    takes_per_wearing: int = 4
    take_s: float = 40.0
    rate_hz: float = 60.0
    motions: tuple[TakeMotion, ...] = ()
    """One motion for each take of a wearing or of the session; none given means natural motion."""
    bits: int = 8
    nuisance: Literal["white", "drift", "posture"] = "drift"
    """What a healthy glove has beside white noise: nothing, a slow slip, or one that follows posture."""
    reference_white_deg: float = 0.4
    reference_lasting_deg: float = 0.4
    """Size of the reference's noise that lasts 0.3 s (first-order)."""
    sensor_noise_deg: float = 0.3
    nuisance_deg: float = 0.4
    reference_clock: Literal["same", "own"] = "same"
    """With its own clock the reference has 100 rows a second at times of its own."""
    frame_jitter_s: float = 0.0
    """Standard deviation of the frames' times around the even beat."""
    confounded: bool = False
    """One power-on, one battery, wearings in turn: all three then grow with time and cannot be told apart."""
    cloth: bool = False
    """Whether neighbours pull on sensors as in Wang & Neff 2013, Table 1 (stretch.py)."""

    def __post_init__(self) -> None:
        if not self.sensors or len(set(self.sensors)) != len(self.sensors):
            raise BadInput(f"sensors must be given once each, not {self.sensors}")
        if self.rotations and not set(self.sensors) <= set(self.rotations):
            if len(self.rotations) != len(self.sensors):
                raise BadInput("rotations must be one per sensor, or name every sensor's own rotation")
        elif not self.rotations:
            object.__setattr__(self, "rotations", self.sensors)
        for name, value, lowest in (
            ("seed", self.seed, 0), ("wearings", self.wearings, 1),
            ("takes_per_wearing", self.takes_per_wearing, 1), ("take_s", self.take_s, SHORTEST_TAKE_S),
            ("rate_hz", self.rate_hz, 10), ("bits", self.bits, 6),
            ("frame_jitter_s", self.frame_jitter_s, 0),
        ):  # fmt: skip
            if not value >= lowest:
                raise BadInput(f"{name} is {value}; it must be at least {lowest}")
        if len(self.motions) not in (0, 1, self.takes_per_wearing, self.takes):
            raise BadInput(f"{len(self.motions)} motions for {self.takes_per_wearing} takes per wearing")
        unknown = set(self.motions) - set(TAKE_MOTIONS)
        if unknown:
            meant = did_you_mean(sorted(unknown)[0], TAKE_MOTIONS)
            raise BadInput(f"no motion {sorted(unknown)[0]!r}; {meant}")

    @property
    def takes(self) -> int:
        return self.wearings * self.takes_per_wearing

    @property
    def own_rotations(self) -> tuple[int, ...]:
        """For each sensor the place of its own rotation: by name, else by the sensor's own place."""
        by_name = set(self.sensors) <= set(self.rotations)
        return tuple(
            self.rotations.index(sensor) if by_name else place for place, sensor in enumerate(self.sensors)
        )

    def motion(self, take: int) -> TakeMotion:
        """The motion of the take of this number, counted from 0 over the session."""
        return self.motions[take % len(self.motions)] if self.motions else "natural"

    @classmethod
    def of_layout(cls, layout: Layout | str, **choices: Any) -> SessionPlan:
        """A plan with a layout's sensors and rotations, such as cyberglove18, and its neighbours' pulls."""
        layout = Layout.built_in(layout) if isinstance(layout, str) else layout
        plan: dict[str, Any] = {"sensors": layout.sensors, "rotations": layout.rotations, "cloth": True}
        return cls(**(plan | choices))


def take_names(plan: SessionPlan) -> Sequence[tuple[int, str, str]]:
    """For every take in order: its wearing's number from 0, its name and its wearing's name."""
    return [
        (wearing, f"w{wearing + 1}-t{take + 1}", wearing_name(wearing))
        for wearing in range(plan.wearings)
        for take in range(plan.takes_per_wearing)
    ]


def wearing_name(wearing: int) -> str:
    """How takes name the wearing of this number, counted from 0."""
    return f"wearing-{wearing + 1}"
