"""How readings drift while a pose is held: creep, a hand that relaxes, or warm-up."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

from glovecal_models.diagnosis.residual_answer import NextTake
from glovecal_models.presentation.document import (
    Answer,
    Column,
    Fact,
    Presentation,
    Section,
    Table,
    answer,
    counted,
)

HoldVerdict = Literal["named", "ambiguous", "nothing", "not_identifiable"]


@answer
class SensorDrift:
    change_pct: float | None
    """Mean change within a hold, percent of the sensor's span."""
    change_deg: float | None
    """The same in degrees, where angles are known."""
    same_sign_holds: int


@answer
class HeldPose:
    """What all holds of one pose have in common."""

    pose: str
    holds: int
    duration_s: float
    """Median."""
    tau_s: float
    """Time constant of all holds of the pose."""
    tau_is_lower_bound: bool
    slowing_holds: int
    """Holds whose drift slows down rather than speeds up."""
    sensors: Mapping[str, SensorDrift]

    @property
    def tau_text(self) -> str:
        return f"> {self.duration_s:.0f}" if self.tau_is_lower_bound else f"{self.tau_s:.2g}"


@answer
class DriftInHolds(Answer):
    sentence: str
    verdict: HoldVerdict
    confidence_set: Sequence[str]
    """Causes that these holds cannot tell apart."""
    holds: int
    p_value: float
    """Of the drift common to holds, by flipping the sign of whole holds."""
    drift_in_other_poses: float | None
    """Speed in poses far away, as a share: warm-up 1, creep about 0 or negative."""
    recovery: float | None
    """Share of the drift that is gone when the pose comes back."""
    poses: Sequence[HeldPose]
    next_take: NextTake | None = None
    """The recording that would decide."""

    @property
    def facts(self) -> list[Fact]:
        """What the drift is consistent with, and where it is largest."""
        drifts = [
            (drift.change_pct, f"{name} in pose {pose.pose}, {counted(pose.holds, 'hold')}", pose.tau_text)
            for pose in self.poses
            for name, drift in pose.sensors.items()
            if drift.change_pct is not None
        ]
        if not self.confidence_set or not drifts:
            return [Fact("Verdict", self.sentence)]
        change, place, tau = max(drifts, key=lambda item: abs(item[0]))
        return [
            Fact("Verdict", f"Readings drift while a pose is held: {' or '.join(self.confidence_set)}."),
            Fact("Size", f"{change:+.1f} % of the sensor's span, time constant {tau} s"),
            Fact("Place", place),
        ]

    def presentation(self) -> Presentation:
        following = self.next_take
        facts = [Fact("Verdict", self.sentence)]
        if following is not None:
            facts.append(Fact("", f"To decide, record {following.seconds} s: {following.what}"))
        columns = [
            Column("pose"), Column("holds"), Column("duration_s", "seconds", 0), Column("sensor"),
            Column("change_pct", "change (% of span)"), Column("same_sign", "same sign"),
            Column("tau_s", "time constant (s)"),
        ]  # fmt: skip
        rows = [
            (
                pose.pose, pose.holds, pose.duration_s, name,
                "-" if drift.change_pct is None else f"{drift.change_pct:+.1f}",
                f"{drift.same_sign_holds} of {pose.holds}",
                pose.tau_text,
            )
            for pose in self.poses
            for name, drift in pose.sensors.items()
        ]  # fmt: skip
        return Presentation(
            "Readings while a pose is held",
            facts,
            sections=[Section("Drift of each sensor", [Table(columns, rows)])] if rows else [],
        )
