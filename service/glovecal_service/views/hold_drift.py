"""The drift of readings within held poses."""

from __future__ import annotations

from pydantic import Field

from glovecal_models.diagnosis.hold_drift import HoldDrift, HoldVerdict
from glovecal_models.diagnosis.hold_fit import PoseDrift
from glovecal_models.diagnosis.hold_text import hold_sentence
from glovecal_models.diagnosis.next_take import hold_next_take
from glovecal_service.views.next_take import NextTakeView
from glovecal_service.views.view import View


class SensorDriftView(View):
    change_pct: float | None = Field(description="Mean change within a hold, percent of the sensor's span.")
    change_deg: float | None = Field(description="The same in degrees, where angles are known.")
    same_sign_holds: int


class HeldPoseView(View):
    pose: str
    holds: int
    duration_s: float
    tau_s: float = Field(description="Time constant of all holds of the pose.")
    tau_is_lower_bound: bool
    slowing_holds: int = Field(description="Holds whose drift slows down rather than speeds up.")
    sensors: dict[str, SensorDriftView]

    @classmethod
    def of(cls, drift: HoldDrift, pose: PoseDrift) -> HeldPoseView:
        each = zip(drift.sensors, pose.share, pose.same_sign, strict=True)
        return cls(
            pose=pose.pose,
            holds=pose.holds,
            duration_s=pose.duration_s,
            tau_s=pose.tau_s,
            tau_is_lower_bound=bool(pose.tau_is_long),
            slowing_holds=pose.is_slowing,
            sensors={
                name: SensorDriftView(
                    change_pct=100.0 * float(share),
                    change_deg=drift.change_deg(name, float(share)),
                    same_sign_holds=int(same),
                )
                for name, share, same in each
            },
        )


class HoldDriftView(View):
    sentence: str
    verdict: HoldVerdict
    confidence_set: list[str] = Field(description="Causes that these holds cannot tell apart.")
    holds: int
    p_value: float = Field(description="Of the drift common to holds, by flipping the sign of whole holds.")
    drift_in_other_poses: float | None = Field(
        description="Speed in poses far away, as a share: warm-up 1, creep about 0 or negative."
    )
    recovery: float | None = Field(description="Share of the drift that is gone when the pose comes back.")
    poses: list[HeldPoseView]

    @classmethod
    def of(cls, drift: HoldDrift) -> HoldDriftView:
        return cls(
            sentence=hold_sentence(drift),
            verdict=drift.verdict,
            confidence_set=list(drift.confidence_set),
            holds=drift.holds,
            p_value=drift.p_value,
            drift_in_other_poses=drift.elsewhere,
            recovery=drift.recovery,
            poses=[HeldPoseView.of(drift, pose) for pose in drift.poses],
        )


class HoldsView(HoldDriftView):
    """With the recording that would decide."""

    next_take: NextTakeView | None

    @classmethod
    def of(cls, drift: HoldDrift) -> HoldsView:
        facts = HoldDriftView.of(drift).model_dump()
        return cls(**facts, next_take=NextTakeView.of(hold_next_take(drift)))
