"""The end of the second act: the error falls (a chart of text), and what was hidden: was it found?"""

from __future__ import annotations

from typing import Any

from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS
from glovecal_service.demo.hidden_session import HiddenSession
from glovecal_service.demo.second_act import Findings

LABELS = {"raw": "raw", "linear": "linear", "lmc_gpr": "LMC-GPR"}
BAR_WIDTH = 48


def errors_deg(found: Findings) -> dict[str, float]:
    """RMSE over all rotations of the takes not trained on, by method; ``with_effect`` is the child's."""
    return {name: item["overall"]["rmse_deg"] for name, item in found.comparisons.items()}


def floor_deg(found: Findings) -> float | None:
    """The noise floor as the service measured it on the same takes; None where it could not."""
    floor = found.last["overall"]["floor"]
    return None if floor is None else floor["floor_deg"]


def chart(found: Findings) -> list[str]:
    """One bar for each calibration and one for the floor."""
    named = found.diagnosis["named"]
    labels = LABELS | {"with_effect": f"+ {named['effect']}" if named else ""}
    rows = [(labels[name], value) for name, value in errors_deg(found).items()]
    floor = floor_deg(found)
    if floor is not None:
        at_least = " >" if found.last["overall"]["floor"]["is_lower_bound"] else ""
        rows.append((f"noise floor{at_least}", floor))
    width, largest = max(len(label) for label, _ in rows), max(value for _, value in rows)
    return [
        f"  {label:<{width}} {value:6.2f}  {'█' * max(1, round(BAR_WIDTH * value / largest))}"
        for label, value in rows
    ]


def fall(found: Findings) -> list[str]:
    """How much of what is above the floor the effect took away; empty where none was added."""
    errors, floor = errors_deg(found), floor_deg(found)
    if "with_effect" not in errors or floor is None:
        return []
    above, left = (max(errors[name] ** 2 - floor**2, 0.0) ** 0.5 for name in ("lmc_gpr", "with_effect"))
    times = errors["with_effect"] / floor
    return [
        f"Error above the noise floor: LMC-GPR {above:.2f} degrees, with the effect {left:.2f}. The error is "
        f"{times:.1f} times the noise floor."
    ]


def verdict(hidden: HiddenSession, found: Findings) -> list[str]:
    """What was hidden, and whether that is what was said."""
    truth, named = hidden.truth, _named(found)
    perfect = max(hidden.session.floor_deg.values())
    floor = f"Without it, a perfect calibration of this glove has an error of up to {perfect:.2f} degrees."
    if truth is None:
        told = ["Hidden effect: none. This simulated glove is healthy."]
        told.append("Right: nothing was named." if named is None else f"Wrong: {named} was named.")
        if named is None and found.diagnosis["unexplained_residual"]["is_significant"]:
            told.append(
                f"The unexplained residual is the normal slip of cloth, {hidden.session.plan.nuisance_deg:g} "
                "degrees in this simulation; the catalogue has no effect for it."
            )
        return told
    where = "all sensors" if len(truth.channels) == len(hidden.session.plan.sensors) else ""
    told = [
        f"Hidden effect: {truth.name} (form: {truth.form}) on {where or ', '.join(truth.channels)}. "
        f"{truth.description}",
        floor,
    ]
    wrong = [f"Wrong: {said}." for said in told_wrongly(hidden, found)]
    if is_right(hidden, found):
        if truth.name.startswith("unknown:"):
            return [
                *told,
                "Right: no effect of the catalogue was named, and an unexplained residual was reported.",
                *wrong,
            ]
        return [*told, f"Right: {named} was named.", *wrong]
    if truth.name.startswith("unknown:"):
        said = f"{named} was named" if named else "no unexplained residual was reported"
        return [*told, f"Wrong: {said}; this effect is not in the catalogue."]
    if truth.name in _confidence_set(found):
        return [*told, f"Partly right: {named} was named first; {truth.name} is in the confidence set."]
    return [*told, f"Wrong: {'nothing' if named is None else named} was named."]


def told_wrongly(hidden: HiddenSession, found: Findings) -> list[str]:
    """What was told beside the first name and is not so; each as the end of a sentence.

    The references are right, and no second effect is hidden. That something is left is right where the error
    of a rotation is more than a healthy glove's.
    """
    truth, wrong = hidden.truth, []
    for when, diagnosis in (("", found.diagnosis), (" afterwards", found.diagnosis_after or {})):
        wrong += [f"{item!r} was told{when}" for item in diagnosis.get("reference_problems") or ()]
        findings = diagnosis.get("findings") or ()
        strange = {item["effect"] for item in findings} - {truth.name if truth else "", _named(found)}
        wrong += [f"{name} was found{when}" for name in sorted(strange)]
    after = _named_after(found)
    if after is not None and after != (truth.name if truth else None):
        wrong.append(f"{after} was named afterwards")
    if truth is None and found.diagnosis["unexplained_residual"]["is_significant"]:
        wrong.append("an unexplained residual was reported of a healthy glove")
    is_catalogued = truth is not None and not truth.name.startswith("unknown:")
    again, floor, errors = found.diagnosis_after, floor_deg(found), errors_deg(found)
    is_said = again is not None and again["unexplained_residual"]["is_significant"]
    if is_said and is_catalogued and not _is_anything_left(found):
        wrong.append("an unexplained residual was reported afterwards, of an error as in healthy gloves")
    if floor is not None and min(errors.values()) < floor:
        wrong.append("an error was told that lies below its noise floor")
    return list(dict.fromkeys(wrong))


def _is_anything_left(found: Findings) -> bool:
    """Whether the error of the last model is more than a healthy glove's, in all or of one rotation."""
    compared = [found.last["overall"], *found.last["rotations"].values()]
    most = DIAGNOSIS_LIMITS.healthy_floors
    return any(item["rmse_deg"] > most * item["floor"]["floor_deg"] for item in compared if item["floor"])


def is_right(hidden: HiddenSession, found: Findings) -> bool:
    """Named was what is hidden; without a name of its own, that nothing was and that something is left."""
    truth, named = hidden.truth, _named(found)
    if truth is None:
        return named is None
    if not truth.name.startswith("unknown:"):
        return named == truth.name
    if truth.column is not None:
        return named == f"context:{truth.column}"
    return named is None and bool(found.diagnosis["unexplained_residual"]["is_significant"])


def hidden_contract(hidden: HiddenSession, found: Findings) -> dict[str, Any]:
    """What the second act adds to the JSON of ``glovecal demo --json``."""
    truth, floor = hidden.truth, floor_deg(found)
    return {
        "hidden": {
            "truth": truth.name if truth else "none",
            "form": truth.form if truth else None,
            "seed": hidden.seed,
            "named": _named(found),
            "confidence_set": _confidence_set(found),
            "right": is_right(hidden, found),
        },
        "error_fall_deg": {name: round(value, 4) for name, value in errors_deg(found).items()},
        "noise_floor_deg": None if floor is None else round(floor, 4),
    }


def _named(found: Findings) -> str | None:
    named = found.diagnosis["named"]
    return named["effect"] if named else None


def _named_after(found: Findings) -> str | None:
    named = found.diagnosis_after["named"] if found.diagnosis_after else None
    return named["effect"] if named else None


def _confidence_set(found: Findings) -> list[str]:
    named = found.diagnosis["named"]
    return list(named["confidence_set"]) if named else []
