"""What designs of the same takes share, whatever effects are in their base: signals, rows, curves.

A diagnosis makes a design with the effects that a model has, one without them and one with what it named.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from glovecal_models.calibration.folds import (
    alone_in_their_motion,
    are_short,
    first_measured,
    pieces,
    reached_by_others,
)
from glovecal_models.calibration.held_out import BaseFeatures, BaseProducts, Rows, with_precision
from glovecal_models.diagnosis.camera_columns import CameraPart, camera_columns, without_visibility
from glovecal_models.diagnosis.known_effect import KnownColumns
from glovecal_models.diagnosis.resampled import ResampledTake
from glovecal_models.diagnosis.tied_angles import tied_angles
from glovecal_models.effects.base.signals import Signals
from glovecal_models.layout import Correspondence, Layout

EVERY = 2
"""Of the even times: neighbours say nearly the same."""


@dataclass(frozen=True)
class JointBasis:
    """One joint: its rows and its base without effects."""

    read: frozenset[str]
    """Names among ``others`` that the base reads already, and joints whose angles tell its own."""
    beside: frozenset[str]
    """Names that an effect in the base does not read for this joint."""
    used: tuple[np.ndarray, ...]
    """For each unit: indices of its take's rows that are fitted."""
    units: tuple[Rows, ...]
    """Without the columns of a camera."""
    variance: tuple[np.ndarray | None, ...]
    """For each unit (N,) stated variances, degrees squared; None where the take states none."""
    camera: KnownColumns | None
    """What the base has of the errors of a camera."""
    without_effects: list[BaseProducts] = field(default_factory=list, compare=False)
    """Empty until they were asked for."""

    def products(self, unit_take: Sequence[int], known: Sequence[KnownColumns]) -> BaseProducts:
        """With the columns of effects in the base; those without any are worked out once."""
        if not known and self.without_effects:
            return self.without_effects[0]
        extra = [*known, *(() if self.camera is None else (self.camera,))]
        units = [
            replace(unit, base=np.column_stack([unit.base, *(found.parts[take][rows] for found in extra)]))
            for unit, take, rows in zip(self.units, unit_take, self.used, strict=True)
        ]
        free = np.full(self.units[0].base.shape[1], np.inf)
        prior_sd = np.concatenate([free, *(found.prior_sd for found in extra)])
        result = BaseProducts(with_precision(units, self.variance), prior_sd, len(free))
        if not known:
            self.without_effects.append(result)
        return result


@dataclass(frozen=True)
class ForwardBasis:
    """All joints of takes that went through one smoothing."""

    signals: tuple[Signals, ...]
    """One for each take, own (N, R)."""
    unit_take: tuple[int, ...]
    """The take of each unit that is left out: a whole take, or a quarter of a short one."""
    joints: tuple[JointBasis, ...]

    @classmethod
    def of(
        cls,
        takes: Sequence[ResampledTake],
        layout: Layout,
        rotations: Sequence[str],
        *,
        linear: bool,
        same_angle_share: float,
        every: int = EVERY,
        camera: CameraPart = "varying",
    ) -> ForwardBasis:
        """Own sensor, scaled to degrees, from the measured angles; one measured row in ``every`` is fitted.

        ``same_angle_share``: of its deviation, within which an angle follows from one or two others.
        """
        names, is_seen = list(rotations), any(take.reference_sd is not None for take in takes)
        sensor = [_own_sensor(takes, layout, rotation, column) for column, rotation in enumerate(rotations)]
        filled = [
            _filled(
                take.reference,
                np.column_stack([item.values[number] for item in sensor]),
                has_long_gaps=take.reference_sd is not None,
            )
            for number, take in enumerate(takes)
        ]
        everything = np.concatenate(filled)
        tied = tied_angles(everything, same_angle_share)
        cut = _cut(takes)
        unit_take = tuple(number for number, parts in enumerate(cut) for _ in parts)
        joints = []
        for column, rotation in enumerate(rotations):
            item = layout.correspondence(rotation)
            neighbours = [] if linear else _read_beside(item, names, layout)
            columns = [column, *(names.index(name) for name in neighbours)]
            features = BaseFeatures.fit_constants([part[:, columns] for part in filled], linear=linear)
            measured = [
                rows[(rows >= piece.start) & (rows < piece.stop)]
                for take, parts in zip(takes, cut, strict=True)
                for rows in [np.flatnonzero(np.isfinite(take.reference[:, column]))[::every]]
                for piece in parts
            ]
            own = [filled[take][rows, column] for take, rows in zip(unit_take, measured, strict=True)]
            reached = reached_by_others(own)
            used = tuple(rows[mask] for rows, mask in zip(measured, reached, strict=True))
            units = tuple(
                Rows(features.columns(filled[take][rows][:, columns]), sensor[column].values[take][rows])
                for take, rows in zip(unit_take, used, strict=True)
            )
            seen = camera_columns(takes, filled, column, camera) if is_seen and camera != "none" else None
            beside = frozenset({rotation, *neighbours, *item.sensors})
            joints.append(
                JointBasis(
                    beside | {names[other] for other in tied[column]},
                    beside,
                    used,
                    units,
                    tuple(
                        _variance(takes[take], rows, column)
                        for take, rows in zip(unit_take, used, strict=True)
                    ),
                    seen,
                )
            )
        signals = _signals(takes, layout, names, filled, everything, sensor, is_seen=is_seen)
        return cls(signals, unit_take, tuple(joints))


