"""Sentences about a quick check: the expected error before and after it, and what the poses do not show."""

from __future__ import annotations

from glovecal_models.effects.catalogue import wearing_effect
from glovecal_models.quick_check.quick_check import QuickCheck

MOST_NAMED = 6


def quick_check_sentences(found: QuickCheck) -> list[str]:
    """The result, and what to do next where it is weak."""
    report, poses = found.report, len(found.poses)
    expected = report.expected
    sentences = [
        *as_found_and_left(report.poses_before_deg, report.poses_held_out_deg, found.wearing),
        f"{poses} {'pose' if poses == 1 else 'poses'}: the expected error in this wearing falls from "
        f"{expected['now_deg']:.1f} to {expected['after_deg']:.1f} degrees; after a full calibration: "
        f"{expected['full_calibration_deg']:.1f}.",
    ]
    if report.poses_held_out_deg is not None and report.poses_held_out_deg > report.poses_before_deg:
        sentences.append(
            "The poses do not predict each other: record one or two more, spread over the range."
        )
    if report.uninformed:
        names = ", ".join(report.uninformed[:MOST_NAMED])
        more = len(report.uninformed) - MOST_NAMED
        names += f" and {more} more" if more > 0 else ""
        sentences.append(f"No pose informs {names}: their uncertainty stays that of a new wearing.")
    if found.mixed_wearings:
        sentences.append(
            f"This model was trained on {found.mixed_wearings} wearings without separating them: their "
            "differences are part of its error, that of a full calibration included. Add the effect "
            f"{wearing_effect().name} first, then check again."
        )
    if report.is_full_calibration_due:
        sentences.append(DUE)
    return sentences


DUE = (
    "A full calibration is due: after the check the poses are off by more than this model and a repeated "
    "pose explain. Record new takes and train."
)


def as_found_and_left(found_deg: float, left_deg: float | None, wearing: str) -> list[str]:
    """The old model's error in this wearing, then the error after the check."""
    left = (
        "" if left_deg is None else f" As left: {left_deg:.1f} degrees (each pose predicted from the others)."
    )
    return [f"As found: {found_deg:.1f} degrees in wearing {wearing}, before the check.{left}"]
