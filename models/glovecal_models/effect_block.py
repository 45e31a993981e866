"""An effect on a page: one sentence, a small picture of what it does to a reading, and what was learned.

No effect is known here by name. The picture comes from the effect's own columns over a motion that rises,
holds and falls; of an effect without columns from the simulation of the same name.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from glovecal_models.calibration.added_effect import AddedEffect
from glovecal_models.effects.base.effect import CorrectionEffect, Effect, RepairEffect, is_between_takes
from glovecal_models.effects.base.form_curve import FormCurve, LaneCurves
from glovecal_models.effects.base.learned_form import OWN
from glovecal_models.effects.base.signals import Signals
from glovecal_models.effects.catalogue import effect, effect_of_declaration
from glovecal_models.errors import BadInput
from glovecal_models.presentation.document import (
    Block,
    Chart,
    Column,
    Explanation,
    Folded,
    Part,
    Pictures,
    Table,
)
from glovecal_models.presentation.drawing import FLOOR, MEASURED, MODEL, QUIET, legend_above
from glovecal_models.simulation.session_plan import SessionPlan

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_WEIGHTS = 200
NO_EFFECTS = {"hand_relaxing": "The hand itself gives way while a pose is held; the glove is right."}
"""What else a diagnosis may name."""
ROTATIONS_SHOWN = 8
WIDTH_IN, HEIGHT_IN = 2.9, 2.1
"""So small that a narrow screen does not shrink the text."""
UNIT_WORDS = {"deg": "degrees", "SD": "SD of training"}
HOW_TO_READ = (
    "What the effect adds in training, over each of its inputs. Line: mean; band: from the 10 to the 90 % "
    "quantile, wide where it depends on more than this input."
)

RATE_HZ = 50
LOW_DEG, HIGH_DEG = 10.0, 70.0
SHOWN_DEG = 15.0
"""How far the schematic effect moves the reading."""
KNOTS_S = (0, 2, 4, 9, 10, 13, 15, 20, 22, 24)
KNOTS_SHARE = (0, 0, 1, 1, 0.5, 0.5, 1, 1, 0, 0)
SIMULATED = SessionPlan(
    seed=4, sensors=("I_MCP", "I_PIP"), wearings=1, takes_per_wearing=1, take_s=12, bits=14,
    nuisance="white", reference_white_deg=0, reference_lasting_deg=0, sensor_noise_deg=0,
)  # fmt: skip


def effect_block(
    name: str,
    parameters: Mapping[str, Any] | None = None,
    declaration: Mapping[str, Any] | None = None,
    curves: Mapping[str, LaneCurves] | None = None,
) -> Block:
    """One effect with its learned ``parameters``, as answers tell them, and ``curves`` of its learned form;
    ``declaration`` of an effect of the user's own."""
    try:
        known = effect(name) if declaration is None else effect_of_declaration(declaration)
    except BadInput:
        known = None
    shown = None if known is None else schematic(known)
    explanation = NO_EFFECTS.get(name, "No effect of this name is installed here.")
    parts: list[Part] = [explanation if known is None else known.about.explanation]
    parts += [] if shown is None else [_schematic_chart(shown)]
    return Block(name, [*parts, *_form_pictures(curves or {}), *_learned(known, parameters or {})])


def effects_explained(names: Iterable[str], declarations: Mapping[str, Mapping[str, Any]]) -> list[Part]:
    """A folded list of effects that were only tried; nothing for none."""
    cards = [effect_block(name, None, declarations.get(name)) for name in names]
    return [Folded(f"What these {len(cards)} effects are", cards)] if cards else []


def block_of(added: AddedEffect) -> Block:
    """The effect as a model has learned it."""
    known = added.effect
    parameters: Mapping[str, Any] = added.described()
    if isinstance(known, RepairEffect):
        parameters = known.described(added.settings)
    return effect_block(added.name, parameters, added.settings.get("declaration"), added.curves)


