"""What a diagnosis is fitted on: each joint's own sensor from the measured angles (forward).

A noisy reference rewards any low pass in this direction; strong smoothing and controls take that away. The
other direction, angle from sensors, is what adding an effect tries.

A diagnosis makes a design with the effects that a model has, one without them and one with what it named:
they share signals, rows and curves (``ForwardBasis``). Joints whose angles tell another's, alone, as PIP and
DIP do, or two together, as those of a virtual joint, are no candidates to pull at its sensor: each angle is
measured with noise, and what it hides of the true angle theirs show (errors in variables).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

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
from glovecal_models.diagnosis.known_effect import KnownColumns, KnownEffect, one_lane
from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS, DiagnosisLimits
from glovecal_models.diagnosis.resampled import ResampledTake
from glovecal_models.effects.base.effect import CorrectionEffect, has_memory
from glovecal_models.effects.base.signals import Settings, Signals
from glovecal_models.layout import Correspondence, Layout

ONE_IN, ENOUGH_TO_THIN = 4, 100
"""Of so many rows and more: neighbours say nearly the same."""
FEWEST_OF_A_CUBIC = 10
"""Through fewer a cubic goes by chance."""


def tied_angles(angles: np.ndarray, share: float, noise_deg: float = 0.0) -> list[set[int]]:
    """For each column of ``angles`` (N, R), degrees: the others that are no candidates to pull at its sensor.

    Others that are a cubic of it, but for ``share`` of their deviation. Others that tell it as closely as it
    is measured itself, to ``noise_deg``, but for twice the share at most. And where an angle follows from two
    others together: that one for both, and for that one the more telling of both. The one that follows most
    closely is taken first, since two that it ties need not tell of each other.
    """
    if len(angles) < FEWEST_OF_A_CUBIC:
        return [set() for _ in range(angles.shape[1])]
    angles = angles[::ONE_IN] if len(angles) >= ENOUGH_TO_THIN else angles
    count, centred = angles.shape[1], angles - angles.mean(axis=0)
    length = np.maximum(np.linalg.norm(centred, axis=0), 1e-9)
    noise = np.minimum(noise_deg * np.sqrt(len(angles)) / length, 2.0 * share)
    centred /= length
    cubics = np.concatenate([np.linalg.qr(_cubic(column))[0] for column in centred.T], axis=1)  # (N, 3 R)
    across = (cubics.T @ cubics).reshape(count, 3, count, 3).swapaxes(1, 2)
    of_cubic = (cubics.T @ centred).reshape(count, 3, count)
    left = 1.0 - np.square(of_cubic).sum(axis=1)  # of the second by a cubic of the first
    alike = (left < share**2) | (left < noise**2).T
    tied = [set(np.flatnonzero(alike[one]).tolist()) - {one} for one in range(count)]
    alone = [one for one in range(count) if not any(one in others for others in tied)]
    by_two = {one: _best_two(one, range(count), across, of_cubic) for one in alone}
    for one in sorted(alone, key=lambda one: by_two[one][0]):
        rest = [other for other in range(count) if other not in tied[one]]
        found, first, second = _best_two(one, rest, across, of_cubic)
        if found < share**2:
            tied[one].add(first)
            tied[first].add(one)
            tied[second].add(one)
    return tied


def _best_two(
    one: int, among: Sequence[int], across: np.ndarray, of_cubic: np.ndarray
) -> tuple[float, int, int]:
    """What cubics of two others leave of one angle's variance, and which: the best, and the best beside it.

    ``across`` (R, R, 3, 3): products of the cubics of each two; ``of_cubic`` (R, 3, R): of each cubic and
    each angle.
    """
    others = [other for other in among if other != one]
    if len(others) < 2:
        return 1.0, one, one
    by_one = np.square(of_cubic[others, :, one]).sum(axis=1)
    first = others.pop(int(np.argmax(by_one)))
    shared = across[others, first]
    beyond = (1.0 + 1e-9) * np.eye(3) - shared @ shared.swapaxes(1, 2)
    new = of_cubic[others, :, one] - shared @ of_cubic[first, :, one]
    gained = np.einsum("kc,kc->k", new, np.linalg.solve(beyond, new[:, :, None])[:, :, 0])
    at = int(np.argmax(gained))
    return float(1.0 - by_one.max() - gained[at]), first, others[at]


def _cubic(column: np.ndarray) -> np.ndarray:
    """(N, 3): the column, its square and its cube, of mean zero."""
    powers = np.column_stack([column, column**2, column**3])
    return powers - powers.mean(axis=0)


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
        same_angle_deg: float,
        every: int = EVERY,
        camera: CameraPart = "varying",
    ) -> ForwardBasis:
        """Own sensor, scaled to degrees, from the measured angles; one measured row in ``every`` is fitted.

        ``same_angle_share``: of its deviation, within which an angle follows from one or two others;
        ``same_angle_deg``: within which another tells it as closely as it is measured.
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
        tied = tied_angles(everything, same_angle_share, same_angle_deg)
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


