"""An animation of an FBX file: a stack of one layer, and curves that give properties of its models.

Turns are Euler angles, unrolled, so that between two key frames a bone does not turn the long way round.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import IO, Any

import numpy as np

from glovecal_service.exports.character import NAME
from glovecal_service.exports.fbx_records import Compressed, Records, Value
from glovecal_service.exports.hand_motion import HandMotion

TICKS_PER_S = 46_186_158_000
CONSTANT, LINEAR = 2, 4
"""What a curve does between key frames."""
TURN = "Lcl Rotation"


@dataclass(frozen=True)
class Animated:
    """One property of one model."""

    model: np.int64
    property: str
    axes: tuple[str, ...]
    """Of the property, one a curve."""
    curves: np.ndarray
    """(A, N) float32."""
    interpolation: int = LINEAR
    ticks: np.ndarray | None = None
    """(N,) where not those of all."""


@dataclass(frozen=True)
class Animation:
    first: np.int64
    """Of the ids that it takes."""
    time_s: np.ndarray
    """(N,) since the first frame."""
    animated: Sequence[Animated]
    notes: Mapping[str, Any]
    """What it was made of and how."""

    @property
    def counts(self) -> Mapping[str, int]:
        """Objects by kind."""
        curves = sum(len(one.axes) for one in self.animated)
        return {
            "AnimationStack": 1, "AnimationLayer": 1, "AnimationCurveNode": len(self.animated),
            "AnimationCurve": curves,
        }  # fmt: skip

    @cached_property
    def _ticks(self) -> np.ndarray:
        return ticks_of(self.time_s)

    def declared(self, model: int | np.int64) -> list[tuple[str | Value, ...]]:
        """Rows for the properties of a model that it has not of itself."""
        own = (one for one in self.animated if one.model == model and one.property != TURN)
        return [_user_property(one) for one in own]

    def write_objects(self, records: Records) -> None:
        with records.object("AnimationStack", self.first, NAME):
            ends = {"Start": np.int64(0), "Stop": self._ticks[-1]}
            rows = [(f"{span}{end}", at) for span in ("Local", "Reference") for end, at in ends.items()]
            notes = ("glovecal", "KString", "", "U", json.dumps(self.notes))
            records.properties(*((name, "KTime", "Time", "", at) for name, at in rows), notes)
        with records.object("AnimationLayer", self._layer, NAME):
            pass
        shared = Compressed.of(self._ticks)
        for one, node in self._properties():
            name = one.property if one.property != TURN else "R"
            firsts = [float(curve[0]) for curve in one.curves]
            with records.object("AnimationCurveNode", node, name):
                rows = [
                    (f"d|{axis}", "Number", "", "A", at) for axis, at in zip(one.axes, firsts, strict=True)
                ]
                records.properties(*rows)
            times = shared if one.ticks is None else Compressed.of(one.ticks)
            for number, curve in enumerate(one.curves, 1):
                _write_curve(records, node + np.int64(number), times, curve, one.interpolation)

    def write_connections(self, records: Records) -> None:
        records.connect(self._layer, self.first)
        for one, node in self._properties():
            records.connect(node, self._layer)
            records.connect(node, one.model, one.property)
            for number, axis in enumerate(one.axes, 1):
                records.connect(node + np.int64(number), node, f"d|{axis}")

    def write_take(self, records: Records) -> None:
        """Where old readers look how long it is."""
        with records.record("Take", NAME):
            records.leaf("FileName", "Glovecal_take.tak")
            for span in ("LocalTime", "ReferenceTime"):
                records.leaf(span, np.int64(0), self._ticks[-1])

    @property
    def _layer(self) -> np.int64:
        return self.first + np.int64(1)

    def _properties(self) -> Iterator[tuple[Animated, np.int64]]:
        """With the id of each one's node; its curves follow."""
        id = self.first + np.int64(2)
        for one in self.animated:
            yield one, id
            id += np.int64(1 + len(one.axes))


def channels_of(hand: np.int64, motion: HandMotion) -> Iterator[Animated]:
    """Standard deviations and flags as properties of the hand's bone."""
    ticks = ticks_of(motion.time_s - motion.time_s[0])
    for channel in motion.channels:
        for rotation, values in zip(motion.rotations, channel.numbers.T.astype("<f4"), strict=True):
            key = f"{channel.key}.{rotation}"
            if channel.is_held:
                changes = np.flatnonzero(np.diff(values, prepend=np.nan))
                yield Animated(hand, key, (key,), values[None, changes], CONSTANT, ticks[changes])
            else:
                yield Animated(hand, key, (key,), values[None])


def _user_property(one: Animated) -> tuple[str | Value, ...]:
    first = float(one.curves[0, 0])
    if one.interpolation == CONSTANT:
        return one.property, "int", "Integer", "A+U", int(first)
    return one.property, "double", "Number", "A+U", first


def ticks_of(time_s: np.ndarray) -> np.ndarray:
    return np.round(time_s * TICKS_PER_S).astype(np.int64)


def _write_curve(records: Records, id: np.int64, times: Compressed, curve: np.ndarray, between: int) -> None:
    with records.object("AnimationCurve", id, ""):
        records.leaf("Default", float(curve[0]))
        records.leaf("KeyVer", 4008)
        records.leaf("KeyTime", times)
        records.leaf("KeyValueFloat", np.ascontiguousarray(curve, "<f4"))
        records.leaf("KeyAttrFlags", np.array([between], "<i4"))
        records.leaf("KeyAttrDataFloat", np.zeros(4, "<f4"))
        records.leaf("KeyAttrRefCount", np.array([times.count], "<i4"))


def euler_curves(
    turns: Iterable[tuple[slice, np.ndarray]], count: int, orders: Sequence[str], scratch: IO[bytes]
) -> np.ndarray:
    """(B, 3, N) degrees of turns (n, B, 3, 3) that come block by block, in a file: by frame as they come, by
    curve as they are written. ``orders``: of each bone, as scipy names them, angles by X, Y and Z."""
    shape = (len(orders), 3, count)
    scratch.truncate(max(4 * int(np.prod(shape)), 1))
    curves = np.memmap(scratch, "<f4", shape=shape)
    last = np.zeros((1, len(orders), 3))
    alike = {order: [at for at, own in enumerate(orders) if own == order] for order in set(orders)}
    for which, block in turns:
        angles = np.empty(block.shape[:3])
        for order, own in alike.items():
            degrees = euler_degrees(block[:, own].reshape(-1, 3, 3), order)
            angles[:, own] = degrees.reshape(-1, len(own), 3)
        unrolled = np.unwrap(np.concatenate([last, angles]), axis=0, period=360.0)
        last = unrolled[-1:]
        curves[:, :, which] = unrolled[1:].transpose(1, 2, 0)
    return curves


def euler_degrees(turns: np.ndarray, order: str) -> np.ndarray:
    """(n, 3) by X, Y and Z of turns (n, 3, 3); ``order``: as scipy names it."""
    from scipy.spatial.transform import Rotation  # slow to load, and every command that exports loads this

    angles = Rotation.from_matrix(turns).as_euler(order, degrees=True)
    return angles[:, [order.index(axis) for axis in "xyz"]]
