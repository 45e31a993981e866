"""The one picture that shows an effect in an error: means over what the effect says it is drawn over.

The error (predicted minus measured) of one rotation is averaged in bins of about equally many frames; how far
chance takes such a mean is that of ``dependence``: the same errors shifted in time against the column.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.comparison.dependence import Covariate, covariates, dependence
from glovecal_models.comparison.residuals import Residuals, TakeResiduals
from glovecal_models.comparison.where.answer import Dependence
from glovecal_models.effects.base.effect import Effect
from glovecal_models.errors import BadInput

DRAWN_MOVING_SHARE = 0.08
"""Of the joint's quick speeds (95th percentile): below it the joint counts as held."""
FIRST_S = 0.25
"""Of a hold: what its error is told from."""
SHORTEST_DRAWN_HOLD_S = 1.0
FEWEST_HELD_FRAMES = 60
LARGEST_SHIFT_S = 0.4
SHIFTS = 81
MOST_TRACKS = 6
"""Takes that are told apart in one picture."""
TIME_BINS = 120
MOST_POINTS = 1200
SEED = 0


@dataclass(frozen=True)
class PictureSeries:
    """One line of a picture; B places on its axis and F single frames."""

    name: str
    """Such as "angle rising"; "" for a line that is alone."""
    at: np.ndarray
    """(B,), in the axis' unit; the number of the category where there are categories."""
    mean_deg: np.ndarray
    """(B,)"""
    low_deg: np.ndarray
    """(B,): 10 % of the frames are lower; NaN where that makes no sense."""
    high_deg: np.ndarray
    chance_deg: np.ndarray
    """(B,): how far 95 % of shifted errors take such a mean; NaN: not tested."""
    points_at: np.ndarray
    """(F,)"""
    points_deg: np.ndarray


@dataclass(frozen=True)
class EffectPicture:
    """An error of one rotation as an effect would have it drawn."""

    rotation: str
    axis: str
    unit: str
    value: str
    """What is drawn upwards, in degrees."""
    categories: tuple[str, ...]
    """Places on an axis without numbers; empty: numbers."""
    series: tuple[PictureSeries, ...]
    """Empty where these takes have nothing to draw it from; the sentence says why."""
    sentence: str


def effect_picture(found: Residuals, effect: Effect, rotation: str) -> EffectPicture:
    """Raises BadInput for a rotation that no take measured, and a column that was not recorded."""
    if rotation not in found.measured_rotations:
        raise BadInput(f"none of the takes measured {rotation}")
    return _PICTURES[effect.about.shown_over](found, effect, rotation)


def _errors(found: Residuals, rotation: str) -> tuple[np.ndarray, ...]:
    column = found.column(rotation)
    return tuple(item.error[:, column] for item in found.takes)


def _covariate(found: Residuals, rotation: str, name: str) -> Covariate:
    return next(one for one in covariates(found, rotation) if one.name == name)


def _over_angle(found: Residuals, effect: Effect, rotation: str) -> EffectPicture:
    return _over(found, rotation, _covariate(found, rotation, "angle"))


def _over_context(found: Residuals, effect: Effect, rotation: str) -> EffectPicture:
    for one in covariates(found, rotation):
        if any(
            effect.about.may_show_in(one.name, effect.context) or one.name == f"context {name}"
            for name in effect.context
        ):
            return _over(found, rotation, one)
    raise BadInput(f"no context column c.{effect.context[0]} was recorded")


def _over_neighbour(found: Residuals, effect: Effect, rotation: str) -> EffectPicture:
    """Over the sensor that explains most; never that of the joint itself, where it has one of its name."""
    wanted = {f"sensor {name}" for name in effect.about.neighbours}
    every = [one for one in covariates(found, rotation) if one.name.startswith("sensor ")]
    every = [one for one in every if one.name in wanted or (not wanted and one.name != f"sensor {rotation}")]
    errors = _errors(found, rotation)
    tested = [(dependence(errors, one, np.random.default_rng(SEED)), one) for one in every]
    known = [(item.explained_deg, number) for number, (item, _) in enumerate(tested) if item is not None]
    if not known:
        raise BadInput(f"no other sensor than that of {rotation} moves in these takes")
    return _over(found, rotation, every[max(known)[1]])


