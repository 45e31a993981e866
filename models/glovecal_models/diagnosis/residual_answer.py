"""What a diagnosis leaves: the residual, what that asks for, and the recording that would decide."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from glovecal_models.presentation.document import Lines, Part, answer, counted

MORE_WEARINGS = "more_wearings"
MORE_TAKES = "more_takes"
FREE_MOTION = "free-motion"
CHANCE = "chance"


@answer
class NextTake:
    """A recording to make, and what it separates."""

    motion: str
    """Its kind, such as ramps; taps is no take but `glovecal take latency`."""
    what: str
    """The instruction, for the wearer."""
    seconds: int
    separates: tuple[str, ...]
    """Effects; "chance" where the takes are too few to tell an effect from it."""
    take_name: str
    """What to call it: a diagnosis tells by the name that no other take shows this motion."""
    takes: int = 1
    """Of which its seconds are the sum."""

    @property
    def sentence(self) -> str:
        return f"To separate {' and '.join(self.separates)}, record {self.seconds} s: {self.what}"

    @property
    def reason(self) -> str:
        """Why it is asked for, beside takes that teach a model."""
        *others, last = [name.replace("_", " ") for name in self.separates]
        rivals = f"{', '.join(others)} {'and' if others else ''} {last}".strip()
        return f"The diagnosis cannot tell {rivals} apart with the takes there are; this one would."

    @property
    def is_take(self) -> bool:
        """Else it is measured without a reference."""
        return self.motion != "taps"

    @property
    def command(self) -> str:
        """What starts the recording."""
        if not self.is_take:
            return "glovecal take latency GLOVE"
        return f"glovecal record GLOVE {self.take_name} --seconds {self.seconds}"


@answer
class PlannedTakes:
    """Takes of one kind to record, each with a reference."""

    take_names: tuple[str, ...]
    """What to call each: a diagnosis tells motions by names."""
    seconds: int
    """Of each."""
    motion: str
    """Its kind, such as ramps; more_takes and more_wearings are free motion."""
    what: str
    """The instruction, for the wearer."""
    is_put_on_anew: bool = False
    """Whether the glove is taken off and put on before the first of them: they are a wearing of their own."""
    opens: tuple[str, ...] = ()
    """Effects that can be judged after them and all takes planned before."""
    separates: tuple[str, ...] = ()
    """Effects that they tell apart."""

    @classmethod
    def of(cls, asked: NextTake) -> PlannedTakes:
        names, seconds = (asked.take_name,) * asked.takes, round(asked.seconds / asked.takes)
        return cls(names, seconds, asked.motion, asked.what, separates=asked.separates)

    @property
    def takes(self) -> int:
        return len(self.take_names)

    @property
    def sentence(self) -> str:
        """What to do, for how long, and what for."""
        put_on = "Take the glove off and put it on again, then record" if self.is_put_on_anew else "Record"
        named = ", ".join(dict.fromkeys(self.take_names))
        parts = [f"{put_on} {counted(self.takes, 'take')} of {self.seconds} s, named {named}. {self.what}"]
        if self.separates:
            parts.append(f"Tells apart: {', '.join(self.separates)}.")
        if self.opens:
            parts.append(f"Can be judged then: {', '.join(self.opens)}.")
        return " ".join(parts)

    @property
    def command(self) -> str:
        """What starts the recording of one of them."""
        return f"glovecal record GLOVE {self.take_names[0]} --seconds {self.seconds}"


@dataclass(frozen=True)
class PlannedTake:
    """One take of a plan."""

    step: PlannedTakes
    name: str
    is_put_on_anew: bool
    """Whether the glove is taken off and put on before it."""


@answer
class TakePlan:
    """All takes to record so that everything can be judged that further takes can show."""

    steps: Sequence[PlannedTakes]
    """In the order in which they are recorded."""
    columns: tuple[str, ...] = ()
    """Context columns that have another value in each take than in all before."""

    @property
    def opens(self) -> tuple[str, ...]:
        return tuple(name for step in self.steps for name in step.opens)

    @property
    def each_take(self) -> list[PlannedTake]:
        """One after the other."""
        return [
            PlannedTake(step, name, step.is_put_on_anew and number == 0)
            for step in self.steps
            for number, name in enumerate(step.take_names)
        ]

    def take_at(self, place: int) -> PlannedTake | None:
        """Counted from 0; None after the last."""
        return dict(enumerate(self.each_take)).get(place)

    @property
    def heading(self) -> str:
        """How much there is to record, before the steps."""
        seconds = sum(step.takes * step.seconds for step in self.steps)
        whole, rest = divmod(seconds, 60)
        length = f"{seconds} s" if seconds < 120 else f"{whole} min{f' {rest} s' if rest else ''}"
        return f"{counted(len(self.each_take), 'further take')} ({length} in all) would decide more:"

    @property
    def sentences(self) -> list[str]:
        """The steps in their order."""
        numbered = [f"{place}. {step.sentence}" for place, step in enumerate(self.steps, 1)]
        return [*numbered, self.columns_sentence] if self.columns else numbered

    @property
    def parts(self) -> list[Part]:
        """As people read it."""
        return [self.heading, Lines(self.sentences)]

    @property
    def columns_sentence(self) -> str:
        """What differs from take to take; empty where nothing has to."""
        columns = ", ".join(f"c.{name}" for name in self.columns)
        return f"In each take let this differ from all before: {columns}." if columns else ""


def unplanned(following: NextTake | None, plan: TakePlan | None) -> NextTake | None:
    """What decides and is not in the plan; None where that has it, or nothing is to be decided."""
    return following if following is not None and (plan is None or not following.is_take) else None


def to_record(following: NextTake | None, plan: TakePlan | None) -> TakePlan | None:
    """The plan, else that of the one take that decides; None where there is nothing to record."""
    if plan is not None or following is None or not following.is_take:
        return plan
    return TakePlan([PlannedTakes.of(following)])


def explained(before_deg: float, after_deg: float, control_deg: float, p_value: float | None = None) -> str:
    """What an effect and its control explain, as shares of the squared error of the sensors that read the
    rotations. Degrees are those of a model: only training, adding an effect and comparing tell them."""
    of_effect, of_control = (
        max(1.0 - (left / max(before_deg, 1e-9)) ** 2, 0.0) for left in (after_deg, control_deg)
    )
    p = "" if p_value is None else f", p = {p_value:.2g}"
    return (
        f"{100 * of_effect:.0f} % of the squared error of these sensors on held-out takes (control:"
        f" {100 * of_control:.0f} %{p})"
    )


@answer
class FloorTimes:
    """An error that is left, beside its noise floor."""

    rmse_deg: float | None
    """Smoothed error on held-out takes."""
    times_floor: float | None
    """Over the noise floor."""
    lower_times_floor: float | None
    """Its lower 95 % bound over the upper end of the floor's interval."""
    is_judgeable: bool
    """Whether the floor is reliable and enough was measured."""


