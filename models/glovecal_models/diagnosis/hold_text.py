"""What readings do while a pose is held, in sentences for people."""

from __future__ import annotations

from glovecal_models.diagnosis.hold_answer import DriftInHolds, HeldPose, SensorDrift
from glovecal_models.diagnosis.hold_drift import HAND, HoldDrift, PoseDrift, drifting
from glovecal_models.diagnosis.residual_answer import NextTake
from glovecal_models.effects.catalogue import effect

MOST_SENSORS = 3


def drift_in_holds(drift: HoldDrift, next_take: NextTake | None = None) -> DriftInHolds:
    """As it is answered."""
    return DriftInHolds(
        sentence=hold_sentence(drift),
        verdict=drift.verdict,
        confidence_set=drift.confidence_set,
        holds=drift.holds,
        p_value=drift.p_value,
        drift_in_other_poses=drift.elsewhere,
        recovery=drift.recovery,
        poses=[_held_pose(drift, pose) for pose in drift.poses],
        next_take=next_take,
    )


def _held_pose(drift: HoldDrift, pose: PoseDrift) -> HeldPose:
    each = zip(drift.sensors, pose.share.tolist(), pose.same_sign.tolist(), strict=True)
    sensors = {
        name: SensorDrift(100.0 * share, drift.change_deg(name, share), int(same))
        for name, share, same in each
    }
    is_long = bool(pose.tau_is_long)
    return HeldPose(pose.pose, pose.holds, pose.duration_s, pose.tau_s, is_long, pose.is_slowing, sensors)


def hold_sentence(drift: HoldDrift) -> str:
    """What drifts within held poses, how much, and what it is consistent with."""
    if drift.why_not is not None:
        return f"Drift within held poses cannot be judged: {drift.why_not}."
    if not drift.confidence_set:
        return (
            f"While a pose is held the readings do not drift significantly ({drift.holds} holds, p = "
            f"{drift.p_value:.2g} by flipping the sign of whole holds)."
        )
    poses = [pose for pose in drift.poses if drift.consistent(pose)] or [drift.poses[0]]
    each = "; ".join(_pose(drift, pose) for pose in poses)
    return f"{_headline(drift)}: {each}. {_reason(drift)} {_limits(drift)}".strip()


def _headline(drift: HoldDrift) -> str:
    causes = [_cause(name) for name in drift.confidence_set]
    if len(causes) == 1:
        return f"While a pose is held the readings drift: {causes[0]}"
    return (
        f"While a pose is held the readings drift, consistent with {', '.join(causes[:-1])}, or {causes[-1]}"
    )


def _cause(name: str) -> str:
    drift = None if name == HAND else effect(name).about.in_holds
    return "the hand relaxing" if drift is None else drift.called


def _pose(drift: HoldDrift, pose: PoseDrift) -> str:
    largest = drift.consistent(pose)
    parts = [_change(drift, name, share) for name, share in largest[:MOST_SENSORS]]
    more = len(largest) - len(parts)
    sensors = ", ".join(parts) + (f" ({more} more by less)" if more > 0 else "")
    tau = f"more than {pose.duration_s:.0f} s" if pose.tau_is_long else f"about {pose.tau_s:.2g} s"
    return (
        f"in {pose.holds} holds of {pose.pose}, within {pose.duration_s:.0f} s each, and with a time constant"
        f" of {tau}, the reading of {sensors} of {'their spans' if len(largest) > 1 else 'its span'}"
    )


def _change(drift: HoldDrift, name: str, share: float) -> str:
    degrees = drift.change_deg(name, share)
    also = "" if degrees is None else f" ({abs(degrees):.1f} degrees)"
    return f"{name} {'rises' if share > 0 else 'falls'} by {100 * abs(share):.1f} %{also}"


def _reason(drift: HoldDrift) -> str:
    p_value = f"p = {drift.p_value:.2g} by flipping the sign of whole holds"
    if drift.recovery is not None:
        gone = 100 * min(max(drift.recovery, 0.0), 1.0)
        return f"{gone:.0f} % of it has recovered when the pose comes back ({p_value})."
    if drift.elsewhere is not None:
        speed, where = 100 * drift.elsewhere, ", ".join(drift.far)
        if speed < 0:
            return f"In {where} they drift in the opposite direction, unlike warm-up ({p_value})."
        like = "unlike warm-up" if speed < 50 else "like warm-up"
        return f"In {where} they drift at {speed:.0f} % of this speed, {like} ({p_value})."
    return f"The drift is significant ({p_value})."


def _limits(drift: HoldDrift) -> str:
    if drift.confidence_set == drifting("begins anew with each hold"):
        return "It is there around a rigid form too, where the hand cannot relax: the sensors creep."
    if drift.confidence_set == (HAND,):
        return "Around a rigid form, where the hand cannot relax, it is not there: the sensors do not creep."
    if HAND in drift.confidence_set and drift.deg_of_span:
        return "With measured angles glovecal diagnose separates them; without, hold a rigid form."
    if HAND in drift.confidence_set:
        return (
            "Without a measured angle these cannot be separated; hold a rigid form for 20 s, several times,"
            " to decide."
        )
    return "It goes on in one direction and does not begin anew with each hold, so it is not creep."
