"""A diagnosis as a page, made from its document alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from markupsafe import Markup

from glovecal_models.diagnosis.text import explained
from glovecal_models.effects.base.assessment import HeldOutRmse
from glovecal_service.next_command import action_command, next_command
from glovecal_service.report.caption import Caption
from glovecal_service.report.diagnosis_pictures import (
    errors_beside_floors,
    heat_of_candidates,
    saved_beside_controls,
)
from glovecal_service.report.effects import declarations_in, effect_card, effects_explained
from glovecal_service.report.html import (
    Fact,
    Section,
    counted,
    degrees,
    figure,
    listed,
    names_of,
    note,
    page,
    paragraph,
    table,
)

HEADS = ("effect", "where", "error before", "with the effect", "with its control", "significant")
RESIDUAL_HEADS = (
    "unexplained residual is associated with", "rotation", "RMS contribution, degrees",
    "p value, all columns counted",
)  # fmt: skip
ACTION_HEADS = ("rotation", "associated with", "effect or method", "before", "after", "control", "command")
ACTIONS = (
    "Held-out RMSE of the rotation's sensor in degrees: without the effect, with it in the form that the "
    "takes ask for, with its control of the same form. An effect column:NAME or context:NAME only names what "
    "the error goes along with; no cause is claimed. A method is named where the layout gives the "
    "rotation the column and a straight line cannot use it: nonlinearity of the base."
)
HOLD_HEADS = (
    *("pose", "sensor", "holds", "seconds each", "change, % of span", "same sign in", "time constant, s"),
)
SCALE = (
    "Held-out RMSE in degrees; readings and reference identically smoothed. A control has the same "
    "freedom as its effect and cannot be right: what it saves is flexibility, not cause."
)
NOTHING_NAMED = "No known effect beats its control significantly."


def diagnosis_page(
    found: Mapping[str, Any],
    caption: Caption | None = None,
    declarations: Sequence[Mapping[str, Any]] = (),
) -> str:
    """HTML. Keys that a diagnosis of another version lacks are left out.

    ``caption`` of the model, where the store has it; ``declarations`` of the user's own effects.
    """
    own = declarations_in(declarations)
    of = caption or Caption(str(found.get("model", "")))
    takes, candidates = found.get("takes") or [], found.get("candidates") or []
    rotations, held = found.get("rotations") or {}, found.get("hold_drift")
    named = found.get("named") or {}
    explained = list(dict.fromkeys([*named.get("confidence_set", ()), *_effects(named)]))
    shown = [effect_card(name, _parameters(named, name), own.get(name)) for name in explained]
    tried = [item["effect"] for item in candidates if item["effect"] not in explained]
    sections = [
        Section("The effect" if len(explained) == 1 else "The effects that are possible", shown),
        Section("What was tried", [*_candidates(candidates), *effects_explained(tried, own)]),
        Section("What remains unexplained", _unexplained(found.get("unexplained_residual") or {})),
        Section("What to do about it", _actions(found.get("actions") or (), of)),
    ]
    if held and held["poses"]:
        sections.append(
            Section("Readings while a pose is held", [paragraph(held["sentence"]), hold_table(held)])
        )
    if rotations and not held:
        sections.append(Section("Error of each rotation", [figure(*errors_beside_floors(rotations))]))
    sections += [
        Section("Effects of the model", [_effect_card(item) for item in found.get("model_effects") or ()]),
        Section("Not identifiable from these takes", _not_identifiable(found.get("not_identifiable") or ())),
        Section("Details", [_details(found, takes)]),
    ]
    notes = [
        *_warned("Takes set aside", [item["sentence"] for item in found.get("odd_takes") or ()]),
        *_warned("Excluded from the reference", found.get("excluded")),
        *_warned("Problems of the reference", found.get("reference_problems")),
        *_warned("Found in the recording", [item["sentence"] for item in found.get("findings") or ()]),
        *next_take_note(found.get("next_take")),
    ]
    summary = _summary(found, of)
    title = f"Missing effects in {of.title} ({counted(len(takes), 'take')})"
    return page(title, summary, sections, notes=notes)


def hold_table(held: Mapping[str, Any]) -> Markup:
    """How readings drift within held poses: the ``hold_drift`` of a diagnosis or an improvement."""
    rows = [
        (
            pose["pose"], name, str(pose["holds"]), f"{pose['duration_s']:.0f}",
            f"{drift['change_pct']:+.1f}", str(drift["same_sign_holds"]), _time_constant(pose),
        )
        for pose in held["poses"]
        for name, drift in pose["sensors"].items()
    ]  # fmt: skip
    return table(HOLD_HEADS, rows)


def next_take_note(following: Mapping[str, Any] | None) -> list[Markup]:
    """The recording that tells rivals apart."""
    if not following:
        return []
    rivals = " and ".join(following.get("separates") or ())
    return [note("", [f"To tell {rivals} apart record {following['seconds']} s: {following['what']}"])]


def _summary(found: Mapping[str, Any], of: Caption) -> list[Fact]:
    named, held = found.get("named"), found.get("hold_drift")
    rotations = found.get("rotations") or {}
    if held:
        facts = _held_facts(held)
    elif not named:
        facts = [Fact("Verdict", NOTHING_NAMED)]
    else:
        rivals = [name for name in named.get("confidence_set") or () if name != named["effect"]]
        also = f"; these takes cannot tell it from {', '.join(rivals)}" if rivals else ""
        facts = [Fact("Verdict", f"{named['effect']} is missing{also}.")]
        size = next((_size(item) for item in found.get("candidates") or () if _is(item, named)), None)
        facts.append(Fact("Size", size or named["sentence"]))
        facts.append(Fact("Place", ", ".join(named.get("where") or ()) or "all takes"))
    if rotations and not named and not held:
        name, error, floor = _worst(rotations)
        beside = "" if floor is None else f" (noise floor {floor:.2f})"
        facts += [Fact("Size", f"{error:.2f} degrees{beside}"), Fact("Place", f"largest error at {name}")]
    if found.get("ceiling"):
        facts.append(Fact("Ceiling", found["ceiling"]["sentence"]))
    command = next_command(str(found.get("model", "MODEL")), found, of.subject, of.hand)
    return [*facts, Fact("Next", command, is_command=True)]


def _held_facts(held: Mapping[str, Any]) -> list[Fact]:
    """Of a drift within held poses."""
    drifts = [
        (drift["change_pct"], f"{name} in pose {pose['pose']}, {counted(pose['holds'], 'hold')}", pose)
        for pose in held["poses"]
        for name, drift in pose["sensors"].items()
    ]
    possible = " or ".join(held.get("confidence_set") or ())
    if not possible or not drifts:
        return [Fact("Verdict", held["sentence"])]
    change, place, pose = max(drifts, key=lambda item: abs(item[0]))
    return [
        Fact("Verdict", f"Readings drift while a pose is held: {possible}."),
        Fact("Size", f"{change:+.1f} % of the sensor's span, time constant {_time_constant(pose)} s"),
        Fact("Place", place),
    ]


def _size(item: Mapping[str, Any]) -> str:
    rmse = HeldOutRmse(*(item.get(f"rmse_{when}_deg") or 0.0 for when in ("before", "after", "control")))
    p_value = item.get("p_value")
    return f"explains {explained(rmse, '' if p_value is None else f', p = {p_value:.2g}')}"


def _is(item: Mapping[str, Any], named: Mapping[str, Any]) -> bool:
    return item["effect"] == named["effect"]


def _worst(rotations: Mapping[str, Mapping[str, Any]]) -> tuple[str, float, float | None]:
    name = max(rotations, key=lambda name: rotations[name].get("rmse_deg") or 0.0)
    return name, rotations[name].get("rmse_deg") or 0.0, rotations[name].get("noise_floor_deg")


def _effects(named: Mapping[str, Any]) -> list[str]:
    return [named["effect"]] if named.get("effect") else []


def _parameters(named: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    return (named.get("parameters") or {}) if named.get("effect") == name else {}


def _warned(heading: str, sentences: Sequence[str] | None) -> list[Markup]:
    return [note(heading, sentences)] if sentences else []


def _effect_card(item: Mapping[str, Any]) -> Markup:
    return effect_card(item["effect"], item.get("parameters"), item.get("declaration"), item.get("curves"))


def _candidates(candidates: Sequence[Mapping[str, Any]]) -> list[Markup]:
    if not candidates:
        return []
    heat = heat_of_candidates(candidates)
    pictures = [figure(*saved_beside_controls(candidates)), *([figure(*heat)] if heat is not None else [])]
    rows = [
        (
            item["effect"],
            ", ".join(item.get("where") or ()) or "-",
            *(degrees(item.get(f"rmse_{when}_deg")) for when in ("before", "after", "control")),
            "yes" if item.get("passes") else "no",
        )
        for item in candidates
    ]
    return [*pictures, table(HEADS, rows), paragraph(SCALE)]


def _unexplained(residual: Mapping[str, Any]) -> list[Markup]:
    """Whether something is left, and the columns it is associated with."""
    sentence = residual.get("sentence")
    parts = [paragraph(sentence)] if sentence else []
    rows = [
        (item["phrase"], item["rotation"], degrees(item["size_deg"]), f"{item['p_value']:.3f}")
        for item in residual.get("associations") or ()
    ]
    return [*parts, table(RESIDUAL_HEADS, rows)] if rows else parts


def _actions(actions: Sequence[Mapping[str, Any]], of: Caption) -> list[Markup]:
    """What each association asks for; nothing without any."""
    rows = [
        (
            item["rotation"], item.get("phrase") or item["column"], _to_try(item),
            *(degrees(item.get(f"rmse_{when}_deg")) for when in ("before", "after", "control")),
            action_command(of.id or "MODEL", item, of.subject, of.hand) or "-",
        )
        for item in actions
    ]  # fmt: skip
    return [table(ACTION_HEADS, rows), paragraph(ACTIONS)] if rows else []


def _to_try(action: Mapping[str, Any]) -> str:
    if action.get("method"):
        return f"method {action['method']}"
    if not action.get("saves"):
        return "-"
    return str(action["effect"])


def _not_identifiable(items: Sequence[Mapping[str, Any]]) -> list[Markup]:
    by_reason: dict[str, list[str]] = {}
    for item in items:
        by_reason.setdefault(item["why"], []).append(item["effect"])
    return [listed([f"{', '.join(names)}: {why}" for why, names in by_reason.items()])] if by_reason else []


def _details(found: Mapping[str, Any], takes: Sequence[Mapping[str, Any]]) -> Markup:
    rows = [("model", str(found.get("model", "-"))), ("takes", names_of(takes) or "-")]
    return table(("", ""), rows)


def _time_constant(pose: Mapping[str, Any]) -> str:
    return f"> {pose['duration_s']:.0f}" if pose["tau_is_lower_bound"] else f"{pose['tau_s']:.2g}"
