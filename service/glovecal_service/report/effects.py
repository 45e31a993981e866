"""Effects on a page: one sentence, a small picture of what each does to a reading, and what was learned.

No effect is known here by name.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from glovecal_models.calibration.added_effect import AddedEffect
from glovecal_models.diagnosis.hold_drift import HAND
from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.base.interval_effect import IntervalEffect
from glovecal_models.effects.base.learned_form import OWN
from glovecal_models.effects.base.signature_effect import SignatureEffect
from glovecal_models.effects.catalogue import effect, effect_of_declaration
from glovecal_models.errors import BadInput
from glovecal_service.report.drawing import FLOOR, MEASURED, MODEL, QUIET, figure_svg, legend_above, svg
from glovecal_service.report.effect_schematic import Schematic, schematic
from glovecal_service.report.html import effect_part, figure, folded, multiples, paragraph, table

MOST_WEIGHTS = 200
NO_EFFECTS = {HAND: "The hand itself gives way while a pose is held; the glove is right."}
"""What else a diagnosis may name."""


def effect_card(
    name: str,
    parameters: Mapping[str, Any] | None = None,
    declaration: Mapping[str, Any] | None = None,
    curves: Mapping[str, Mapping[str, Any]] | None = None,
) -> Markup:
    """One effect in a sentence and a picture, with its learned ``parameters`` and the ``curves`` of its
    learned form as documents tell them."""
    known = _known(name, declaration)
    if known is None:
        explanation, picture = NO_EFFECTS.get(name, "No effect of this name is installed here."), None
    else:
        explanation, picture = known.explanation, _picture_of(known)
    return effect_part(
        name, explanation, picture, [*form_pictures(curves or {}), *_learned(known, parameters or {})]
    )


def effects_explained(names: Iterable[str], declarations: Mapping[str, Mapping[str, Any]]) -> list[Markup]:
    """A folded list of effects that were only tried; nothing for none."""
    cards = [effect_card(name, None, declarations.get(name)) for name in names]
    return [folded(f"What these {len(cards)} effects are", cards)] if cards else []


def parameters_of(added: AddedEffect) -> dict[str, Any]:
    """What a model has learned of an effect, in the shape of documents."""
    known = added.effect
    if isinstance(known, SignatureEffect) and not isinstance(known, IntervalEffect):
        return dict(known.described_constants(added.settings))
    return dict(added.described())


def curves_of(added: AddedEffect) -> dict[str, Any]:
    """The curves of a model's effect, in the shape of documents."""
    return {name: item.to_document() for name, item in added.curves.items()}


def _known(name: str, declaration: Mapping[str, Any] | None) -> Effect | None:
    try:
        return effect(name) if declaration is None else effect_of_declaration(declaration)
    except BadInput:
        return None


def _learned(known: Effect | None, parameters: Mapping[str, Any]) -> list[Markup]:
    """A table of the effect's own parameters, with units; its weights folded below."""
    units = {} if known is None else {f"{item.name}_{item.unit}": item for item in known.parameters}
    heads = {key: f"{item.name.replace('_', ' ')}, {item.unit}" for key, item in units.items()}
    own, other = _flattened(parameters, heads)
    parts = []
    if own:
        columns = [key for key in heads if any(key in values for values in own.values())]
        places = [place for place in own if place] or [""]
        rows = [
            (place or "all", *(_number(own.get(place, {}).get(key)) for key in columns)) for place in places
        ]
        parts.append(table(("learned", *(heads[key] for key in columns)), rows))
    if other:
        rows = [(place or "all", name, _number(value)) for place, name, value in other[:MOST_WEIGHTS]]
        left = len(other) - len(rows)
        heading = f"{len(other)} other learned values" + (f", {left} of them not shown" if left else "")
        parts.append(folded(heading, [table(("where", "value", "size"), rows)]))
    return parts


def _flattened(
    parameters: Mapping[str, Any], own: Mapping[str, str]
) -> tuple[dict[str, dict[str, Any]], list[tuple[str, str, Any]]]:
    """Values of the effect's ``own`` parameters by place, and all others; places are rotations or takes."""
    by_place: dict[str, dict[str, Any]] = {}
    other = []
    for key, value in parameters.items():
        if key in own and isinstance(value, Mapping):
            for place, number in value.items():
                by_place.setdefault(str(place), {})[key] = number
        elif isinstance(value, Mapping):
            for name, number in value.items():
                if name in own:
                    by_place.setdefault(key, {})[name] = number
                else:
                    other.append((key, name.replace("_", " "), number))
        elif key in own:
            by_place.setdefault("", {})[key] = value
        else:
            other.append(("", key.replace("_", " "), value))
    return by_place, other


def _number(value: Any) -> str:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return "-" if value is None else str(value)
    return f"{value:.3g}"


def _picture_of(known: Effect) -> str | None:
    """None where neither columns nor a simulation show it."""
    shown = schematic(known)
    return None if shown is None else _drawn(shown)


