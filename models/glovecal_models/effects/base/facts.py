"""What an effect declares of itself, so that nothing else has to know it by its name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Literal

Settings = dict[str, Any]
"""Constants an effect takes from its training takes: plain JSON-able data."""
Kind = Literal["correction", "repair", "interval", "finding", "nothing"]
"""How it acts on a calibration: it adds columns to the prediction, repairs the measured reference, widens the
claimed interval, is only found and shown, or does nothing (the null hypothesis)."""
Stage = Literal["first", "compared", "last", "never"]
"""When a diagnosis asks for it: by its signature in the recording before anything else is judged, because it
would mislead the others; by held-out error beside its control; by its signature once nothing that was
compared explains the error; or not at all."""
Control = Literal[
    "time-reversed", "circularly shifted", "context of other takes", "permuted wearings", "none"
]
ShownOver = Literal[
    "angle", "angle both ways", "speed", "hold", "time in take", "wearing", "take", "neighbour", "context",
    "clock shift",
]  # fmt: skip
"""What the one picture of an error that an effect leaves is drawn over: the joint's angle, apart for both
directions of motion where it says so, its speed, the seconds since it came to rest, the take's own time, one
value a wearing or a take, the reading of another sensor, a context column, or trial shifts of the reference
in time."""
HoldDrift = Literal["begins anew with each hold", "slows down", "goes on"]
"""How readings drift while a pose is held."""


@dataclass(frozen=True)
class Parameter:
    """A number of the effect that is learned and shown to the user."""

    name: str
    unit: str
    low: float
    high: float
    prior: str
    """What is known before any measurement, in words."""


@dataclass(frozen=True)
class Certainty:
    """How small the p value of an effect that changes between takes must be before it is named."""

    clear: float
    """Where the effect saves a large share of the error."""
    faint: float
    """Where it saves less."""
    why: str
    """What these limits rest on."""


@dataclass(frozen=True)
class Motion:
    """A recording to make."""

    name: str
    what: str
    """The instruction, in the words that the wearer reads."""
    seconds: int


@dataclass(frozen=True)
class Rival:
    """Another effect that the same takes may not tell apart, and the recording that does."""

    effect: str
    told_apart_by: Motion


BETWEEN_TAKES = Certainty(
    clear=0.025,
    faint=0.005,
    why="context columns have many names, and one of them goes along with the takes by chance",
)
CHANGES_BETWEEN_TAKES: tuple[Control, ...] = ("context of other takes", "permuted wearings")


class EffectFacts:
    """What is known of an effect without any data. Everything has a default but the first three."""

    name: ClassVar[str]
    explanation: ClassVar[str]
    """One sentence for somebody who wears the glove."""
    source: ClassVar[str]
    """The paper, standard or measurement it comes from."""
    plain_name: ClassVar[str] = ""
    """As a sentence calls it; empty: its name with spaces."""

    kind: ClassVar[Kind] = "correction"
    stage: ClassVar[Stage] = "compared"
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    """The shape, in the order of its last axis."""
    context: ClassVar[tuple[str, ...]] = ()
    """Context columns it needs, all of them."""
    control: ClassVar[Control] = "time-reversed"
    """Columns with the same freedom made of inputs that cannot be right."""
    has_memory: ClassVar[bool] = False
    one_joint_at_a_time: ClassVar[bool] = False
    """Whether each joint has inputs of its own: signals that the joint's base reads already are left out."""

    certainty: ClassVar[Certainty] = BETWEEN_TAKES
    """Asked for where it changes between takes (``changes_between_takes``)."""
    rivals: ClassVar[tuple[Rival, ...]] = ()
    """It is enough that one of two rivals names the other."""
    shown_by: ClassVar[Motion | None] = None
    """The recording in which it shows most: proposed against a rival that neither effect names."""
    alike: ClassVar[tuple[str, ...]] = ()
    """Effects that what a correction leaves of this one looks like: not asked for once a model has this."""
    alike_between_levels: ClassVar[tuple[str, ...]] = ()
    """Effects that one pass over known angles, held one after another, cannot tell it from."""
    shows_in: ClassVar[tuple[str, ...]] = ()
    """What an error that it leaves goes along with, as ``glovecal where`` calls it: "angle", "speed",
    "direction", "time in take", "wearing", and "joint" or "sensor" for any other one. Context columns that it
    reads count by themselves."""
    shown_over: ClassVar[ShownOver] = "angle"
    """Over what an error that it leaves is drawn."""
    neighbours: ClassVar[tuple[str, ...]] = ()
    """Of an effect shown over a neighbour the sensors that may be it; empty: any."""
    learned_by: ClassVar[str | None] = None
    """The training method whose base learns it by itself: asked for where the base is a straight line."""
    is_physical: ClassVar[bool] = True
    """Whether its name says what happens; not where only a recorded column is named."""
    also_explained_by: ClassVar[tuple[str, ...]] = ()
    """Of an effect known by its signature: effects that seem to explain a part of it."""
    also_explained_share: ClassVar[float] = 0.0
    """Share of the squared error up to which they do; who explains more is no such effect."""
    rest_like: ClassVar[tuple[str, ...]] = ()
    """Effects that what the form of this one misses may look like: beside it they have to save more."""
    rest_unlike: ClassVar[tuple[str, ...]] = ()
    """Effects that it hardly does: these may save less."""
    caveat: ClassVar[str] = ""
    """What the same evidence may also mean, as the end of a sentence that names the effect."""
    drift_in_holds: ClassVar[HoldDrift | None] = None
    """How readings drift while a pose is held, where the effect makes them."""

    @property
    def needs_time(self) -> bool:
        """Whether its columns depend on when the frames were: it remembers, or it reads the time itself."""
        return self.has_memory

    @property
    def needs_movement(self) -> bool:
        """Whether single poses cannot show it: they need the movement from one to the next."""
        return self.has_memory

    @property
    def has_columns(self) -> bool:
        """Whether it corrects the prediction."""
        return self.kind == "correction"

    @property
    def changes_between_takes(self) -> bool:
        """Whether it differs between takes, not inside them: only whole takes are witnesses for it."""
        return self.control in CHANGES_BETWEEN_TAKES

    def may_show_in(self, column: str) -> bool:
        """Whether an error that goes along with ``column``, as ``glovecal where`` calls it, may be of it."""
        kind, _, name = column.partition(" ")
        if kind == "context":
            return name in self.context
        return column in self.shows_in or (kind in self.shows_in and bool(name))

    @property
    def spoken(self) -> str:
        """Its name in a sentence."""
        return self.plain_name or self.name.replace("_", " ")