@dataclass(frozen=True)
class ForwardDesign:
    """All joints, sensor from angles."""

    rotations: tuple[str, ...]
    signals: tuple[Signals, ...]
    """One for each take, own (N, R)."""
    known: tuple[frozenset[str], ...]
    """Names among ``others`` that the base of each joint reads already, and joints that tell its angle."""
    unit_take: tuple[int, ...]
    """The take of each unit that is left out: a whole take, or a quarter of a short one."""
    used: tuple[tuple[np.ndarray, ...], ...]
    """For each joint and unit: indices of its take's rows that are fitted."""
    products: tuple[BaseProducts, ...]
    """For each joint."""
    known_deg: tuple[tuple[np.ndarray, ...], ...] = ()
    """For each joint and take (N,): what the known effects without a memory add; no take where none does."""
    limits: DiagnosisLimits = DIAGNOSIS_LIMITS

    kept: dict[str, Any] = field(default_factory=dict, compare=False)
    """What effects worked out together."""

    def once(self, what: str, work: Callable[[], Any]) -> Any:
        """The result of ``work``, kept for whoever asks for the same again."""
        if what not in self.kept:
            self.kept[what] = work()
        return self.kept[what]

    def constants(self, effect: CorrectionEffect) -> Settings:
        """Those of ``effect`` on all joints; not to be changed."""
        return self.once(f"constants of {effect.name}", lambda: effect.fit_constants(self.signals))

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
    basis: ForwardBasis,
    rotations: Sequence[str],
    *,
    known: Sequence[KnownEffect] = (),
    limits: DiagnosisLimits = DIAGNOSIS_LIMITS,
) -> ForwardDesign:
    """Own sensor, scaled to degrees, from the measured angles; ``known`` effects belong to the base.

    Where deviations of the reference are stated, rows count by them.
    """
    products, known_deg = [], []
    together = [each.side_by_side(basis.signals, rotations) for each in known]
    for column, (rotation, joint) in enumerate(zip(rotations, basis.joints, strict=True)):
        without = [_without(take, joint.beside) for take in basis.signals] if known else []
        found = [
            each.columns(without, column, rotation, columns)
            for each, columns in zip(known, together, strict=True)
        ]
        there = [(each, item) for each, item in zip(known, found, strict=True) if item is not None]
        products.append(joint.products(basis.unit_take, [item for _, item in there]))
        known_deg.append(_without_memory(there, products[-1]))
    return ForwardDesign(
        tuple(rotations),
        basis.signals,
        tuple(joint.read for joint in basis.joints),
        basis.unit_take,
        tuple(joint.used for joint in basis.joints),
        tuple(products),
        tuple(known_deg),
        limits,
    )


def _without_memory(
    known: Sequence[tuple[KnownEffect, KnownColumns]], products: BaseProducts
) -> tuple[np.ndarray, ...]:
    """For each take (N,) degrees: what those of ``known`` that have no memory add to one joint."""
    parts: list[list[np.ndarray]] = []
    first = products.own
    for each, columns in known:
        stop = first + len(columns.prior_sd)
        if not has_memory(each.effect):
            parts.append([part @ products.whole[first:stop] for part in columns.parts])
        first = stop
    return tuple(np.sum(of_take, axis=0) for of_take in zip(*parts, strict=True))


def _without(take: Signals, known: frozenset[str]) -> Signals:
    return replace(take, others={name: v for name, v in take.others.items() if name not in known})
