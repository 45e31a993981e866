"""What became of a training, and what the angles of one frame are made of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, replace
from math import sqrt
from typing import TYPE_CHECKING, Any, Literal

from glovecal_models.calibration.order_confounding import OrderConfounding
from glovecal_models.effects.base.form_curve import LaneCurves
from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean
from glovecal_models.presentation.document import (
    Answer,
    Chart,
    Column,
    Fact,
    Lines,
    Part,
    Presentation,
    Section,
    Table,
    answer,
)
from glovecal_models.presentation.drawing import MODEL
from glovecal_models.takes.camera_estimates import CoveredRange

if TYPE_CHECKING:
    from matplotlib.axes import Axes


SHORT = 12


@answer
class ModelEffect:
    """An effect that a model has learned."""

    effect: str
    explanation: str
    rotations: Sequence[str]
    """Rotations that it corrects."""
    parameters: Mapping[str, Mapping[str, float | None]]
    """For each rotation the learned numbers, their units in their names."""
    curves: Mapping[str, LaneCurves]
    """For each rotation what a learned form adds over its inputs; empty without one."""
    context: Sequence[str]
    """Context columns that it needs."""
    has_memory: bool
    """Whether it depends on earlier frames."""
    settling_s: float
    """So long after a start a live pose is flagged as settling; 0: never."""
    evidence: Mapping[str, Any]
    """What it saved when it was added."""
    declaration: Mapping[str, Any] | None
    """Of an effect of the user's own."""


@answer
class Trained(Answer):
    """A calibration model that was trained, and its error on what was left out."""

    model: str
    """Its id."""
    held_out_rmse_deg: float | None
    """On takes left out of training, over all rotations; null: no cross-validation."""
    rmse_unseen_wearing_deg: float | None
    """In a wearing that training did not see; null: one wearing only."""
    per_rotation: Mapping[str, float | None]
    """Held-out RMSE, degrees; null for a rotation that follows from others by rule."""
    sentences: Sequence[str]
    """What it was trained on, and what to heed."""
    confounded_order: Sequence[OrderConfounding]
    """Rotations of wearings in which a drift would look like posture."""
    camera_ranges: Sequence[CoveredRange]
    """Angles that a camera saw, where one measured."""
    active: bool
    """Whether live frames are predicted with it."""
    subject: str = ""
    method: str = ""
    held_out_how: str = ""
    wearing_sentences: Sequence[str] = ()
    """On the error in a wearing not seen."""
    people: int = 0
    """How many other people's takes were its prior."""
    alone_rmse_deg: float | None = None
    """Held out, had there been no prior of people; null: none was asked for, or nothing could be trained."""

    def presentation(self) -> Presentation:
        from glovecal_models.calibration.methods import OF_SHAPES

        facts = [Fact("", sentence) for sentence in self._sentences()]
        if self.method not in OF_SHAPES:
            facts.append(Fact("Next", f"glovecal diagnose {self.model[:SHORT]}", is_command=True))
        known = {name: error for name, error in self.per_rotation.items() if error is not None}
        rows = sorted(known.items(), key=lambda item: -item[1])
        table = Table([Column("rotation"), Column("held_out_rmse_deg", "held-out error (°)")], rows)
        chart = Chart(
            lambda axes: _draw(axes, rows), 6.0, 1.2 + 0.22 * len(rows), "Held-out RMSE, the largest first."
        )
        return Presentation(
            f"Training of {self.subject}",
            facts,
            sections=[
                Section("Error of each rotation", [chart, table] if rows else [], is_detail=True),
                Section("What it was trained on", [Lines(self.sentences)], is_detail=True),
            ],
        )

    def _sentences(self) -> list[str]:
        said = [self._sentence(), *self.wearing_sentences]
        if self.people:
            alone = self.alone_rmse_deg
            without = "too few own takes to tell" if alone is None else f"{alone:.2f} degrees"
            said.insert(1, f"Its prior is the takes of {self.people} other people; error without: {without}.")
        return said

    def _sentence(self) -> str:
        error, how = self.held_out_rmse_deg, self.held_out_how
        told = "no cross-validation" if error is None else f"held-out error {error:.2f} degrees"
        if error is not None and "widgets" in how:
            told = f"error on widgets left out, one at a time, {error:.2f} degrees"
        elif error is not None and "takes" not in how:
            told = f"error on left-out parts of its takes {error:.2f} degrees"
        active = "Active." if self.active else "Not active."
        return f"Model {self.model[:SHORT]} ({self.method}) for {self.subject}, {told}. {active}"


def _draw(axes: Axes, rows: Sequence[tuple[str, float]]) -> None:
    axes.barh(range(len(rows)), [error for _, error in rows], color=MODEL)
    axes.set_yticks(range(len(rows)), [name for name, _ in rows])
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set(xlabel="held-out error, degrees", xlim=(0.0, None))