def _over(found: Residuals, rotation: str, column: Covariate) -> EffectPicture:
    errors = _errors(found, rotation)
    series = _means("", errors, column)
    if series is None:
        return _nothing(rotation, column.name, column.unit, f"{column.phrase} never changes in these takes")
    low, high = float(series.mean_deg.min()), float(series.mean_deg.max())
    sentence = (
        f"Over {column.phrase} the mean error of {rotation} goes from {low:+.1f} to {high:+.1f} degrees."
    )
    return EffectPicture(rotation, column.name, column.unit, "error", (), (series,), sentence)


def _both_ways(found: Residuals, effect: Effect, rotation: str) -> EffectPicture:
    """Over the angle, apart for both directions of motion: a loop."""
    angle, speed = (_covariate(found, rotation, name) for name in ("angle", "direction"))
    errors, least = _errors(found, rotation), _held_below(speed)
    lines = []
    for name, sign in (("angle rising", 1.0), ("angle falling", -1.0)):
        moving = [np.where(sign * v > least, e, np.nan) for e, v in zip(errors, speed.values, strict=True)]
        lines.append(_means(name, tuple(moving), angle))
    rising, falling = lines
    if rising is None or falling is None:
        return _nothing(rotation, angle.name, angle.unit, f"{rotation} does not go to and fro in these takes")
    common = (rising.at >= falling.at.min()) & (rising.at <= falling.at.max())
    apart = (rising.mean_deg - np.interp(rising.at, falling.at, falling.mean_deg))[common]
    width = float(np.mean(apart)) if len(apart) else float("nan")
    sentence = (
        f"At the same angle the error of {rotation} is {abs(width):.1f} degrees "
        f"{'higher' if width > 0 else 'lower'} while the angle rises than while it falls: the two lines are "
        "the sides of a loop."
    )
    return EffectPicture(rotation, "angle", "deg", "error", (), (rising, falling), sentence)


def _over_speed(found: Residuals, effect: Effect, rotation: str) -> EffectPicture:
    """The slope of the error over the speed is a time."""
    picture = _over(found, rotation, _covariate(found, rotation, "direction"))
    if not picture.series:
        return picture
    line = picture.series[0]
    late_s = -float(np.polyfit(line.at, line.mean_deg, 1)[0])
    sentence = (
        f"The error of {rotation} goes with its speed, as of a reading that comes "
        f"{abs(1000 * late_s):.0f} ms too {'late' if late_s > 0 else 'early'}."
    )
    return replace(picture, axis="speed", sentence=sentence)


def _over_hold(found: Residuals, effect: Effect, rotation: str) -> EffectPicture:
    """Over the time since the joint came to rest, apart for the direction it came from."""
    speed, errors = _covariate(found, rotation, "direction"), _errors(found, rotation)
    least = _held_below(speed)
    since, changes, signs = [], [], []
    for item, error, value in zip(found.takes, errors, speed.values, strict=True):
        rest = _rest(item.take.time_s, error, value, least)
        for part, into in zip(rest, (since, changes, signs), strict=True):
            into.append(part)
    column = Covariate("time since the joint came to rest", "s", "time at rest", tuple(since))
    lines = []
    for name, sign in (("after the angle rose", 1.0), ("after the angle fell", -1.0)):
        own = tuple(np.where(s == sign, c, np.nan) for s, c in zip(signs, changes, strict=True))
        if sum(np.isfinite(part).sum() for part in own) >= FEWEST_HELD_FRAMES:
            line = _means(name, own, column)
            lines += [] if line is None else [line]
    if not lines:
        why = (
            f"{rotation} is nowhere held for {SHORTEST_DRAWN_HOLD_S:g} s in these takes: hold poses to see it"
        )
        return _nothing(rotation, column.name, column.unit, why)
    ends = " and ".join(f"{line.mean_deg[-1]:+.1f} degrees {line.name}" for line in lines)
    reach = max(float(line.at[-1]) for line in lines)
    sentence = f"While {rotation} is held its error goes on: within {reach:.1f} s by {ends}."
    return EffectPicture(
        rotation, column.name, "s", "change of the error since then", (), tuple(lines), sentence
    )


