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
        f"{poses} {'pose' if poses == 1 else 'poses'}: the expected error in this wearing falls from "
        f"{expected['now_deg']:.1f} to {expected['after_deg']:.1f} degrees; after a full calibration: "
        f"{expected['full_calibration_deg']:.1f}."
    ]
    if report.poses_held_out_deg is not None:
        sentences.append(
            f"Held-out error of the poses, each predicted from the others: {report.poses_held_out_deg:.1f} "
            f"degrees; without the check: {report.poses_before_deg:.1f}."
        )
        if report.poses_held_out_deg > report.poses_before_deg:
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
    return sentences