def _learned(known: Effect | None, parameters: Mapping[str, Any]) -> list[Part]:
    """A table of the effect's own parameters, with units; its weights folded below."""
    units = {} if known is None else {f"{item.name}_{item.unit}": item for item in known.shape.parameters}
    heads = {key: f"{item.name.replace('_', ' ')}, {item.unit}" for key, item in units.items()}
    own, other = _flattened(parameters, heads)
    parts: list[Part] = []
    if own:
        names = [key for key in heads if any(key in values for values in own.values())]
        places = [place for place in own if place] or [""]
        columns = [Column("learned"), *(Column(key, heads[key]) for key in names)]
        rows = [
            (place or "all", *(_number(own.get(place, {}).get(key)) for key in names)) for place in places
        ]
        parts.append(Table(columns, rows))
    if other:
        rows = [(place or "all", name, _number(value)) for place, name, value in other[:MOST_WEIGHTS]]
        left = len(other) - len(rows)
        heading = f"{len(other)} other learned values" + (f", {left} of them not shown" if left else "")
        parts.append(Folded(heading, [Table([Column("where"), Column("value"), Column("size")], rows)]))
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


def _schematic_chart(shown: Schematic) -> Chart:
    def draw(figure: Figure) -> None:
        left, right = figure.subplots(1, 2, width_ratios=(2, 1))
        left.plot(shown.time_s, shown.without, color=MEASURED, linewidth=1, linestyle="--", label="without")
        left.plot(shown.time_s, shown.with_it, color=MODEL, linewidth=1.4, label="with the effect")
        left.set(xlabel=shown.time_label, ylabel=shown.label, xticks=(), yticks=())
        legend_above(left)
        ends = (float(np.nanmin(shown.without)), float(np.nanmax(shown.without)))
        right.plot(ends, ends, color=MEASURED, linewidth=1, linestyle="--")
        right.plot(shown.without, shown.with_it, color=FLOOR, linewidth=1)
        right.set(xlabel="without", ylabel="with", xticks=(), yticks=())

    return Chart(None, 5, 2, "Schematic, not to scale. Dashed: without the effect.", panels=draw)


def _form_pictures(curves: Mapping[str, LaneCurves]) -> list[Part]:
    """One picture for each rotation and input, all on one scale of degrees; nothing without curves.

    The rotations to which most is added are shown.
    """
    known = {name: item for name, item in curves.items() if item.inputs}
    if not known:
        return []
    shown = sorted(known, key=lambda name: -max(abs(known[name].lowest_deg), abs(known[name].highest_deg)))
    shown = shown[:ROTATIONS_SHOWN]
    left = len(known) - len(shown)
    more = f" {left} other rotations, to which less is added, are not shown." if left else ""
    each = [(name, curve) for name in shown for curve in known[name].inputs]
    low = min(min(curve.low_deg) for _, curve in each)
    high = max(max(curve.high_deg) for _, curve in each)
    room = 0.06 * max(high - low, 1e-3)
    span = (min(low, 0.0) - room, max(high, 0.0) + room)
    ranges = "; ".join(
        f"{name}: {known[name].lowest_deg:+.2f} to {known[name].highest_deg:+.2f}" for name in shown
    )
    return [
        Explanation(f"{HOW_TO_READ}{more} Lowest and highest, in degrees: {ranges}."),
        Pictures([_form_chart(name, curve, span) for name, curve in each], are_small=True),
    ]


