"""A quick check: the error to expect of a new wearing before and after it, and what the poses do not show."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

from glovecal_models.presentation.document import (
    Answer,
    Column,
    Fact,
    Lines,
    Part,
    Presentation,
    Section,
    Table,
    answer,
    counted,
)

UNINFORMED = 0.8
"""Share of the prior's variance above which the poses are uninformative."""
FULL_CALIBRATION_TIMES = 2.0
"""Times what model and hand are off by in a pose: five independent errors of a sound model exceed it by
chance in 1 of 800 checks (chi-squared, 5 degrees of freedom)."""
MOST_NAMED = 6
DUE = (
    "A full calibration is due: after the check the poses are off by more than this model and a repeated "
    "pose explain. Record new takes and train."
)


@answer
class CheckedPose:
    """A pose that was used."""

    pose: str
    seconds: float
    measured: int
    """Rotations whose angle was measured."""
    by_name: int
    """Rotations whose angle is known by the pose's name."""
    saturated: Sequence[str]
    """Sensors at the end of their range: their rotations are excluded."""
    before_deg: float
    """RMS error with the model as it was."""
    held_out_deg: float | None
    """RMS error with the shift learned from the other poses; null: there are no others."""

    @property
    def angles(self) -> str:
        parts = [(self.measured, "measured"), (self.by_name, "by name")]
        text = ", ".join(f"{count} {how}" for count, how in parts if count)
        return f"{text}; saturated: {', '.join(self.saturated)}" if self.saturated else text


@answer
class RefusedPose:
    """A pose that was not used."""

    pose: str
    reason: str


@answer
class RotationShift:
    """One rotation's shift in the new wearing, added to its prediction. Degrees."""

    rotation: str
    offset_deg: float
    """Added to the prediction in this wearing."""
    offset_sd_deg: float
    gain_deg_per_sd: float
    """Added per standard deviation of the joint."""
    gain_sd_deg_per_sd: float
    prior_sd_deg: float
    """Of the offset, before the check."""
    expected_now_deg: float
    """RMSE to expect of the wearing before the check."""
    expected_after_deg: float
    full_calibration_deg: float
    """The model's held-out error in the wearings it was trained on."""
    is_informed: bool
    """False: no pose informs it, the prior stays."""


@answer
class SensorShift:
    """By how much a sensor reads more than in training."""

    sensor: str
    readings: float
    """Raw readings."""
    sd_readings: float
    prior_sd_readings: float
    degrees: float | None
    """On the scale of the rotation it measures."""
    sd_degrees: float | None
    is_informed: bool


@answer
class ExpectedError:
    """RMSE to expect of the wearing, over all rotations."""

    now_deg: float
    """Before the check."""
    after_deg: float
    full_calibration_deg: float
    """The model's held-out error in its training wearings."""

    @classmethod
    def of(cls, rotations: Sequence[RotationShift]) -> ExpectedError:
        def rms(values: Sequence[float]) -> float:
            return sqrt(sum(value**2 for value in values) / len(values))

        return cls(
            rms([item.expected_now_deg for item in rotations]),
            rms([item.expected_after_deg for item in rotations]),
            rms([item.full_calibration_deg for item in rotations]),
        )


