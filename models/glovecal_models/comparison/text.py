"""Sentences about comparisons: where a rotation's error comes from, wearings, fingertips."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_models.comparison.compare import Comparison
from glovecal_models.comparison.cross_validation_difference import CrossValidationDifference
from glovecal_models.comparison.dependence import Dependence
from glovecal_models.comparison.fingertips import FingertipErrors, TipErrors
from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.comparison.limits import COMPARISON_LIMITS, ComparisonLimits
from glovecal_models.comparison.wearings import WearingErrors
from glovecal_models.comparison.where_it_fails import RotationFindings, is_structure


def rotation_sentence(item: RotationFindings) -> str:
    """The error of one rotation, its noise floor and what it depends on."""
    start = f"{item.rotation}: RMSE {item.rmse_deg:.1f} degrees"
    if item.floor is not None:
        start += f" (noise floor {floor_text(item.floor, 1)})"
        if item.is_own_jitter or item.is_near_floor:
            return f"{start}: {_at_floor(item)}."
    if abs(item.bias_deg) >= item.limits.mostly_bias_share * item.rmse_deg:
        start += f", mostly a constant {item.bias_deg:+.1f}"
    if not item.structure:
        slow = "" if item.slow is None else f"; {100 * item.slow.share:.0f} % of its variance is below 1 Hz"
        times = "" if item.times_floor is None else f"; the error is {item.times_floor:.1f} times the floor"
        return f"{start}; no recorded column explains it{times}{slow}."
    first, *rest = item.structure
    low, high = float(np.min(first.mean_deg)), float(np.max(first.mean_deg))
    also = f"; {len(rest)} other column{'s' if len(rest) > 1 else ''} significant" if rest else ""
    return (
        f"{start}. It depends on {first.phrase}: from {low:+.1f} to {high:+.1f} degrees, "
        f"RMS contribution {first.explained_deg:.1f} degrees{also}."
    )


def dependence_sentence(
    rotation: str, rmse_deg: float, one: Dependence, limits: ComparisonLimits = COMPARISON_LIMITS
) -> str:
    """How far the error of a rotation goes with one column, and whether chance goes as far."""
    if is_structure(one, rmse_deg, limits):
        verdict = "significant"
    elif one.p_value <= limits.structure_p_value:
        verdict = f"significant, but a small part of {rmse_deg:.1f} degrees"
    else:
        verdict = "not significant"
    return (
        f"Against {one.phrase} the mean error of {rotation} goes from {np.min(one.mean_deg):+.1f} to "
        f"{np.max(one.mean_deg):+.1f} degrees; RMS contribution {one.explained_deg:.1f} degrees, "
        f"p = {one.p_value:.3f}: {verdict}."
    )


def floor_text(floor: NoiseFloor, digits: int = 2) -> str:
    """A floor in degrees and how far it can be trusted, as it stands behind "noise floor"."""
    bound = "lower bound " if floor.is_lower_bound else ""
    doubt = f", not reliable: {'; '.join(floor.reasons)}" if floor.reasons else ""
    return f"{bound}{floor.floor_deg:.{digits}f}{doubt}"


def wearings_sentence(item: WearingErrors) -> str:
    """Whether the mean error changes with the wearing."""
    low, high = int(np.argmin(item.mean_deg)), int(np.argmax(item.mean_deg))
    first, last = (f"{item.mean_deg[at]:+.1f} degrees in wearing {item.wearings[at]}" for at in (low, high))
    ends = f"from {first} to {last}"
    if item.p_value is None:
        return f"The mean error goes {ends}; too few takes to say whether the wearing is the cause."
    if item.is_significant:
        return f"The mean error changes with the wearing, {ends} (p = {item.p_value:.2g})."
    return f"The mean error goes {ends}, no more than between takes (p = {item.p_value:.2g})."


def fingertips_sentence(errors: FingertipErrors) -> str:
    """Errors of the fingertips, for which hand, and what was assumed."""
    overall, fingers = errors.overall, errors.fingers
    hand = f"for a hand of {errors.hand_length_mm:.0f} mm"
    hand += ", an assumed size" if errors.is_assumed else ""
    worst = max(fingers, key=lambda name: fingers[name].rmse_mm)
    sentence = f"Fingertip error {overall.rmse_mm:.1f} mm (RMSE, {hand}{_scale(overall)})"
    if len(fingers) > 1:
        sentence += f", largest at the {worst} with {fingers[worst].rmse_mm:.1f} mm"
    if errors.thumb_index is not None:
        sentence += f"; distance between thumb and index fingertip: {errors.thumb_index.rmse_mm:.1f} mm"
    if overall.assumed_equal:
        were = "was" if len(overall.assumed_equal) == 1 else "were"
        sentence += f". {_listed(overall.assumed_equal)} {were} not measured throughout and assumed equal"
    return f"{sentence}."


def _at_floor(item: RotationFindings) -> str:
    if item.is_own_jitter and item.floor is not None:
        return (
            f"no more than the prediction's own jitter of {item.floor.prediction_deg:.1f} while the hand is "
            "still; the model follows its sensors too closely"
        )
    return "at the noise floor"


def _scale(errors: TipErrors) -> str:
    if errors.floor is None:
        return f"; when predicting the mean {errors.baseline_mm:.1f}"
    bound = "lower bound " if errors.floor.is_lower_bound else ""
    return f"; noise floor {bound}{errors.floor.floor_mm:.1f}"


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def wearing_error_sentences(found: Comparison) -> list[str]:
    """The error in wearings not seen in training, then in those seen; none where the model cannot say."""
    parts = (
        ("In wearings not seen", found.unseen_wearing, found.unseen_wearings),
        ("In the wearings seen", found.seen_wearing, found.seen_wearings),
    )
    return [
        f"{where}: {errors.rmse_deg:.2f} degrees "
        f"({len(names)} {'wearing' if len(names) == 1 else 'wearings'}; "
        f"{100 * errors.coverage:.0f} % of errors within one claimed SD, expected: 68 %)."
        for where, errors, names in parts
        if errors is not None
    ]


def camera_sentences(found: Comparison) -> list[str]:
    """How much of the error a reference accounts for that states deviations, and which angles it saw."""
    errors = {"all rotations together": found.overall, **found.rotations}
    told = [
        f"{name}: the camera accounts for {min(floor.reference_deg, item.rmse_deg):.1f} of these "
        f"{item.rmse_deg:.1f} degrees (its stated deviation, RMS)."
        for name, item in errors.items()
        if (floor := item.floor) is not None and floor.reference_deg is not None
    ]
    return [*told, *(item.sentence() for item in found.camera_ranges)]


MOST_REGIONS = 3


def cross_validation_sentences(found: CrossValidationDifference | None) -> list[str]:
    """Where two models of disjoint halves differ by more than they claim."""
    if found is None:
        return ["Cross-validation difference: not estimated, each half needs two takes."]
    what = "wearings" if found.are_wearings else "takes"
    start = f"Cross-validation difference (two models, trained on disjoint {what})"
    wrong = [item for item in found.regions if item.is_significant]
    if not wrong:
        largest = "" if not found.regions else f", at most {found.regions[0].ratio:.1f} times"
        return [f"{start}: nowhere far above the claimed standard deviations{largest}."]
    each = "; ".join(
        f"{item.rotation} at {item.low_deg:.0f} to {item.high_deg:.0f} degrees: "
        f"{item.difference_deg:.1f} degrees apart, {item.ratio:.1f} times the claimed"
        for item in wrong[:MOST_REGIONS]
    )
    more = f"; {len(wrong) - MOST_REGIONS} more" if len(wrong) > MOST_REGIONS else ""
    return [f"{start}: the model, not the noise, is wrong here. {each}{more}."]
