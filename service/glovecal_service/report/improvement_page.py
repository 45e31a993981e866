"""An improvement as a page, made from its document alone: the fall of the error, step by step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from markupsafe import Markup

from glovecal_service.next_command import recording_command
from glovecal_service.report.caption import Caption
from glovecal_service.report.diagnosis_page import hold_table, next_take_note
from glovecal_service.report.effects import effect_card
from glovecal_service.report.error_fall import error_fall
from glovecal_service.report.fall_steps import Fall, FloorBand
from glovecal_service.report.html import Fact, Section, counted, degrees, figure, folded, listed, page, table

STOPPED = {
    "noise_floor": "The error is at the noise floor.",
    "nothing_named": "No other known effect beats its control significantly.",
    "ambiguous": "These takes cannot tell the remaining effects apart.",
    "not_better": "The next effect does not reduce the held-out error and was undone.",
}
MEASURED_HOW = (
    "RMSE in degrees over all rotations, held-out: on takes not trained on, the same for every step."
)


def improvement_page(
    found: Mapping[str, Any], method: str, subject: str, caption: Caption | None = None
) -> str:
    """HTML. Keys that an improvement of another version lacks are left out.

    ``caption`` of the last model, where the store has it.
    """
    steps, last = found["steps"], found["steps"][-1]
    of = (
        caption if caption is not None and caption.subject else Caption(str(last.get("model") or ""), subject)
    )
    picture, sentence = error_fall(falls_of(found, method), band_of(found))
    sections = [
        Section("How the error falls", [figure(picture, sentence), _steps(steps, method)]),
        Section("Effects added", [_card(step["added"]) for step in steps if step["added"]]),
        Section("Each rotation", [_rotations(steps, found.get("noise_floor_deg") or {}, method)]),
    ]
    held = found.get("hold_drift")
    if held and held["poses"]:
        sections.append(Section("Readings while a pose is held", [hold_table(held)]))
    if found.get("sentences"):
        log = folded(
            "Messages of every step; a diagnosis measures on smoothed signals, so its errors differ a little",
            [listed(found["sentences"])],
        )
        sections.append(Section("Details", [log, _models(steps, method)]))
    notes = next_take_note(found.get("next_take"))
    return page(f"Improvement of {of.title}", _summary(found, method), sections, notes=notes)


def _summary(found: Mapping[str, Any], method: str) -> list[Fact]:
    steps = found["steps"]
    first, last, band = steps[0], steps[-1], band_of(found)
    floor = "" if band is None else f"; noise floor {band.floor_deg:.2f}"
    added = [step["added"]["effect"] for step in steps if step["added"]]
    verdict = f"{method} with {', '.join(added)}" if added else f"{method} alone; no effect was added"
    size = f"held-out error {degrees(first['rmse_deg'])} degrees{floor}"
    if added:
        size = (
            f"held-out error reduced from {degrees(first['rmse_deg'])} to {degrees(last['rmse_deg'])} "
            f"degrees{floor}"
        )
    unseen = last.get("rmse_unseen_wearing_deg")
    if unseen is not None:
        size = f"{unseen:.2f} degrees in a wearing not seen; in the wearings seen: {size}"
    errors = {name: error for name, error in last["per_rotation"].items() if error is not None}
    facts = [Fact("Verdict", f"{verdict}. {STOPPED.get(found['stopped'], '')}".strip()), Fact("Size", size)]
    if errors:
        worst = max(errors, key=lambda name: errors[name])
        facts.append(Fact("Place", f"largest remaining error at {worst}: {errors[worst]:.2f} degrees"))
    if found.get("ceiling"):
        facts.append(Fact("Ceiling", found["ceiling"]["sentence"]))
    return [*facts, Fact("Next", _next(found), is_command=True)]


def _next(found: Mapping[str, Any]) -> str:
    model = str(found["steps"][-1].get("model") or "MODEL")[:12]
    following = found.get("next_take")
    if following:
        return recording_command(following)
    if found["stopped"] == "noise_floor":
        return f"glovecal model activate {model}"
    return f"glovecal where {model} --report where-{model}.html"


def _card(added: Mapping[str, Any]) -> Markup:
    return effect_card(
        added["effect"], added.get("parameters"), added.get("declaration"), added.get("curves")
    )


def falls_of(found: Mapping[str, Any], method: str) -> list[Fall]:
    """Simpler calibrations, the base, and each effect. ``found`` has today's keys."""
    scale = sorted((found.get("baselines") or {}).items(), key=lambda item: -item[1])
    falls = [Fall(name, error, is_scale=True) for name, error in scale]
    before: Mapping[str, Any] | None = None
    for step in found["steps"]:
        added = step["added"]
        label = method if added is None else "+ " + added["effect"].replace("_", "\n", 1)
        falls.append(Fall(label, step["rmse_deg"], None if before is None else _with_control(before, step)))
        before = step
    return falls


