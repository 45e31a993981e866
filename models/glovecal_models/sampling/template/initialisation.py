"""Scales and offsets of all equations at once, by least squares from a few hand shapes (section 3.3.4).

Each shape says what its name tells of the angles, weighted by how surely. An "o" says more: thumb and finger
are in one place, and by the hand's kinematics that is a condition on all joints of both. So no animator has
to set the joints of a touch. The conditions bend with the angles, so the least squares are repeated about
what was found (Gauss-Newton with damping, by scipy).

The equations of a template as one linear map: from its scales and offsets to the angles of a hand.

Readings are counted from the middle of each sensor's range in shares of it, so that a scale is the rotation's
angle over that range, in degrees.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import pinvh

from glovecal_models.calibration.template import PALM_SHARE, PINKY, THUMB
from glovecal_models.errors import NotTrainable
from glovecal_models.hand.rotations import FLAT_PALM_DEG, PALM, REST_DEG, RULES
from glovecal_models.hand.skeleton import Skeleton
from glovecal_models.quick_check.held_poses import REPEAT_SD_DEG
from glovecal_models.sampling.inverse_kinematics.contact import TipChains
from glovecal_models.sampling.shown_hands import Observation

LINES_CONTACT_SD_MM = 3.0
"""How far tips that touch are from one point, by a calibration of lines."""
WIDE_DEG = 300.0
"""How far scale and offset may be from 0: data decide them."""
PALM_TO_THUMB_DEG = 12.0
"""How far the palm may turn the thumb aside over its range: three numbers of equation (5) are more than five
shapes tell. In the paper's Figure 1 this scale is a quarter of the thumb's own, which is 50 degrees here."""


@dataclass(frozen=True)
class TemplateEquations:
    """Of ``rotations`` that each follow the sensor of their name, over readings of ``sensors``."""

    rotations: tuple[str, ...]
    sensors: tuple[str, ...]
    middle: np.ndarray
    """(S,), counts."""
    span: np.ndarray
    """(S,), counts."""

    @property
    def parameters(self) -> tuple[tuple[str, str], ...]:
        """(rotation, sensor or "" for its offset) of each."""
        own = [(name, part) for name in self.rotations for part in (name, "")]
        gain = [(THUMB, PALM)] if self.has_palm and THUMB in self.rotations else []
        return (*own, *gain)

    @property
    def has_palm(self) -> bool:
        return PALM in self.rotations

    def rows(self, rotation: str, readings: np.ndarray) -> tuple[np.ndarray, float]:
        """Angles (N,) are rows (N, P) @ parameters (P,) + a constant, degrees; ``readings`` (N, S).

        A rotation without an equation follows its rule, else rests.
        """
        rows, constant = np.zeros((len(readings), len(self.parameters))), 0.0
        if rotation in self.rotations:
            for column, (name, part) in enumerate(self.parameters):
                if name == rotation:
                    rows[:, column] = self._share(part, readings)
            if rotation == PINKY and self.has_palm:
                rows += PALM_SHARE * self.rows(PALM, readings)[0]
        elif rotation in RULES:
            for name, weight in RULES[rotation].items():
                more, also = self.rows(name, readings)
                rows, constant = rows + weight * more, constant + weight * also
        else:
            constant = FLAT_PALM_DEG if rotation == PALM else REST_DEG[rotation]
        return rows, constant

    def angles(self, rotation: str, readings: np.ndarray, found: np.ndarray) -> np.ndarray:
        """(N,), degrees, with parameters ``found`` (P,)."""
        rows, constant = self.rows(rotation, readings)
        return rows @ found + constant

    def _share(self, sensor: str, readings: np.ndarray) -> np.ndarray:
        if not sensor:
            return np.ones(len(readings))
        column = self.sensors.index(sensor)
        return (readings[:, column] - self.middle[column]) / self.span[column]


def equations_for(
    sensors: Sequence[str], readings: np.ndarray, angles: Mapping[str, Sequence[float]], palm: bool
) -> TemplateEquations:
    """Of rotations whose sensor moves in ``readings`` (N, S) and that are known at two ``angles`` or more."""
    low, high = readings.min(axis=0), readings.max(axis=0)
    told = tuple(
        name
        for name, known in angles.items()
        if name in sensors
        and np.ptp(known) > 0
        and high[list(sensors).index(name)] > low[list(sensors).index(name)]
    )
    chosen = tuple(name for name in told if palm or name != PALM)
    return TemplateEquations(chosen, tuple(sensors), (low + high) / 2, np.maximum(high - low, 1.0))


@dataclass(frozen=True)
class Initialisation:
    equations: TemplateEquations
    found: np.ndarray
    """(P,), in the order of the equations' parameters."""
    covariance: np.ndarray
    """(P, P), of ``found``, if the shapes are as sure as they are said to be."""
    noise_deg: dict[str, float]
    """By rotation: how far shapes are from their equation (RMS), at least as far as a pose varies."""
    contact_mm: dict[str, float]
    """By pose: distance of the tips that is left (median of its frames)."""

    def angles(self, rotation: str, readings: np.ndarray) -> np.ndarray:
        """(N,), degrees, at raw counts (N, S)."""
        return self.equations.angles(rotation, readings, self.found)

    def variance(self, rotation: str, readings: np.ndarray) -> np.ndarray:
        """(N,), degrees squared: of the equation, and of what shapes differ from it by."""
        rows, _ = self.equations.rows(rotation, readings)
        return np.einsum("np,pq,nq->n", rows, self.covariance, rows) + self.noise_deg[rotation] ** 2