@answer
class AssociatedColumn:
    """A recorded column that the residual depends on."""

    rotation: str
    column: str
    """As in `where`: "angle", "sensor NAME", "context NAME", "wearing"."""
    phrase: str
    size_deg: float | None
    """Root mean square that it explains beyond chance."""
    p_value: float | None
    """Corrected for all columns and rotations tested."""


@answer
class Unexplained:
    """What remains of the error, and what it goes along with."""

    is_significant: bool
    sentence: str
    not_identifiable: str | None = None
    """Why these takes cannot tell."""
    associations: Sequence[AssociatedColumn] = ()
    floor_ratios: Mapping[str, FloorTimes] = field(default_factory=dict)
    """For each rotation with a known floor."""


@answer
class Remedy:
    """What an association of the residual asks for."""

    rotation: str
    column: str
    """As in `where`."""
    phrase: str
    """The column in words."""
    effect: str | None
    """To be added on the rotation; null where only `method` helps."""
    is_physical: bool
    """False: the effect only names a column, no cause is claimed."""
    method: str | None
    """To be trained with rather: a straight line cannot use the column."""
    rmse_before_deg: float | None
    """Of the rotation's sensor, on takes held out whole."""
    rmse_after_deg: float | None
    """With the effect, in the form that the takes ask for."""
    rmse_control_deg: float | None
    """With its control, of the same form and freedom."""
    saves: bool
    """Whether the effect beats its control."""
    is_within_known: bool
    """Whether the model's own effects may have left as much; improve does not add it then."""
    sentence: str = ""

    def __post_init__(self) -> None:
        said = f"{self.rotation}: the residual is associated with {self.phrase}"
        object.__setattr__(self, "sentence", f"{said}{self._asks_for()}")

    def _asks_for(self) -> str:
        if self.method is not None:
            return (
                ", which the layout gives it and a straight line cannot use: nonlinearity of the base; train"
                f" with --method {self.method}."
            )
        before, after, control = self.rmse_before_deg, self.rmse_after_deg, self.rmse_control_deg
        if self.effect is None or not self.saves or before is None or after is None or control is None:
            return "; no effect of it reduces the smoothed error more than its control."
        unnamed = "" if self.is_physical else " (no cause is claimed)"
        within = " That is no more than the model's own effects may have left there." * self.is_within_known
        return f"; {self.effect}{unnamed} explains {explained(before, after, control)}.{within}"

    @property
    def to_try(self) -> str | None:
        if self.method:
            return f"method {self.method}"
        return self.effect if self.saves else None