def _drawn(shown: Schematic) -> str:
    def draw(figure: Figure) -> None:
        left, right = figure.subplots(1, 2, width_ratios=(2, 1))
        left.plot(shown.time_s, shown.without, color=MEASURED, linewidth=1, linestyle="--", label="without")
        left.plot(shown.time_s, shown.with_it, color=MODEL, linewidth=1.4, label="with the effect")
        left.set(xlabel=shown.time_label, ylabel=shown.label, xticks=(), yticks=())
        legend_above(left)
        _against(right, shown.without, shown.with_it)

    return figure_svg(draw, 5, 2)


def _against(axes: Axes, without: np.ndarray, with_it: np.ndarray) -> None:
    low, high = float(np.nanmin(without)), float(np.nanmax(without))
    axes.plot((low, high), (low, high), color=MEASURED, linewidth=1, linestyle="--")
    axes.plot(without, with_it, color=FLOOR, linewidth=1)
    axes.set(xlabel="without", ylabel="with", xticks=(), yticks=())


def declarations_in(documents: Sequence[Mapping[str, Any]]) -> dict[str, Mapping[str, Any]]:
    """Effects of the user's own by name, as a job's payload keeps them."""
    return {str(item["name"]): item for item in documents if "name" in item}


# Small multiples of a learned form: what an effect adds to each rotation, over each of its inputs.


MOST_ROTATIONS = 8
WIDTH, HEIGHT = 2.9, 2.1
"""Inches: so small that a narrow screen does not shrink the text."""
UNIT_WORDS = {"deg": "degrees", "SD": "SD of training"}
HOW_TO_READ = (
    "What the effect adds in training, over each of its inputs. Line: mean; band: from the 10 to the 90 % "
    "quantile, wide where it depends on more than this input."
)


def form_pictures(curves: Mapping[str, Mapping[str, Any]]) -> list[Markup]:
    """One picture for each rotation and input, all on one scale of degrees; nothing without curves.

    ``curves``: by rotation, as in the JSON of a model; the rotations to which most is added are shown.
    """
    known = {name: item for name, item in curves.items() if item.get("inputs")}
    if not known:
        return []
    shown = sorted(known, key=lambda name: -_reach(known[name]))[:MOST_ROTATIONS]
    left = len(known) - len(shown)
    more = f" {left} other rotations, to which less is added, are not shown." if left else ""
    each = [(name, curve) for name in shown for curve in known[name]["inputs"]]
    low = min(min(_numbers(curve["low_deg"])) for _, curve in each)
    high = max(max(_numbers(curve["high_deg"])) for _, curve in each)
    room = 0.06 * max(high - low, 1e-3)
    span = (min(low, 0.0) - room, max(high, 0.0) + room)
    ranges = "; ".join(f"{name}: {_range(known[name])}" for name in shown)
    return [
        paragraph(f"{HOW_TO_READ}{more} Lowest and highest, in degrees: {ranges}."),
        multiples([figure(_picture(name, curve, span), _sentence(name, curve)) for name, curve in each]),
    ]


def _picture(rotation: str, curve: Mapping[str, Any], span: tuple[float, float]) -> str:
    def draw(axes: Axes) -> None:
        at = _numbers(curve["at"])
        axes.axhline(0, color=QUIET, linewidth=1)
        low, mean, high = (_numbers(curve[key]) for key in ("low_deg", "mean_deg", "high_deg"))
        axes.fill_between(at, low, high, color=MODEL, alpha=0.25, linewidth=0)
        axes.plot(at, mean, color=MODEL, linewidth=1.6, marker="." if len(at) < 3 else None)
        axes.set(xlabel=_label(rotation, curve), ylabel=f"adds to {rotation}, degrees", ylim=span)

    return svg(draw, WIDTH, HEIGHT)


def _label(rotation: str, curve: Mapping[str, Any]) -> str:
    unit = UNIT_WORDS.get(curve["unit"], curve["unit"])
    name = f"angle of {rotation}" if curve["input"] == OWN else str(curve["input"])
    return f"{name}, {unit}" if unit else name


def _sentence(rotation: str, curve: Mapping[str, Any]) -> str:
    slope = curve["slope_deg_per_unit"]
    name = "its own angle" if curve["input"] == OWN else curve["input"]
    unit = {"deg": "degree"}.get(curve["unit"], curve["unit"]) or "unit"
    mean = "" if slope is None else f": {slope:+.3g} degrees per {unit} on average"
    return f"{rotation} over {name}{mean}"


def _range(item: Mapping[str, Any]) -> str:
    ends = [item["lowest_deg"], item["highest_deg"]]
    return " to ".join("-" if end is None else f"{end:+.2f}" for end in ends)


def _reach(item: Mapping[str, Any]) -> float:
    return max(abs(item["lowest_deg"] or 0.0), abs(item["highest_deg"] or 0.0))


def _numbers(values: Sequence[float | None]) -> list[float]:
    return [0.0 if value is None else value for value in values]
