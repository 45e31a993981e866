"""The drift within held poses in words, as plain data, and the take that would decide."""

from __future__ import annotations

from typing import Any

import numpy as np

from glovecal_models.diagnosis.hold_drift import HAND, HoldDrift, PoseDrift, drifting
from glovecal_models.diagnosis.next_take import NextTake
from glovecal_models.effects.catalogue import effect

MOST_SENSORS = 3


def hold_sentence(drift: HoldDrift) -> str:
    """What drifts, how much, and what it is consistent with."""
    if drift.why_not is not None:
        return f"Whether readings drift while a pose is held cannot be judged: {drift.why_not}."
    if not drift.confidence_set:
        return (
            f"While a pose is held the readings do not drift beyond chance ({drift.holds} holds, "
            f"p = {drift.probability:.2g} with whole holds turned around)."
        )
    told = "; ".join(_pose_sentence(drift, pose) for pose in _told(drift))
    return f"{_headline(drift)}: {told}. {_reason(drift)} {_doubt(drift)}".strip()


def hold_next_take(drift: HoldDrift) -> NextTake | None:
    """None when nothing is to be decided."""
    if len(drift.confidence_set) < 2:
        return None
    if HAND in drift.confidence_set:
        return NextTake(
            "rigid_holds",
            "Close the hand around a rigid form, such as a rod or a bottle, so that it cannot relax, and hold"
            " it for 20 s; open the hand for 10 s; six times. Call the pose rigid-fist, and give these takes"
            " together with the others.",
            180,
            drift.confidence_set,
        )
    return NextTake(
        "long_warm",
        "Wear the switched-on glove for 10 min without touching it, then hold the same poses again; give the"
        " seconds since power-on as c.power_on_s.",
        120,
        drift.confidence_set,
    )


def hold_document(drift: HoldDrift) -> dict[str, Any]:
    """JSON-able; sizes in percent of each sensor's span, signed."""
    return {
        "sentence": hold_sentence(drift),
        "verdict": _verdict(drift),
        "confidence_set": list(drift.confidence_set),
        "holds": drift.holds,
        "probability": drift.probability,
        "drift_in_other_poses": drift.elsewhere,
        "recovery": drift.recovery,
        "poses": [
            {
                "pose": pose.pose,
                "holds": pose.holds,
                "duration_s": pose.duration_s,
                "tau_s": pose.tau_s,
                "tau_is_lower_bound": pose.tau_is_long,
                "slowing_holds": pose.is_slowing,
                "sensors": {
                    name: {
                        "change_pct": 100.0 * float(share),
                        "change_deg": _degrees(drift, name, float(share)),
                        "same_sign_holds": int(same),
                    }
                    for name, share, same in zip(drift.sensors, pose.share, pose.same_sign, strict=True)
                },
            }
            for pose in drift.poses
        ],
    }


def hold_named(drift: HoldDrift) -> dict[str, Any] | None:
    """As the finding of a diagnosis; None when nothing drifts."""
    if not drift.confidence_set:
        return None
    first = drift.poses[0]
    return {
        "effect": drift.confidence_set[0],
        "where": [name for name, _ in _largest(drift, first)],
        "verdict": _verdict(drift),
        "confidence_set": list(drift.confidence_set),
        "parameters": {
            name: {f"change_in_{first.pose}_pct": 100.0 * share, "tau_s": first.tau_s}
            for name, share in _largest(drift, first)
        },
        "saved_deg": None,
        "decoy_saved_deg": None,
        "sentence": hold_sentence(drift),
    }


def _verdict(drift: HoldDrift) -> str:
    if drift.why_not is not None:
        return "not_judgeable"
    if not drift.confidence_set:
        return "nothing"
    return "named" if len(drift.confidence_set) == 1 else "ambiguous"


def _headline(drift: HoldDrift) -> str:
    causes = ["the hand relaxing" if name == HAND else effect(name).spoken for name in drift.confidence_set]
    if len(causes) == 1:
        return f"While a pose is held the readings drift: {causes[0]}"
    return (
        f"While a pose is held the readings drift, consistent with {', '.join(causes[:-1])}, or {causes[-1]}"
    )


def _told(drift: HoldDrift) -> list[PoseDrift]:
    return [pose for pose in drift.poses if _largest(drift, pose)] or [drift.poses[0]]


def _largest(drift: HoldDrift, pose: PoseDrift) -> list[tuple[str, float]]:
    """Sensors that drift one way in most holds, the largest first."""
    limits = drift.limits
    is_large = np.abs(pose.share) >= limits.hold_least_share
    sure = is_large & (pose.same_sign >= limits.hold_one_way_share * pose.holds)
    order = [i for i in np.argsort(-np.abs(pose.share)) if sure[i]]
    return [(drift.sensors[i], float(pose.share[i])) for i in order]


def _pose_sentence(drift: HoldDrift, pose: PoseDrift) -> str:
    largest = _largest(drift, pose)
    parts = [_change(drift, name, share) for name, share in largest[:MOST_SENSORS]]
    more = len(largest) - len(parts)
    named = ", ".join(parts) + (f" ({more} more by less)" if more > 0 else "")
    tau = f"more than {pose.duration_s:.0f} s" if pose.tau_is_long else f"about {pose.tau_s:.2g} s"
    return (
        f"in {pose.holds} holds of {pose.pose}, within {pose.duration_s:.0f} s each, and with a time constant"
        f" of {tau}, the reading of {named} of {'their spans' if len(largest) > 1 else 'its span'}"
    )


def _change(drift: HoldDrift, name: str, share: float) -> str:
    degrees = _degrees(drift, name, share)
    also = "" if degrees is None else f" ({abs(degrees):.1f} degrees)"
    return f"{name} {'rises' if share > 0 else 'falls'} by {100 * abs(share):.1f} %{also}"


def _degrees(drift: HoldDrift, sensor: str, share: float) -> float | None:
    span = (drift.deg_of_span or {}).get(sensor)
    return None if span is None else share * span


def _reason(drift: HoldDrift) -> str:
    chance = f"p = {drift.probability:.2g} with whole holds turned around"
    if drift.recovery is not None:
        gone = f"{100 * min(max(drift.recovery, 0.0), 1.0):.0f} % of it is gone when the pose comes back"
        return f"{gone[0].upper()}{gone[1:]} ({chance})."
    if drift.elsewhere is not None:
        speed, where = 100 * drift.elsewhere, ", ".join(drift.far)
        if speed < 0:
            return f"In {where} they drift the other way, as with warm-up they would not ({chance})."
        less = "warm-up would go on" if speed < 50 else "as warm-up does"
        return f"In {where} they drift {speed:.0f} % as fast in that direction; {less} ({chance})."
    return f"It is beyond chance ({chance})."


def _doubt(drift: HoldDrift) -> str:
    if drift.confidence_set == drifting("begins anew with each hold"):
        return "It is there around a rigid form too, where the hand cannot relax: the sensors creep."
    if drift.confidence_set == (HAND,):
        return "Around a rigid form, where the hand cannot relax, it is not there: the sensors do not creep."
    if HAND in drift.confidence_set and drift.deg_of_span:
        return "Where an angle was measured glovecal diagnose can tell them apart; else hold a rigid form."
    if HAND in drift.confidence_set:
        return (
            "Without a measured angle these cannot be told apart; hold a rigid form for 20 s, several times,"
            " to decide."
        )
    return "It goes on in one direction and does not begin anew with each hold, so it is no creep."