def band_of(found: Mapping[str, Any]) -> FloorBand | None:
    """The noise floor over all rotations that the last step measured; None when that of one is unknown."""
    floors = found.get("noise_floor_deg") or {}
    spans = found.get("noise_floor_interval_deg") or {}
    names = found["steps"][-1]["per_rotation"]
    if any(floors.get(name) is None for name in names):
        return None
    return FloorBand.of({name: (floors[name], *spans.get(name, [floors[name]] * 2)) for name in names})


def _with_control(before: Mapping[str, Any], step: Mapping[str, Any]) -> float | None:
    """Over all rotations, degrees; not above the error before: what made it worse would have been undone."""
    control = step.get("control_rmse_deg")
    if control is None or not step["added"] or not before["rmse_deg"]:
        return None
    return min(control, before["rmse_deg"])


def _steps(steps: Sequence[Mapping[str, Any]], method: str) -> Markup:
    """Before and after of each step, once and measured one way."""
    rows, before = [], None
    for step in steps:
        added = step["added"] or {}
        rivals = [name for name in added.get("confidence_set") or () if name != added["effect"]]
        verdict = verdict_words(added) + (f" (or {', '.join(rivals)})" if rivals else "")
        control = None if before is None else _with_control(before, step)
        rows.append(
            (
                _label(step, method), ", ".join(added.get("where") or ()) or "-", verdict,
                degrees(None if before is None else before["rmse_deg"]), degrees(step["rmse_deg"]),
                degrees(control),
            )
        )  # fmt: skip
        before = step
    heads = ("step", "where", "verdict", "before", "after", "control")
    return table(heads, rows) + Markup("<p>{}</p>").format(MEASURED_HOW)


def verdict_words(added: Mapping[str, Any]) -> str:
    """Of the effect of a step; no cause is claimed of one that was tried for an association."""
    verdict = str(added.get("verdict", "-"))
    if verdict != "associated":
        return verdict
    column = added.get("associated_with")
    return f"associated{f' with {column}' if column else ''}; no cause is claimed"


def _models(steps: Sequence[Mapping[str, Any]], method: str) -> Markup:
    rows = [(_label(step, method), str(step.get("model") or "-")) for step in steps]
    return folded(f"{counted(len(rows), 'model')} by id", [table(("step", "model"), rows)])


def _rotations(steps: Sequence[Mapping[str, Any]], floors: Mapping[str, float], method: str) -> Markup:
    names = list(steps[-1]["per_rotation"])
    heads = ["rotation", *(_label(step, method) for step in steps), "noise floor"]
    rows = [
        [name, *(degrees(step["per_rotation"].get(name)) for step in steps), degrees(floors.get(name))]
        for name in sorted(names, key=lambda name: -(steps[0]["per_rotation"].get(name) or 0.0))
    ]
    return table(heads, rows)


def _label(step: Mapping[str, Any], method: str) -> str:
    return method if step["added"] is None else f"+ {step['added']['effect']}"
