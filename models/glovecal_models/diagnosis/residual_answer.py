"""What a diagnosis leaves: the residual, what that asks for, and the recording that would decide."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field

from glovecal_models.presentation.document import answer

MORE_WEARINGS = "more_wearings"
MORE_TAKES = "more_takes"
FREE_MOTION = "free-motion"


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
    def command(self) -> str:
        """What starts the recording."""
        if self.motion == "taps":
            return "glovecal take latency GLOVE"
        return f"glovecal record GLOVE {self.take_name} --seconds {self.seconds}"


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
