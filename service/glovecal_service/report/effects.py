"""Effects on a page: one sentence, a small picture of what each does to a reading, and what was learned.

No effect is known here by name. The picture comes from the effect's own columns over a motion that rises,
holds and falls; of an effect without columns from the simulation of the same name.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from glovecal_models.calibration.added_effect import AddedEffect
from glovecal_models.diagnosis.hold_drift import HAND
from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.base.interval_effect import IntervalEffect
from glovecal_models.effects.base.signals import Signals
from glovecal_models.effects.base.signature_effect import SignatureEffect
from glovecal_models.effects.catalogue import effect, effect_of_declaration
from glovecal_models.errors import BadInput
from glovecal_models.simulation.causes.catalogue import KNOWN_CAUSES, forms
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_service.report.drawing import FLOOR, MEASURED, MODEL, figure_svg, legend_above
from glovecal_service.report.form_pictures import form_pictures
from glovecal_service.report.html import effect_part, folded, table

RATE_HZ = 50
LOW_DEG, HIGH_DEG = 10.0, 70.0
SHOWN_DEG = 15.0
"""How far the schematic effect moves the reading."""
KNOTS_S = (0, 2, 4, 9, 10, 13, 15, 20, 22, 24)
KNOTS_SHARE = (0, 0, 1, 1, 0.5, 0.5, 1, 1, 0, 0)
MOST_WEIGHTS = 200
NO_EFFECTS = {HAND: "The hand itself gives way while a pose is held; the glove is right."}
"""What else a diagnosis may name."""
SIMULATED = SessionPlan(
    seed=4, sensors=("I_MCP", "I_PIP"), wearings=1, takes_per_wearing=1, take_s=12, bits=14,
    nuisance="white", reference_white_deg=0, reference_lasting_deg=0, sensor_noise_deg=0,
)  # fmt: skip


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
    return _cached(known.name) if _known(known.name, None) is not None else _drawn(known)


@cache
def _cached(name: str) -> str | None:
    return _drawn(effect(name))


def _drawn(known: Effect) -> str | None:
    shown = _by_columns(known) if known.has_columns else None
    if shown is None and known.name in KNOWN_CAUSES:
        shown = _by_simulation(known.name)
    if shown is None:
        return None
    time, without, with_it, label = shown

    def draw(figure: Figure) -> None:
        left, right = figure.subplots(1, 2, width_ratios=(2, 1))
        left.plot(time, without, color=MEASURED, linewidth=1, linestyle="--", label="without")
        left.plot(time, with_it, color=MODEL, linewidth=1.4, label="with the effect")
        left.set(xlabel=_time_label(known), ylabel=label, xticks=(), yticks=())
        legend_above(left)
        _against(right, without, with_it)

    return figure_svg(draw, 5, 2)


def _time_label(known: Effect) -> str:
    if known.context:
        return f"time; c.{known.context[0]} rises"
    return "time; glove put on again half-way" if known.changes_between_takes else "time"


def _against(axes: Axes, without: np.ndarray, with_it: np.ndarray) -> None:
    low, high = float(np.nanmin(without)), float(np.nanmax(without))
    axes.plot((low, high), (low, high), color=MEASURED, linewidth=1, linestyle="--")
    axes.plot(without, with_it, color=FLOOR, linewidth=1)
    axes.set(xlabel="without", ylabel="with", xticks=(), yticks=())


def _by_columns(known: Effect) -> tuple[np.ndarray, np.ndarray, np.ndarray, str] | None:
    """Two takes, the second in another wearing and context; the column that does most is the effect."""
    takes = [_ramp_and_hold(known, number) for number in range(2)]
    try:
        settings = known.fit_constants(takes)
        grid = known.grid(takes, settings)
        shape = grid[len(grid) // 2]
        columns = [known.columns(take, settings, shape)[:, 0] for take in takes]
        prior = known.prior_sd(settings)
    except (BadInput, KeyError, ValueError):
        return None
    if not known.context and not known.changes_between_takes:
        columns, takes = columns[:1], takes[:1]
    joined, own = np.concatenate(columns), np.concatenate([take.own[:, 0] for take in takes])
    if not joined.shape[1]:
        return None
    sizes = np.std(joined, axis=0) * prior
    column = joined[:, int(np.flatnonzero(sizes >= 0.999 * sizes.max())[-1])]
    largest = float(np.max(np.abs(column)))
    if not np.isfinite(largest) or largest == 0:
        return None
    weight = SHOWN_DEG / largest
    if known.has_memory and not known.context:
        # In degrees of the joint: more than all of it makes no sense, and a sensor comes late, never early.
        late = -float(np.sign(np.sum(column[1:] * np.diff(own))) or -1.0)
        weight = late * min(weight, 1.0)
    time = np.arange(len(own)) / RATE_HZ
    return time, own, own + weight * column, "reading"


def _ramp_and_hold(known: Effect, number: int) -> Signals:
    time = np.arange(0, KNOTS_S[-1], 1 / RATE_HZ)
    motion = LOW_DEG + (HIGH_DEG - LOW_DEG) * np.interp(time, KNOTS_S, KNOTS_SHARE)
    neighbour = 1.5 * np.sin(2 * np.pi * time / 7.0)
    rising = 1.0 + number + time / KNOTS_S[-1]
    context = dict.fromkeys(known.context, rising)
    return Signals(
        time, motion[:, None], {"neighbour": neighbour}, context, f"wearing {number + 1}",
        f"take {number + 1}", np.zeros(1),
    )  # fmt: skip


def _by_simulation(name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray, str] | None:
    """A simulated glove with and without the cause, where it does most."""
    session = record_session(SIMULATED, [Cause(name, forms(name)[0].name, strength_deg=6.0)])
    take, clean = session.takes[0], session.clean[0]
    label, pair = "reading", (clean.readings, take.readings)
    if np.array_equal(*pair) and take.reference is not None and clean.reference is not None:
        label, pair = "measured angle", (clean.reference, take.reference)
    if np.array_equal(*pair):
        return None
    channel = int(np.argmax(np.nanmax(np.abs(pair[1] - pair[0]), axis=0)))
    without, with_it = (np.asarray(part[:, channel], dtype=float) for part in pair)
    return np.arange(len(without)) / SIMULATED.rate_hz, without, with_it, label


def declarations_in(documents: Sequence[Mapping[str, Any]]) -> dict[str, Mapping[str, Any]]:
    """Effects of the user's own by name, as a job's payload keeps them."""
    return {str(item["name"]): item for item in documents if "name" in item}
