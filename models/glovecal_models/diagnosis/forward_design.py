"""What a diagnosis is fitted on: each joint's own sensor from the measured angles (forward).

A noisy reference rewards any low pass in this direction; strong smoothing and controls take that away. The
other direction, angle from sensors, is what adding an effect tries.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from glovecal_models.calibration.folds import are_short, first_measured, pieces
from glovecal_models.calibration.held_out import BaseFeatures, BaseProducts, Rows, with_precision
from glovecal_models.diagnosis.camera_columns import CameraPart, camera_columns, without_visibility
from glovecal_models.diagnosis.known_effect import KnownEffect, one_lane
from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS, DiagnosisLimits
from glovecal_models.diagnosis.resampled import ResampledTake
from glovecal_models.effects.base.signals import Signals
from glovecal_models.layout import Correspondence, Layout

EVERY = 2
"""Of the even times: neighbours say nearly the same."""


@dataclass(frozen=True)
class ForwardDesign:
    """All joints, sensor from angles."""

    rotations: tuple[str, ...]
    signals: tuple[Signals, ...]
    """One for each take, own (N, R)."""
    known: tuple[frozenset[str], ...]
    """Names among ``others`` that the base of each joint reads already, and joints that bend as it does."""
    unit_take: tuple[int, ...]
    """The take of each unit that is left out: a whole take, or a quarter of a short one."""
    used: tuple[tuple[np.ndarray, ...], ...]
    """For each joint and unit: indices of its take's rows that are fitted."""
    products: tuple[BaseProducts, ...]
    """For each joint."""
    limits: DiagnosisLimits = DIAGNOSIS_LIMITS

    kept: dict[str, Any] = field(default_factory=dict, compare=False)
    """What effects worked out together."""

    def once(self, what: str, work: Callable[[], Any]) -> Any:
        """The result of ``work``, kept for whoever asks for the same again."""
        if what not in self.kept:
            self.kept[what] = work()
        return self.kept[what]

    def rows(self, joint: int, columns: Sequence[np.ndarray]) -> list[np.ndarray]:
        """``columns``: for each take (N, ...); the fitted rows of those."""
        return [columns[take][index] for take, index in self.units(joint)]

    def of_joint(self, joint: int) -> tuple[Signals, ...]:
        """The signals of one joint alone, without those that its base reads already."""
        return tuple(one_lane(_without(take, self.known[joint]), joint) for take in self.signals)

    def mean_square(self) -> dict[str, float]:
        """Held-out squared error of each joint, degrees squared per row."""
        return {
            name: float(item.error.sum() / max(item.count.sum(), 1))
            for name, item in zip(self.rotations, self.products, strict=True)
        }

    def units(self, joint: int) -> Iterator[tuple[int, np.ndarray]]:
        """Take and row indices of each unit."""
        return zip(self.unit_take, self.used[joint], strict=True)


def forward(
    takes: Sequence[ResampledTake],
    layout: Layout,
    rotations: Sequence[str],
    *,
    linear: bool,
    known: Sequence[KnownEffect] = (),
    limits: DiagnosisLimits = DIAGNOSIS_LIMITS,
    every: int = EVERY,
    camera: CameraPart = "varying",
) -> ForwardDesign:
    """Own sensor, scaled to degrees, from the measured angles; ``known`` effects belong to the base.

    One measured row in ``every`` is fitted. Where deviations of the reference are stated, rows count by them,
    and ``camera`` says whether the errors of such a reference belong to the base (``camera_errors``).
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
    spread, centre = everything.std(axis=0), everything.mean(axis=0)
    spare = {name: i for i, name in enumerate(layout.sensors) if name not in names}
    standard = _standard([take.readings for take in takes])
    signals = tuple(
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
        for take, angles, values in zip(takes, filled, standard, strict=True)
    )
    short = len(takes) == 1 or are_short([take.time_s[first_measured(take.reference) :] for take in takes])
    cut = [pieces(take.time_s, take.reference) if short else [slice(0, len(take.time_s))] for take in takes]
    unit_take = tuple(number for number, parts in enumerate(cut) for _ in parts)
    read, used, products = [], [], []
    for column, rotation in enumerate(rotations):
        item = layout.correspondence(rotation)
        neighbours = [] if linear else _read_beside(item, names, layout)
        columns = [column, *(names.index(name) for name in neighbours)]
        features = BaseFeatures.fit_constants([part[:, columns] for part in filled], linear=linear)
        index = [
            rows[(rows >= piece.start) & (rows < piece.stop)]
            for take, parts in zip(takes, cut, strict=True)
            for rows in [np.flatnonzero(np.isfinite(take.reference[:, column]))[::every]]
            for piece in parts
        ]
        without = [_without(take, frozenset({rotation, *neighbours, *item.sensors})) for take in signals]
        extra = [found for each in known if (found := each.columns(without, column, rotation)) is not None]
        if is_seen and camera != "none":
            of_camera = camera_columns(takes, filled, column, camera)
            extra += [] if of_camera is None else [of_camera]
        bases = [
            np.column_stack([features.columns(part[:, columns]), *(found.parts[number] for found in extra)])
            for number, part in enumerate(filled)
        ]
        units = [
            Rows(bases[take][rows], sensor[column].values[take][rows])
            for take, rows in zip(unit_take, index, strict=True)
        ]
        units = with_precision(
            units, [_variance(takes[take], rows, column) for take, rows in zip(unit_take, index, strict=True)]
        )
        alike = _bending_alike(everything, column, limits.same_angle_share)
        read.append(frozenset({rotation, *neighbours, *item.sensors, *(names[other] for other in alike)}))
        used.append(tuple(index))
        of_known = [found.prior_sd for found in extra]
        free = np.full(units[0].base.shape[1] - sum(map(len, of_known)), np.inf)
        products.append(BaseProducts(units, np.concatenate([free, *of_known])))
    return ForwardDesign(
        tuple(rotations), signals, tuple(read), unit_take, tuple(used), tuple(products), limits
    )


def _variance(take: ResampledTake, rows: np.ndarray, column: int) -> np.ndarray | None:
    """(N,) stated variances, degrees squared; None where the take states none."""
    if take.reference_sd is None or not np.isfinite(take.reference_sd[:, column]).any():
        return None
    stated = take.reference_sd[rows, column]
    # Smoothing reaches past the last accepted sample by less than half its width.
    return np.where(np.isfinite(stated), stated, np.nanmax(take.reference_sd[:, column])) ** 2


def _bending_alike(angles: np.ndarray, column: int, share: float) -> list[int]:
    """Other columns of ``angles`` (N, R) that are a cubic of one, but for ``share`` of their deviation."""
    scale = max(float(angles[:, column].std()), 1e-9)
    own = np.vander((angles[:, column] - angles[:, column].mean()) / scale, 4)
    rest = angles - own @ np.linalg.lstsq(own, angles, rcond=None)[0]
    alike = rest.std(axis=0) < share * angles.std(axis=0)
    return [int(other) for other in np.flatnonzero(alike) if other != column]


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


def _without(take: Signals, known: frozenset[str]) -> Signals:
    return replace(take, others={name: v for name, v in take.others.items() if name not in known})


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