TermKind = Literal["base", "held", "correction", "noise", "interval"]


@answer
class Term:
    """One term of one angle."""

    name: str
    """`base`: the regressor alone, an effect, or `measurement noise`."""
    kind: TermKind
    """`base`: the regressor alone; `held`: from what a faulty sensor says to the last good angle;
    `correction`: an effect; `noise` and `interval` change the standard deviation only."""
    degrees: float
    variance_deg2: float | None
    """Degrees squared; null: the model does not store it. Negative: so much of the measurement noise is
    explained."""
    is_claimed: bool
    """Whether its variance is in the angle's `sd_deg`."""
    sd_deg: float | None = None
    """Null where it is not stored, and where it takes away from the noise."""

    def __post_init__(self) -> None:
        variance = self.variance_deg2
        object.__setattr__(self, "sd_deg", None if variance is None or variance < 0 else sqrt(variance))

    @property
    def changes_the_angle(self) -> bool:
        return self.kind not in ("noise", "interval")

    @property
    def degrees_text(self) -> str:
        if not self.changes_the_angle:
            return ""
        return f"{self.degrees:.2f}" if self.kind == "base" else f"{self.degrees:+.2f}"

    @property
    def sd_text(self) -> str:
        if self.sd_deg is not None:
            return f"{self.sd_deg:.2f}"
        return "not stored" if self.variance_deg2 is None else "less noise"


@answer
class Repair:
    """What one effect that repairs measurements changes of the measured angle."""

    name: str
    degrees: float | None
    """Null: it takes the measurement here away."""


@answer
class Measured:
    """The measured angle at the frame, as it is compared with the model."""

    recorded_deg: float
    repairs: Sequence[Repair]
    """Effects that repair measurements before they are compared."""
    degrees: float | None
    """After the repairs; null: not compared."""
    error_deg: float | None = None
    """Predicted minus measured."""

    @property
    def sentence(self) -> str:
        changes = [
            f"{item.name} {item.degrees:+.2f}" if item.degrees is not None else f"{item.name} takes it away"
            for item in self.repairs
            if item.degrees != 0.0
        ]
        repaired = f" (recorded {self.recorded_deg:.2f}; {', '.join(changes)})" if changes else ""
        if self.degrees is None:
            return f"Measured: not compared{repaired}."
        return f"Measured: {self.degrees:.2f} degrees{repaired}; error {self.error_deg:+.2f} degrees."


@answer
class AngleTerms:
    """One rotation in one frame; the terms' degrees add up to the angle."""

    rotation: str
    degrees: float
    """The predicted angle: the sum of the terms' degrees."""
    sd_deg: float
    """Of a measurement of the rotation, its noise included."""
    flags: int
    """Sum of 1 extrapolating, 2 too uncertain, 4 by rule, 8 faulty sensor."""
    terms: Sequence[Term]
    """In the order in which they are applied."""
    sources: Sequence[str]
    """Rotations that it is computed from by rule; empty: it is read from sensors."""
    readings: Mapping[str, float]
    """Raw reading of each sensor that the base reads, as the glove sends it."""
    is_corrected: bool
    """False where the corrections were unusable and left out."""
    measured: Measured | None = None
    sentences: Sequence[str] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "sentences", self._sentences())

    def with_measured(self, measured: Measured | None) -> AngleTerms:
        """With what was measured of it at the frame."""
        if measured is None:
            return self
        error = None if measured.degrees is None else self.degrees - measured.degrees
        return replace(self, measured=replace(measured, error_deg=error))

    def _sentences(self) -> list[str]:
        from glovecal_models.calibration.predictor import EXTRAPOLATING, FAULTY_SENSOR, TOO_UNCERTAIN

        sentences = []
        if self.flags & FAULTY_SENSOR:
            sentences.append("Held: a sensor that it is read from fails; this is the last good angle.")
        if self.flags & EXTRAPOLATING:
            sentences.append("Extrapolating: a reading lies outside those of training.")
        if not self.is_corrected:
            sentences.append(
                "Not corrected: the corrections are not finite or beyond a full turn, and were left out."
            )
        elif self.flags & TOO_UNCERTAIN:
            sentences.append("Too uncertain to use.")
        if self.sources:
            sentences.append(f"By rule from {', '.join(self.sources)}: its terms are theirs, weighted.")
        known = [(item, item.variance_deg2) for item in self.terms if item.variance_deg2 is not None]
        if len(known) < len(self.terms):
            sentences.append("Not stored: the model has no standard deviation of this term.")
        if any(variance < 0 for _, variance in known):
            sentences.append("A term without a standard deviation explains a part of the measurement noise.")
        unclaimed = [item.name for item, _ in known if not item.is_claimed]
        if unclaimed:
            sentences.append(f"Not in the angle's standard deviation: that of {', '.join(unclaimed)}.")
        return [*sentences, *([] if self.measured is None else [self.measured.sentence])]

    @property
    def parts(self) -> list[Part]:
        """As it is shown."""
        readings = ", ".join(f"{name} {value:g}" for name, value in self.readings.items())
        read = f", from raw readings {readings}" if readings else ""
        total = ("angle", f"{self.degrees:.2f}", f"{self.sd_deg:.2f}")
        rows = [*((item.name, item.degrees_text, item.sd_text) for item in self.terms), total]
        columns = [Column("term"), Column("degrees"), Column("sd_deg", "SD (deg)")]
        said = [Lines(self.sentences)] if self.sentences else []
        return [f"{self.degrees:.2f} degrees, SD {self.sd_deg:.2f}{read}.", Table(columns, rows), *said]