def _over_time(found: Residuals, effect: Effect, rotation: str) -> EffectPicture:
    """The take with the largest error, in equal parts of time."""
    errors = _errors(found, rotation)
    sizes = [np.sqrt(np.nanmean(e**2)) if np.isfinite(e).any() else -1.0 for e in errors]
    worst = int(np.argmax(sizes))
    take, error = found.takes[worst].take, errors[worst]
    time = take.time_s - take.start_s
    known = np.isfinite(error)
    edges = np.linspace(time[known][0], time[known][-1] + 1e-9, TIME_BINS + 1)
    where = np.clip(np.searchsorted(edges, time[known], side="right") - 1, 0, TIME_BINS - 1)
    count = np.bincount(where, minlength=TIME_BINS)
    mean = np.bincount(where, error[known], TIME_BINS) / np.maximum(count, 1)
    middle, used = 0.5 * (edges[1:] + edges[:-1]), count > 0
    line = _line(take.name, middle[used], mean[used], time[known], error[known])
    sentence = (
        f"{rotation} over take {take.name}, the one with its largest error: RMSE {sizes[worst]:.1f} degrees."
    )
    return EffectPicture(rotation, "time in take", "s", "error", (), (line,), sentence)


def _by_wearing(found: Residuals, effect: Effect, rotation: str) -> EffectPicture:
    return _by(found, rotation, "wearing", lambda item: item.take.wearing or "unnamed")


def _by_take(found: Residuals, effect: Effect, rotation: str) -> EffectPicture:
    return _by(found, rotation, "take", lambda item: item.take.name)


def _by(found: Residuals, rotation: str, axis: str, key: Callable[[TakeResiduals], str]) -> EffectPicture:
    """One value a category with its spread; every take's mean is a point."""
    errors = _errors(found, rotation)
    measured = [(key(item), e[np.isfinite(e)]) for item, e in zip(found.takes, errors, strict=True)]
    measured = [(name, error) for name, error in measured if len(error)]
    names = tuple(dict.fromkeys(name for name, _ in measured))
    each = [np.concatenate([error for other, error in measured if other == name]) for name in names]
    line = PictureSeries(
        name="",
        at=np.arange(len(names), dtype=float),
        mean_deg=np.array([part.mean() for part in each]),
        low_deg=np.array([np.quantile(part, 0.1) for part in each]),
        high_deg=np.array([np.quantile(part, 0.9) for part in each]),
        chance_deg=np.full(len(names), np.nan),
        points_at=np.array([names.index(name) for name, _ in measured], dtype=float),
        points_deg=np.array([error.mean() for _, error in measured]),
    )
    low, high = float(line.mean_deg.min()), float(line.mean_deg.max())
    sentence = (
        f"From {axis} to {axis} the mean error of {rotation} changes from {low:+.1f} to {high:+.1f} degrees."
        if len(names) > 1
        else f"There is one {axis} only: no change can be seen."
    )
    return EffectPicture(rotation, axis, "", "error", names, (line,), sentence)


def _over_shift(found: Residuals, effect: Effect, rotation: str) -> EffectPicture:
    """The error that is left when the reference is moved in time: lowest where the clocks agree."""
    column = found.column(rotation)
    shifts = np.linspace(-LARGEST_SHIFT_S, LARGEST_SHIFT_S, SHIFTS)
    each = [(item.take.name, _when_shifted(item, column, shifts)) for item in found.takes]
    each = [(name, error) for name, error in each if np.isfinite(error).any()]
    if not each:
        return _nothing(rotation, "shift of the reference", "ms", "these takes are too short to be shifted")
    overall = np.sqrt(np.nanmean([error**2 for _, error in each], axis=0))
    lines = [_line(name, 1000 * shifts, error) for name, error in each[:MOST_TRACKS]]
    if len(each) > 1:
        lines.insert(0, _line("all takes", 1000 * shifts, overall))
    best = int(np.nanargmin(overall))
    single = [1000 * shifts[int(np.nanargmin(error))] for _, error in each]
    spread = "" if len(each) < 2 else f"; take by take from {min(single):+.0f} to {max(single):+.0f} ms"
    sentence = (
        f"The error of {rotation} is smallest with the reference {1000 * shifts[best]:+.0f} ms later: "
        f"{overall[best]:.1f} instead of {overall[SHIFTS // 2]:.1f} degrees{spread}."
    )
    return EffectPicture(
        rotation,
        "shift of the reference, later is positive",
        "ms",
        "error (RMSE)",
        (),
        tuple(lines),
        sentence,
    )


def _when_shifted(item: TakeResiduals, column: int, shifts_s: np.ndarray) -> np.ndarray:
    """(S,): RMSE over the frames that every shift has."""
    time, measured = item.take.time_s, item.measured[:, column]
    known = np.isfinite(measured)
    result = np.full(len(shifts_s), np.nan)
    if known.sum() < 2:
        return result
    reach = float(np.abs(shifts_s).max())
    inside = known & (time >= time[known][0] + reach) & (time <= time[known][-1] - reach)
    if not inside.any():
        return result
    for number, shift in enumerate(shifts_s):
        moved = np.interp(time[inside] - shift, time[known], measured[known])
        result[number] = np.sqrt(np.mean((item.predicted[inside, column] - moved) ** 2))
    return result