@answer
class CheckedWearing(Answer):
    """What a few held poses say of a new wearing."""

    wearing: str
    poses: Sequence[CheckedPose]
    refused: Sequence[RefusedPose]
    """Poses that were not used, and why."""
    rotations: Sequence[RotationShift]
    sensors: Sequence[SensorShift]
    poses_before_deg: float
    """RMS error of the poses used, with the model as it was."""
    poses_held_out_deg: float | None
    """RMS error of each pose with the shift learned from the others; null with a single pose."""
    pose_noise_deg: float
    """RMS of what model and hand are off by in one pose, when the wearing is known."""
    expected: ExpectedError
    mixed_wearings: int = 0
    """On how many wearings the model was trained without an effect that separates them; 0: it has one."""
    separated_by: str = ""
    """That effect."""
    model: str = ""
    """The child, which knows the wearing."""
    parent: str = ""
    active: bool = False
    """Whether the child predicts live."""
    as_found_deg: float = 0.0
    """RMS error of the poses with the old model, in this wearing."""
    as_left_deg: float | None = None
    """After the check, each pose predicted from the others; null with one pose."""
    is_full_calibration_due: bool = False
    """Whether the check leaves more than model and hand explain: it no longer puts the model right."""
    uninformed: Sequence[str] = ()
    """Rotations that no pose informs."""
    sentences: Sequence[str] = ()

    def __post_init__(self) -> None:
        left = self.poses_held_out_deg
        derived = {
            "as_found_deg": self.poses_before_deg,
            "as_left_deg": left,
            "is_full_calibration_due": left is not None
            and left > FULL_CALIBRATION_TIMES * self.pose_noise_deg,
            "uninformed": tuple(item.rotation for item in self.rotations if not item.is_informed),
        }
        for name, value in derived.items():
            object.__setattr__(self, name, value)
        object.__setattr__(self, "sentences", self._sentences())

    def _sentences(self) -> list[str]:
        """The result, and what to do next where it is weak."""
        expected, left = self.expected, self.as_left_deg
        found = f"As found: {self.as_found_deg:.1f} degrees in wearing {self.wearing}, before the check."
        if left is not None:
            found += f" As left: {left:.1f} degrees (each pose predicted from the others)."
        sentences = [
            found,
            f"{counted(len(self.poses), 'pose')}: the expected error in this wearing falls from "
            f"{expected.now_deg:.1f} to {expected.after_deg:.1f} degrees; after a full calibration: "
            f"{expected.full_calibration_deg:.1f}.",
        ]
        if left is not None and left > self.as_found_deg:
            sentences.append(
                "The poses do not predict each other: record one or two more, spread over the range."
            )
        if self.uninformed:
            more = len(self.uninformed) - MOST_NAMED
            names = ", ".join(self.uninformed[:MOST_NAMED]) + (f" and {more} more" if more > 0 else "")
            sentences.append(f"No pose informs {names}: their uncertainty stays that of a new wearing.")
        if self.mixed_wearings:
            sentences.append(
                f"This model was trained on {self.mixed_wearings} wearings without separating them: their "
                "differences are part of its error, that of a full calibration included. Add the effect "
                f"{self.separated_by} first, then check again."
            )
        return [*sentences, DUE] if self.is_full_calibration_due else sentences

    def presentation(self) -> Presentation:
        first, *others = self.sentences
        short = self.model[:12]
        active = "Active." if self.active else f"Not active; glovecal model activate {short} makes it so."
        facts = [Fact("Verdict", first), *(Fact("", item) for item in others)]
        if self.model:
            facts.append(Fact("Model", f"{short}, made from {self.parent[:12]}. {active}"))
        poses = [
            Column("pose"), Column("angles"), Column("before_deg", "error (°)"),
            Column("held_out_deg", "held out (°)"),
        ]  # fmt: skip
        sensors = [
            Column("sensor"), Column("readings", "reads more by"), Column("sd_readings", "±"),
            Column("degrees", "that is (°)"), Column("sd_degrees", "± (°)"),
            Column("prior_sd_readings", "± before"),
        ]  # fmt: skip
        rotations = [
            Column("rotation"), Column("offset_deg", "shift (°)"), Column("offset_sd_deg", "± (°)"),
            Column("prior_sd_deg", "± before"), Column("expected_now_deg", "error before (°)"),
            Column("expected_after_deg", "after (°)"),
            Column("full_calibration_deg", "full calibration (°)"),
        ]  # fmt: skip
        used: list[Part] = [_table(poses, self.poses)]
        if self.refused:
            used.append(Lines([f"Not used: {item.pose}: {item.reason}." for item in self.refused]))
        return Presentation(
            f"Quick check of wearing {self.wearing}",
            facts,
            sections=[
                Section("Poses", used),
                Section("Sensors", [_table(sensors, self.sensors)]),
                Section("Rotations", [_table(rotations, self.rotations)]),
            ],
        )


def _table(columns: Sequence[Column], items: Sequence[object]) -> Table:
    return Table(columns, [[getattr(item, column.name) for column in columns] for item in items])
