"""Where a model of an FBX file stands: by its own properties, and by what it hangs on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from glovecal_service.exports.character import LARGEST, axes_of
from glovecal_service.exports.fbx_animation import TURN

ORDERS = ("xyz", "xzy", "yzx", "yxz", "zxy", "zyx")
"""Of angles about fixed axes, by FBX's number; a seventh that it has is the first."""
VECTORS = ("Lcl Translation", TURN, "Lcl Scaling", "PreRotation", "PostRotation", "RotationOffset",
           "RotationPivot", "ScalingOffset", "ScalingPivot")  # fmt: skip
NUMBERS = ("RotationOrder", "RotationActive", "RotationSpaceForLimitOnly", "InheritType")
BY_AXIS, NOT_ITS_PARENTS = 0, 2
"""How a model takes on sizes: axis by axis, or all but its parent's own; else as matrices do."""


@dataclass(frozen=True)
class Model:
    id: int
    name: str
    properties: Mapping[str, tuple[float, ...]]
    """Of ``VECTORS`` and ``NUMBERS`` those that are given."""

    @cached_property
    def order(self) -> str:
        number = self._number("RotationOrder", 0)
        return ORDERS[number] if 0 <= number < len(ORDERS) else ORDERS[0]

    @cached_property
    def before(self) -> np.ndarray:
        """(3, 3) the turn that stands before the animated one."""
        return self._turn("PreRotation", ORDERS[0]) if self._has_own_axes else np.eye(3)

    @cached_property
    def after(self) -> np.ndarray:
        """(3, 3) the turn whose inverse stands after the animated one."""
        return self._turn("PostRotation", ORDERS[0]) if self._has_own_axes else np.eye(3)

    @cached_property
    def turn(self) -> np.ndarray:
        """(3, 3) of all three."""
        return self.before @ self._turn(TURN, self.order) @ self.after.T

    @cached_property
    def size(self) -> np.ndarray:
        return self._vector("Lcl Scaling", 1.0)

    @cached_property
    def shift(self) -> np.ndarray:
        """(3,) of T Roff Rp Rpre R Rpost^-1 Rp^-1 Soff Sp S Sp^-1."""
        pivot, size_pivot = self._vector("RotationPivot", 0.0), self._vector("ScalingPivot", 0.0)
        inner = self._vector("ScalingOffset", 0.0) + size_pivot - pivot - self.size * size_pivot
        outer = self._vector("Lcl Translation", 0.0) + self._vector("RotationOffset", 0.0) + pivot
        return outer + self.turn @ inner

    @property
    def inherits(self) -> int:
        return self._number("InheritType", 1)

    @property
    def _has_own_axes(self) -> bool:
        return bool(self._number("RotationActive", 1)) and not self._number("RotationSpaceForLimitOnly", 0)

    def _number(self, name: str, otherwise: int) -> int:
        return int(self.properties.get(name, (otherwise,))[0])

    def _vector(self, name: str, otherwise: float) -> np.ndarray:
        return np.array(self.properties.get(name, (otherwise,) * 3))

    def _turn(self, name: str, order: str) -> np.ndarray:
        # slow to load, and every command that exports loads this
        from scipy.spatial.transform import Rotation

        angles = self._vector(name, 0.0)[["xyz".index(axis) for axis in order]]
        return Rotation.from_euler(order, angles, degrees=True).as_matrix()


@dataclass(frozen=True)
class Placed:
    """A model in the world."""

    world: np.ndarray
    """(4, 4)"""
    unsized: np.ndarray
    """(4, 4) without its own size."""
    size: np.ndarray
    """(3,) with those that it takes on axis by axis."""
    taken_on: np.ndarray
    """(3,) of these its parents'."""

    @classmethod
    def origin(cls) -> Placed:
        return cls(np.eye(4), np.eye(4), np.ones(3), np.ones(3))

    def below(self, model: Model) -> Placed:
        """One that hangs on this. Raises ValueError for a place that cannot be."""
        if model.inherits not in (BY_AXIS, NOT_ITS_PARENTS):
            unsized = self.world @ _matrix(model.turn, model.shift)
            size, taken_on = model.size, np.ones(3)
        else:
            unsized = self.unsized @ _matrix(model.turn, model.shift * self.size)
            taken_on = self.size if model.inherits == BY_AXIS else self.taken_on
            size = model.size * taken_on
        world = unsized @ _matrix(np.diag(size), np.zeros(3))
        if not (np.abs(world) < LARGEST).all():
            raise ValueError("no place")
        return Placed(world, unsized, size, taken_on)

    def at(self, against: np.ndarray) -> Placed:
        """One whose matrix (4, 4) against this is known. Raises ValueError for one without a turn or size."""
        axes_of(against)
        world = self.world @ against
        axes_of(world)
        size = np.linalg.norm(world[:3, :3], axis=0)
        return Placed(world, world @ _matrix(np.diag(1 / size), np.zeros(3)), size, np.ones(3))


def _matrix(linear: np.ndarray, shift: np.ndarray) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = linear, shift
    return matrix