def _form_chart(rotation: str, curve: FormCurve, span: tuple[float, float]) -> Chart:
    is_own = curve.input == OWN
    unit = UNIT_WORDS.get(curve.unit, curve.unit)
    label = f"angle of {rotation}" if is_own else curve.input

    def draw(axes: Axes) -> None:
        axes.axhline(0, color=QUIET, linewidth=1)
        axes.fill_between(curve.at, curve.low_deg, curve.high_deg, color=MODEL, alpha=0.25, linewidth=0)
        marker = "." if len(curve.at) < 3 else None
        axes.plot(curve.at, curve.mean_deg, color=MODEL, linewidth=1.6, marker=marker)
        axes.set(
            xlabel=f"{label}, {unit}" if unit else label, ylabel=f"adds to {rotation}, degrees", ylim=span
        )

    each = {"deg": "degree"}.get(curve.unit, curve.unit) or "unit"
    mean = f"{curve.slope_deg_per_unit:+.3g} degrees per {each} on average"
    sentence = f"{rotation} over {'its own angle' if is_own else curve.input}: {mean}"
    return Chart(draw, WIDTH_IN, HEIGHT_IN, sentence)


@dataclass(frozen=True)
class Schematic:
    """N moments; sizes are for show."""

    time_s: np.ndarray
    without: np.ndarray
    """(N,): the reading, or the angle that is measured."""
    with_it: np.ndarray
    label: str
    """What the two are: "reading" or "measured angle"."""
    time_label: str


def schematic(known: Effect) -> Schematic | None:
    """None where neither columns nor a simulation show it."""
    try:
        in_catalogue = effect(known.name) is known
    except BadInput:
        in_catalogue = False
    return _of_name(known.name) if in_catalogue else _made(known)


@cache
def _of_name(name: str) -> Schematic | None:
    return _made(effect(name))


def _made(known: Effect) -> Schematic | None:
    shown = _by_columns(known) if isinstance(known, CorrectionEffect) else None
    return _by_simulation(known) if shown is None else shown


def _time_label(known: Effect) -> str:
    if known.context:
        return f"time; c.{known.context[0]} rises"
    return "time; glove put on again half-way" if is_between_takes(known) else "time"


def _by_columns(known: CorrectionEffect) -> Schematic | None:
    """Two takes, the second in another wearing and context; the column that does most is the effect."""
    takes = [_ramp_and_hold(known, number) for number in range(2)]
    try:
        settings = known.fit_constants(takes)
        grid = known.shape.grid(takes, settings)
        shape = grid[len(grid) // 2]
        columns = [known.columns(take, settings, shape)[:, 0] for take in takes]
        prior = known.weights(settings).prior_sd
    except (BadInput, KeyError, ValueError):
        return None
    if not known.context and not is_between_takes(known):
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
    if known.dynamics.has_memory and not known.context:
        # In degrees of the joint: more than all of it makes no sense, and a sensor comes late, never early.
        late = -float(np.sign(np.sum(column[1:] * np.diff(own))) or -1.0)
        weight = late * min(weight, 1.0)
    time = np.arange(len(own)) / RATE_HZ
    return Schematic(time, own, own + weight * column, "reading", _time_label(known))


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


def _by_simulation(known: Effect) -> Schematic | None:
    """A simulated glove with and without the cause, where it does most; None where nobody simulates it."""
    # Slow to load, with scipy.signal, and every command and service loads this file.
    from glovecal_models.simulation.causes.catalogue import KNOWN_CAUSES, forms
    from glovecal_models.simulation.causes.form import Cause
    from glovecal_models.simulation.session import record_session

    if known.name not in KNOWN_CAUSES:
        return None
    session = record_session(SIMULATED, [Cause(known.name, forms(known.name)[0].name, strength_deg=6.0)])
    take, clean = session.takes[0], session.clean[0]
    label, pair = "reading", (clean.readings, take.readings)
    if np.array_equal(*pair) and take.reference is not None and clean.reference is not None:
        label, pair = "measured angle", (clean.reference, take.reference)
    if np.array_equal(*pair):
        return None
    channel = int(np.argmax(np.nanmax(np.abs(pair[1] - pair[0]), axis=0)))
    without, with_it = (np.asarray(part[:, channel], dtype=float) for part in pair)
    time = np.arange(len(without)) / SIMULATED.rate_hz
    return Schematic(time, without, with_it, label, _time_label(known))
