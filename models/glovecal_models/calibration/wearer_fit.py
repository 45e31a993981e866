"""Whether some seconds of motion look like the hand and the glove that a model learned.

No reference is needed. Another person in the glove, or a glove of the other hand, bends sensors beyond all
that was trained on, and gives angles that no hand reaches; the right person after putting it on again does so
by little. Both are summed, each sensor and rotation counting for a limited part, so that one that slipped or
broke is not taken for another person.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.sensor_sensitivity import trained_ranges
from glovecal_models.hand_ranges import ACTIVE_RANGE_DEG

END_SHARE = 0.02
"""Of the frames beyond an end that do not count: noise and single frames."""
MOST_OF_ONE = 0.3
"""Of its range: what a single sensor or rotation counts for at most."""
MISFIT_LIMIT, LINEAR_MISFIT_LIMIT = 0.5, 0.65
"""Above it the readings are not those of the model's wearer. Chosen on 14 simulated gloves (seeds 0 to 13):
their right wearers reached 0.46 in 3.5 hours with LMC-GPR, 0.63 with linear models, whose angles leave the
hand's range sooner. Other gloves prove it: tests/service/test_live_watch.py."""
EXCUSED_SD = 2.0
"""Standard deviations of a rotation's noise, by which angles of the right wearer leave the hand's range."""
FAR_SHARE = 0.03
"""Of its range beyond an end: a sensor that is named."""
FEWEST_SENSORS = 2
SIDEWAYS = ("IM_ABD", "MR_ABD", "RP_ABD", "W_ABD")
"""Of the other sign in a glove of the other hand (VRJuggler's driver)."""


@dataclass(frozen=True)
class Misfit:
    """Of some seconds of motion."""

    total: float
    """Sum over sensors and rotations, each as a share of its range; small for the right wearer."""
    limit: float
    sensors: tuple[str, ...]
    """Those that go far beyond what was learned, the farthest first."""

    @property
    def is_clear(self) -> bool:
        return self.total > self.limit and len(self.sensors) >= FEWEST_SENSORS

    @property
    def is_sideways(self) -> bool:
        """Mostly the sensors whose sign tells the hand."""
        across = sum(name in SIDEWAYS for name in self.sensors[: len(SIDEWAYS)])
        return across >= 2 and across * 2 >= len(self.sensors)


class WearerFit:
    """What one model learned, ready to hold frames against it."""

    def __init__(self, model: CalibrationModel, rotations: tuple[str, ...]) -> None:
        """``rotations`` are the columns of the angles that will be given."""
        self.sensors = model.layout.sensors
        self._limit = LINEAR_MISFIT_LIMIT if model.method == "linear" else MISFIT_LIMIT
        self.low, self.high = trained_ranges(model.rotations, self.sensors)
        self._span = np.where(self.high > self.low, self.high - self.low, np.nan)
        ranges = [ACTIVE_RANGE_DEG.get(name, (-np.inf, np.inf)) for name in rotations]
        self._least, self._most = np.array(ranges).reshape(-1, 2).T
        self._width = self._most - self._least
        noise = {item.rotation: item.regressor.noise_variance for item in model.rotations}
        self._excused = EXCUSED_SD * np.sqrt([max(0.0, float(noise.get(name, 0.0))) for name in rotations])

    def misfit(self, readings: np.ndarray, degrees: np.ndarray) -> Misfit:
        """Of ``readings`` (N, S) and the base's ``degrees`` (N, R) of the same or other frames."""
        bend = _beyond(readings, self.low, self.high) / self._span
        bend = np.nan_to_num(bend)
        angle = np.fmax(0.0, _beyond(degrees, self._least, self._most) - self._excused) / self._width
        total = np.minimum(bend, MOST_OF_ONE).sum() + np.minimum(np.nan_to_num(angle), MOST_OF_ONE).sum()
        order = np.argsort(bend)[::-1]
        far = tuple(self.sensors[place] for place in order if bend[place] > FAR_SHARE)
        return Misfit(float(total), self._limit, far)


def _beyond(values: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """How far the ends of ``values`` (N, C) lie outside, (C,), zero inside."""
    if not len(values):
        return np.zeros(values.shape[1])
    place = int(END_SHARE * len(values))
    ordered = np.partition(values, (place, len(values) - 1 - place), axis=0)
    least, most = ordered[place], ordered[len(values) - 1 - place]
    return np.nan_to_num(np.fmax(0.0, np.fmax(low - least, most - high)))