def initialised(
    seen: Sequence[Observation], sensors: Sequence[str], skeleton: Skeleton, *, palm: bool = True
) -> Initialisation:
    """The template of what was ``seen``. Without ``palm`` every rotation follows its own sensor alone.

    Raises NotTrainable where no rotation was shown at two angles.
    """
    angles: dict[str, list[float]] = {}
    for each in seen:
        for name, known in each.known.items():
            angles.setdefault(name, []).append(known.degrees)
    readings = np.concatenate([np.empty((0, len(sensors))), *(each.readings for each in seen)])
    equations = equations_for(sensors, readings, angles, palm) if len(readings) else None
    if equations is None or not equations.rotations:
        raise NotTrainable(
            f"{len(seen)} hand shapes tell no rotation at two angles: take the shapes flat, spread and fist, "
            "and thumb and index, thumb and little finger together"
        )
    parts = [_known(equations, seen), _wide(equations)]
    rows, target = (np.concatenate(each) for each in zip(*parts, strict=True))
    touching = [TouchConditions.of(each, equations, skeleton) for each in seen if each.contact is not None]
    found, slopes = _least_squares(rows, target, touching)
    return Initialisation(
        equations,
        found,
        np.asarray(pinvh(slopes.T @ slopes)),
        {name: _noise(name, equations, seen, found) for name in equations.rotations},
        {each.pose: each.left_mm(found) for each in touching},
    )


def _known(equations: TemplateEquations, seen: Sequence[Observation]) -> tuple[np.ndarray, np.ndarray]:
    rows, target = [np.empty((0, len(equations.parameters)))], [np.empty(0)]
    for each in seen:
        for name, known in each.known.items():
            if name in equations.rotations:
                own, constant = equations.rows(name, each.readings)
                sd = known.sd_deg * np.sqrt(len(own))
                rows.append(own / sd)
                target.append(np.full(len(own), (known.degrees - constant) / sd))
    return np.concatenate(rows), np.concatenate(target)


def _wide(equations: TemplateEquations) -> tuple[np.ndarray, np.ndarray]:
    wide = [PALM_TO_THUMB_DEG if each == (THUMB, PALM) else WIDE_DEG for each in equations.parameters]
    return np.diag(1 / np.array(wide)), np.zeros(len(wide))


@dataclass(frozen=True)
class TouchConditions:
    """Frames of one contact."""

    pose: str
    chains: TipChains
    observation: Observation
    rows: np.ndarray
    """(N, K, P): angles of the chains are rows @ parameters + constants."""
    constants: np.ndarray
    """(K,)."""

    @classmethod
    def of(cls, each: Observation, equations: TemplateEquations, skeleton: Skeleton) -> TouchConditions:
        assert each.contact is not None
        chains = TipChains(skeleton, each.contact.fingers)
        rows, constants = zip(
            *(equations.rows(name, each.readings) for name in chains.rotations), strict=True
        )
        return cls(each.pose, chains, each, np.stack(rows, axis=1), np.array(constants))

    def missing(self, found: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What is left between the tips (M,), and its slopes (M, P), in standard deviations."""
        contact = self.observation.contact
        assert contact is not None
        tips, slopes = self.chains.tips_and_slopes(self.rows @ found + self.constants)
        left, onto = zip(*(contact.missing(each, frame) for frame, each in enumerate(tips)), strict=True)
        by_angle = np.einsum("ngcfx,nfxk->ngck", np.stack(onto), slopes).reshape(
            len(tips), -1, self.rows.shape[1]
        )
        by_parameter = -(by_angle @ self.rows).reshape(-1, len(found))
        return np.stack(left).ravel() / LINES_CONTACT_SD_MM, by_parameter / LINES_CONTACT_SD_MM

    def left_mm(self, found: np.ndarray) -> float:
        left = self.missing(found)[0].reshape(len(self.rows), -1)
        return float(np.median(np.linalg.norm(left, axis=1)) * LINES_CONTACT_SD_MM)


def _least_squares(
    rows: np.ndarray, target: np.ndarray, touching: Sequence[TouchConditions]
) -> tuple[np.ndarray, np.ndarray]:
    """Parameters (P,) and the slopes there (M, P)."""
    from scipy.optimize import least_squares  # slow to load, and needed here only

    def residuals(found: np.ndarray) -> np.ndarray:
        return np.concatenate([rows @ found - target, *(each.missing(found)[0] for each in touching)])

    def slopes(found: np.ndarray) -> np.ndarray:
        return np.concatenate([rows, *(each.missing(found)[1] for each in touching)])

    start = np.linalg.lstsq(rows, target)[0]
    if not touching:
        return start, rows
    found = least_squares(residuals, start, jac=slopes, method="lm").x  # pyright: ignore[reportArgumentType]
    return found, slopes(found)


def _noise(
    rotation: str, equations: TemplateEquations, seen: Sequence[Observation], found: np.ndarray
) -> float:
    off = [np.empty(0)]
    for each in seen:
        if rotation in each.known and each.contact is None:
            off.append(equations.angles(rotation, each.readings, found) - each.known[rotation].degrees)
    left = np.concatenate(off)
    return max(float(np.sqrt(np.mean(left**2))) if len(left) else 0.0, REPEAT_SD_DEG)