def _held_below(speed: Covariate) -> float:
    """Degrees per second."""
    sizes = np.abs(np.concatenate(speed.values))
    sizes = sizes[np.isfinite(sizes)]
    return DRAWN_MOVING_SHARE * float(np.quantile(sizes, 0.95)) if len(sizes) else 0.0


def _rest(
    time_s: np.ndarray, error: np.ndarray, speed: np.ndarray, least: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(N,) each: seconds since the joint came to rest, the error's change since then, and the direction it
    came from (1, -1 or 0); NaN outside holds."""
    since, change, sign = (np.full(len(time_s), np.nan) for _ in range(3))
    for first, last in _holds(np.abs(speed) <= least):
        held = slice(first, last)
        if first == 0 or time_s[last - 1] - time_s[first] < SHORTEST_DRAWN_HOLD_S:
            continue
        passed = time_s[held] - time_s[first]
        before = speed[max(0, first - 5) : first]
        start = error[held][passed <= FIRST_S]
        if not np.isfinite(start).any() or not np.isfinite(before).any():
            continue
        since[held], change[held] = passed, error[held] - np.nanmean(start)
        sign[held] = np.sign(np.nanmean(before))
    return since, change, sign


def _holds(is_held: np.ndarray) -> Iterator[tuple[int, int]]:
    """Begin and end of each run of held frames."""
    turns = np.flatnonzero(np.diff(np.concatenate(([0], is_held.astype(int), [0]))))
    yield from zip(turns[::2].tolist(), turns[1::2].tolist(), strict=True)


def _means(name: str, errors: tuple[np.ndarray, ...], column: Covariate) -> PictureSeries | None:
    tested = dependence(errors, column, np.random.default_rng(SEED))
    if tested is None:
        return None
    error, value = np.concatenate(errors), np.concatenate(column.values)
    known = np.isfinite(error) & np.isfinite(value)
    error, value = error[known], value[known]
    where = np.clip(np.searchsorted(tested.edges, value, side="right") - 1, 0, len(tested.mean_deg) - 1)
    low, high = (_quantiles(error, where, tested, share) for share in (0.1, 0.9))
    at = np.array([_middle(value[where == number], tested, number) for number in range(len(tested.mean_deg))])
    step = max(1, -(-len(error) // MOST_POINTS))
    return PictureSeries(
        name,
        at,
        np.array(tested.mean_deg),
        low,
        high,
        np.array(tested.chance_deg, dtype=float),
        value[::step],
        error[::step],
    )


def _middle(values: np.ndarray, tested: Dependence, number: int) -> float:
    return float(np.mean(values)) if len(values) else float(np.mean(tested.edges[number : number + 2]))


def _quantiles(error: np.ndarray, where: np.ndarray, tested: Dependence, share: float) -> np.ndarray:
    parts = [error[where == number] for number in range(len(tested.mean_deg))]
    return np.array([np.quantile(part, share) if len(part) else np.nan for part in parts])


def _line(
    name: str,
    at: np.ndarray,
    value: np.ndarray,
    points_at: np.ndarray | None = None,
    points: np.ndarray | None = None,
) -> PictureSeries:
    """Without intervals; frames are thinned."""
    unknown = np.full(len(at), np.nan)
    if points_at is None or points is None:
        return PictureSeries(name, at, value, unknown, unknown, unknown, np.empty(0), np.empty(0))
    step = max(1, -(-len(points) // MOST_POINTS))
    return PictureSeries(name, at, value, unknown, unknown, unknown, points_at[::step], points[::step])


def _nothing(rotation: str, axis: str, unit: str, why: str) -> EffectPicture:
    return EffectPicture(rotation, axis, unit, "error", (), (), f"No picture: {why}.")


_PICTURES: dict[str, Callable[[Residuals, Effect, str], EffectPicture]] = {
    "angle": _over_angle,
    "angle both ways": _both_ways,
    "speed": _over_speed,
    "hold": _over_hold,
    "time in take": _over_time,
    "wearing": _by_wearing,
    "take": _by_take,
    "neighbour": _over_neighbour,
    "context": _over_context,
    "clock shift": _over_shift,
}