def _signals(
    takes: Sequence[ResampledTake],
    layout: Layout,
    names: Sequence[str],
    filled: Sequence[np.ndarray],
    everything: np.ndarray,
    sensor: Sequence[_OwnSensor],
    *,
    is_seen: bool,
) -> tuple[Signals, ...]:
    spread, centre = everything.std(axis=0), everything.mean(axis=0)
    spare = {name: i for i, name in enumerate(layout.sensors) if name not in names}
    return tuple(
        Signals(
            take.time_s,
            angles,
            {name: (angles[:, i] - centre[i]) / max(spread[i], 1e-9) for i, name in enumerate(names)}
            | {name: values[:, i] for name, i in spare.items()},
            (without_visibility(take) if is_seen else take).context,
            take.wearing,
            take.name,
            np.array([item.zero_deg for item in sensor]),
            take.glove_latency,
        )
        for take, angles, values in zip(
            takes, filled, _standard([take.readings for take in takes]), strict=True
        )
    )


def _cut(takes: Sequence[ResampledTake]) -> list[list[slice]]:
    """The units of each take: itself, or quarters where takes are short or it is alone in its motion."""
    short = len(takes) == 1 or are_short([take.time_s[first_measured(take.reference) :] for take in takes])
    alone = alone_in_their_motion([take.name for take in takes], [take.wearing for take in takes])
    return [
        pieces(take.time_s, take.reference) if short or is_alone else [slice(0, len(take.time_s))]
        for take, is_alone in zip(takes, alone, strict=True)
    ]


def _variance(take: ResampledTake, rows: np.ndarray, column: int) -> np.ndarray | None:
    """(N,) stated variances, degrees squared; None where the take states none."""
    if take.reference_sd is None or not np.isfinite(take.reference_sd[:, column]).any():
        return None
    stated = take.reference_sd[rows, column]
    # Smoothing reaches past the last accepted sample by less than half its width.
    return np.where(np.isfinite(stated), stated, np.nanmax(take.reference_sd[:, column])) ** 2


def _read_beside(item: Correspondence, names: Sequence[str], layout: Layout) -> list[str]:
    """Other joints that the base knows through its sensors: neighbours by name; without a sensor of its own,
    all joints that share sensors with it."""
    if item.rotation in item.sensors or len(item.inputs) == 1:
        return [name for name in item.sensors if name in names and name != item.rotation]
    shared = [name for name in names if set(layout.correspondence(name).sensors) & set(item.sensors)]
    return [name for name in shared if name != item.rotation]


def _standard(readings: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Each take's readings (N, S) in standard deviations over all takes."""
    every = np.concatenate(readings)
    centre, spread = every.mean(axis=0), np.maximum(every.std(axis=0), 1e-9)
    return [(part - centre) / spread for part in readings]


@dataclass(frozen=True)
class _OwnSensor:
    """The sensor of one joint in degrees."""

    values: list[np.ndarray]
    """For each take (N,)."""
    zero_deg: float
    """Where a reading of zero lies."""


def _own_sensor(takes: Sequence[ResampledTake], layout: Layout, rotation: str, column: int) -> _OwnSensor:
    """The measuring sensor by a straight line; without one of its own, what all inputs together predict."""
    item = layout.correspondence(rotation)
    inputs = [item.input_columns(take.readings, list(layout.sensors)) for take in takes]
    index = [np.flatnonzero(np.isfinite(take.reference[:, column])) for take in takes]
    several = len(item.inputs) > 1 and item.inputs[0] != rotation
    x = np.concatenate([part[rows] for part, rows in zip(inputs, index, strict=True)])
    y = np.concatenate([take.reference[rows, column] for take, rows in zip(takes, index, strict=True)])
    if not several:
        x, inputs = x[:, :1], [part[:, :1] for part in inputs]
    scale = np.maximum(x.std(axis=0), 1e-9)
    z = (x - x.mean(axis=0)) / scale
    gram = z.T @ z + 1e-4 * len(z) * np.eye(z.shape[1])
    slope = np.linalg.solve(gram, z.T @ (y - y.mean())) / scale
    values = [(part - x.mean(axis=0)) @ slope for part in inputs]
    return _OwnSensor(values, float(-x.mean(axis=0) @ slope))


def _filled(reference: np.ndarray, read: np.ndarray, *, has_long_gaps: bool = False) -> np.ndarray:
    """Straight lines across rows that were not measured; only the operators' states pass through them.

    Before the first measured row the hand moved as its sensors say: ``read`` (N, R), degrees of any zero. So
    it did within ``has_long_gaps``, those of a camera that accepts some of what it sees: the line is of what
    the reference differs by, as a neighbour's angle is read there too.
    """
    if has_long_gaps:
        return read + _filled(reference - read, np.zeros_like(read))
    result = reference.copy()
    rows = np.arange(len(reference))
    for column in range(reference.shape[1]):
        known = np.isfinite(reference[:, column])
        result[:, column] = np.interp(rows, rows[known], reference[known, column]) if known.any() else 0.0
        if known.any():
            first = int(np.argmax(known))
            result[:first, column] += read[:first, column] - read[first, column]
    return result