@answer
class FrameExplanation:
    """The rotations of one frame of a glove."""

    time_s: float
    """By the take's clock, or the live glove's."""
    rotations: Sequence[AngleTerms]
    faulty_sensors: Sequence[str]
    transient_s: float | None
    """How long ago effects with a memory began anew, while they have not settled; null: they have."""
    settling_s: float
    """So long after a start effects with a memory are uncertain; 0: none has a memory."""
    remembering: Sequence[str]
    """The effects that remember."""
    silent: Sequence[str]
    """A sentence for each effect that corrects nothing for want of something it is not told."""
    sentences: Sequence[str] = ()
    """What holds for all rotations of the frame."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "sentences", self._sentences())

    def _sentences(self) -> list[str]:
        sentences = []
        if self.transient_s is not None:
            sentences.append(
                f"Transient: {', '.join(self.remembering)} began anew {self.transient_s:.1f} s ago and "
                f"settles after {self.settling_s:.1f} s; until then the term is uncertain."
            )
        if self.faulty_sensors:
            several = len(self.faulty_sensors) > 1
            sentences.append(
                f"Faulty sensor{'s' * several}: {', '.join(self.faulty_sensors)}; rotations read from "
                f"{'them' if several else 'it'} hold their last good angle."
            )
        return [*sentences, *(f"{sentence[0].upper()}{sentence[1:]}." for sentence in self.silent)]

    def facts(self, rotations: Sequence[str]) -> dict[str, Any]:
        """Its fields, of ``rotations`` only."""
        kept = [item for item in self.rotations if item.rotation in rotations]
        return {**vars(self), "rotations": kept}


@answer
class LiveExplanation(FrameExplanation):
    """The frame of a pose that was served."""

    _: KW_ONLY
    glove: str
    model: str
    run_id: str
    """16 hexadecimal digits, with `sequence` the frame and its pose."""
    sequence: int


@answer
class Explanation(FrameExplanation, Answer):
    """The frame of a take nearest to the time asked for."""

    _: KW_ONLY
    name: str
    """Of the take."""
    wearing: str
    simulated: bool
    frame: int
    """Number of the frame in the take, 0 for the first."""
    take: str = ""
    """Its id."""
    model: str = ""
    method: str = ""
    """Of the model."""

    @property
    def degrees(self) -> dict[str, float]:
        """The predicted angles by rotation."""
        return {item.rotation: item.degrees for item in self.rotations}

    @property
    def sd_deg(self) -> dict[str, float]:
        """Standard deviation of a measurement of each rotation, noise included."""
        return {item.rotation: item.sd_deg for item in self.rotations}

    def of(self, rotation: str) -> AngleTerms:
        """Raises BadInput for a rotation that is not explained."""
        for item in self.rotations:
            if item.rotation == rotation:
                return item
        raise BadInput(f"rotation {rotation!r} is not explained; {did_you_mean(rotation, self.degrees)}")

    def terms(self, rotation: str) -> dict[str, float]:
        """Degrees by term, in the order in which they are applied; several effects of one name are added up.

        Raises BadInput for a rotation that is not explained.
        """
        found: dict[str, float] = {}
        for term in self.of(rotation).terms:
            found[term.name] = found.get(term.name, 0.0) + term.degrees
        return found

    def to_frame(self) -> Any:
        """One row for each term, then one for the angle."""
        rows = []
        for item in self.rotations:
            rows += [(item.rotation, term.name, term.degrees, term.sd_deg) for term in item.terms]
            rows.append((item.rotation, "angle", item.degrees, item.sd_deg))
        return Table([Column(name) for name in ("rotation", "term", "degrees", "sd_deg")], rows).frame()

    def presentation(self) -> Presentation:
        of = f"Model {self.model[:12]} ({self.method}), take" if self.model else "Take"
        simulated = ", SIMULATED" if self.simulated else ""
        return Presentation(
            f"{of} {self.name} of {self.wearing}{simulated}, frame {self.frame} at {self.time_s:.3f} s",
            [Fact("", sentence) for sentence in self.sentences],
            sections=[Section(item.rotation, item.parts) for item in self.rotations],
        )
