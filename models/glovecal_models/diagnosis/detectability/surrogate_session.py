"""The user's own session without its effects: perfect readings, noise as it was measured.

Measured angles, frames, context and wearings stay. Each sensor reads what the static map (and effects that
the model has already) makes of the measured angles, and the residuals of that fit are added again: of another
take and from another moment, so that an effect hidden in them does not follow the movement any more.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.diagnosis.forward_design import ForwardDesign
from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS, DiagnosisLimits
from glovecal_models.diagnosis.model_on_takes import ModelOnTakes
from glovecal_models.diagnosis.problem import DiagnosisProblem
from glovecal_models.diagnosis.signatures import are_pose_labels
from glovecal_models.errors import BadInput
from glovecal_models.takes.take import Take

AS_RECORDED, EVERY_ROW = 1, 1
"""Neither smoothed nor thinned."""
DEAD_CORRELATION = 1e-3
"""Between a sensor and its angle: below it a degree is any number of counts."""


@dataclass(frozen=True)
class OwnSensor:
    """The one sensor that the diagnosis reads for a rotation."""

    name: str
    deg_per_count: float


@dataclass(frozen=True)
class SurrogateSession:
    """A fitted session, to make takes of."""

    on: ModelOnTakes
    limits: DiagnosisLimits
    problem: DiagnosisProblem
    design: ForwardDesign
    """Every measured row as it was recorded."""
    sensors: Mapping[str, OwnSensor]
    """By rotation; only those with a sensor of their own can be rewritten."""
    residual: tuple[np.ndarray, ...]
    """For each take (N, R), degrees: sensor minus fitted map, NaN where not measured."""

    @classmethod
    def of(
        cls,
        on: ModelOnTakes,
        limits: DiagnosisLimits = DIAGNOSIS_LIMITS,
    ) -> SurrogateSession:
        """Raises BadInput when no angle was measured."""
        if are_pose_labels(on.takes):
            raise BadInput("the reference only names poses (0 or 1): without angles no effect can be put in")
        problem = DiagnosisProblem.of(on.takes, on.layout, on.linear, on.known, limits)
        design = problem.design(AS_RECORDED, EVERY_ROW)
        residual = tuple(np.full(take.own.shape, np.nan) for take in design.signals)
        for joint, products in enumerate(design.products):
            for (take, rows), unit in zip(design.units(joint), products.units, strict=True):
                residual[take][rows, joint] = unit.target - products.fitted(unit.base)
        sensors = _own_sensors(problem, design)
        return cls(on, limits, problem, design, sensors, residual)

    @property
    def rotations(self) -> tuple[str, ...]:
        return self.design.rotations

    def joint(self, rotation: str) -> int:
        """Raises BadInput for a rotation that was not measured, or that has no sensor of its own."""
        if rotation not in self.rotations:
            raise BadInput(f"no take measured {rotation!r}; measured are {', '.join(self.rotations)}")
        if rotation not in self.sensors:
            raise BadInput(
                f"{rotation} has no working sensor of its own: an effect cannot be put into one sensor"
            )
        return self.rotations.index(rotation)

    def unexplained(self, joint: int, added: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Of what is ``added`` (N,) to a sensor in each take: what no static map explains, NaN where not
        measured."""
        units = self.design.products[joint].units
        base = np.concatenate([unit.base for unit in units])
        rows = np.concatenate(self.design.rows(joint, added))
        weights = np.linalg.lstsq(base, rows, rcond=None)[0]
        left = [np.full(len(part), np.nan) for part in added]
        for (take, index), unit in zip(self.design.units(joint), units, strict=True):
            left[take][index] = added[take][index] - unit.base @ weights
        return left

    def noise(self, generator: np.random.Generator) -> tuple[np.ndarray, ...]:
        """The residuals of all takes for another session with the same movement: like ``residual``.

        Whole takes are permuted; each is played forwards and backwards in turn, which has no jump, from a
        random moment on. Joints stay together, so what they share is shared still.
        """
        order = generator.permutation(len(self.residual))
        moments = generator.uniform(0.1, 0.9, len(order))
        found = []
        for number, place in enumerate(self.residual):
            columns = [
                _replayed(self._series(int(order[number]), number, joint), len(place), moments[number])
                for joint in range(place.shape[1])
            ]
            found.append(np.where(np.isfinite(place), np.column_stack(columns), np.nan))
        return tuple(found)

    def takes(
        self,
        added: Mapping[str, Sequence[np.ndarray]],
        noise: Sequence[np.ndarray] | None = None,
        delays_s: Sequence[float] | None = None,
    ) -> tuple[Take, ...]:
        """The session with effects put in.

        ``added``: by rotation, for each take (N,) degrees at the even times of ``design``; ``noise``: as
        ``residual``, None for none at all; ``delays_s``: how late the readings of each take are.
        """
        found = []
        for number, (take, even) in enumerate(zip(self.on.takes, self.problem.even, strict=True)):
            readings = np.array(take.readings, dtype=float)
            for rotation, sensor in self.sensors.items():
                joint = self.rotations.index(rotation)
                change = -self.residual[number][:, joint]
                if noise is not None:
                    change = change + noise[number][:, joint]
                if rotation in added:
                    change = change + added[rotation][number]
                known = np.isfinite(change)
                if known.any():
                    counts = np.interp(take.time_s, even.time_s[known], change[known]) / sensor.deg_per_count
                    readings[:, take.sensors.index(sensor.name)] += counts
            late = 0.0 if delays_s is None else delays_s[number]
            found.append(replace(take, readings=readings, reference_time_s=take.reference_time_s - late))
        return tuple(found)

    def _series(self, giver: int, taker: int, joint: int) -> np.ndarray:
        """The residual of the take that gives it, else the taker's own where that measured nothing."""
        for take in (giver, taker):
            series = self.residual[take][:, joint]
            known = series[np.isfinite(series)]
            if len(known):
                return known
        return np.zeros(1)


def _replayed(series: np.ndarray, length: int, moment: float) -> np.ndarray:
    both = np.concatenate([series, series[::-1]])
    return both[(int(moment * len(both)) + np.arange(length)) % len(both)]


def _own_sensors(problem: DiagnosisProblem, design: ForwardDesign) -> dict[str, OwnSensor]:
    """A sensor that two rotations read is rewritten for the first of them."""
    found: dict[str, OwnSensor] = {}
    for joint, rotation in enumerate(design.rotations):
        item = problem.layout.correspondence(rotation)
        name = item.measuring_sensor
        if name is None or item.inputs[0] != name or name in {other.name for other in found.values()}:
            continue
        column = problem.layout.sensors.index(name)
        counts = np.concatenate(design.rows(joint, [take.readings[:, column] for take in problem.even]))
        degrees = np.concatenate([unit.target for unit in design.products[joint].units])
        angles = np.concatenate(design.rows(joint, [take.own[:, joint] for take in design.signals]))
        if counts.std() > 0 and angles.std() > 0 and degrees.std() > DEAD_CORRELATION * angles.std():
            slope = np.cov(degrees, counts)[0, 1] / np.var(counts, ddof=1)
            found[rotation] = OwnSensor(name, float(slope))
    return found
