"""How a walk ends: why it stopped, and what is said of the error that stays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.comparison.limits import COMPARISON_LIMITS, ComparisonLimits
from glovecal_models.diagnosis.diagnosis import Diagnosis
from glovecal_models.diagnosis.diagnosis_document import not_judgeable_sentences, nothing_named_sentence
from glovecal_models.diagnosis.hold_drift_document import hold_sentence
from glovecal_models.diagnosis.pose_labels import UNITS
from glovecal_models.improvement.improvement import Step
from glovecal_models.improvement.step_errors import is_at_floor
from glovecal_models.improvement.what_stays import repeats_sentence, what_stays


def why_stopped(
    stopped: str,
    steps: Sequence[Step],
    floors: Mapping[str, NoiseFloor],
    diagnosis: Diagnosis | None,
    limits: ComparisonLimits = COMPARISON_LIMITS,
) -> str:
    """``stopped`` so far ("nothing_named" or "not_better"), or what says more about the end."""
    held = diagnosis.hold_drift if diagnosis else None
    if held is not None:
        return "ambiguous" if len(held.confidence_set) > 1 else "nothing_named"
    # Errors against a wrong reference, and their floor, mean nothing.
    doubtful = diagnosis is not None and bool(diagnosis.reference_problems)
    if not doubtful and is_at_floor(steps[-1].per_rotation, floors, limits):
        return "noise_floor"
    added = [step.added for step in steps if step.added is not None]
    undecided = diagnosis is not None and len(diagnosis.naming.confidence_set) > 1
    if (added and added[-1]["verdict"] == "ambiguous") or (stopped == "nothing_named" and undecided):
        return "ambiguous"
    return stopped


def closing_sentences(diagnosis: Diagnosis, last: Step, floors: Mapping[str, NoiseFloor]) -> list[str]:
    """What was found beside the effects that were added, what could not be judged, and what stays."""
    held = diagnosis.hold_drift
    said = [] if held is None else [hold_sentence(held), UNITS]
    said += [item.sentence for item in diagnosis.findings]
    if held is None and not diagnosis.findings and not diagnosis.naming.ranked:
        said.append(nothing_named_sentence(diagnosis))
    said += [*not_judgeable_sentences(diagnosis.not_judgeable), diagnosis.left.sentence]
    if held is None:
        repeats = repeats_sentence(floors)
        said += [] if repeats is None else [repeats]
        said.append(what_stays(last.per_rotation, floors))
    return said
