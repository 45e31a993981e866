"""Whether a model can do what it is served for: predict frames of its own layout.

Whether some seconds of motion look like the hand and the glove that a model learned.

No reference is needed. Another person in the glove, or a glove of the other hand, gives angles that no hand
reaches, and bends sensors beyond all that was trained on; the right person after putting it on again does the
first by little, the second more often. Both are summed, each sensor and rotation counting for a limited part,
so that one that slipped or broke is not taken for another person.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.calibration.samples import trained_ranges
from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG

END_SHARE = 0.02
"""Of the frames beyond an end that do not count: noise and single frames."""
MOST_OF_ONE = 0.07
"""Of its range: what a single sensor or rotation counts for at most."""
READING_WEIGHT = 0.1
"""What a reading counts for beside an angle: the right person moves beyond the trained readings too."""
MISFIT_LIMIT, LINEAR_MISFIT_LIMIT = 0.068, 0.085
"""Above it the readings are not those of the model's wearer. Chosen on 8 simulated gloves (seeds 0 to 7):
in 5.3 hours of motion 3 of their 32 right wearings went above it with either method; a linear model's angles
leave the hand's range sooner. Other gloves prove it: tests/service/test_live_watch.py."""
EXCUSED_SD = 2.0
"""Standard deviations of a rotation's noise, by which angles of the right wearer leave the hand's range."""
LEARNED_SHARE = 0.75
"""Of the hand's range: nothing is said of a rotation that moved less in training, nor of its sensor.
Readings beyond a narrow training are the joint's own, and angles there are guesses: of 31 healthy simulated
gloves that had learned one motion the doctor told of wearing, supply or person on 13, the live watch on 5
(2026-11-28)."""
STEEPER = 1.5
"""Times the slope over the trained range: a sensor's curve may be so steep beyond."""
FAR_SHARE = 0.02
"""Of its range beyond an end: a sensor or rotation that is named."""
FEWEST_FAR = 3
"""With fewer it may be a sensor that slipped, and its neighbours."""
SIDEWAYS = ("IM_ABD", "MR_ABD", "RP_ABD", "W_ABD")
"""Of the other sign in a glove of the other hand (VRJuggler's driver)."""
LARGEST_DEG = 1e5
"""No linear model leaves this within its sensors' range, and a pose's float32 holds it."""


@dataclass(frozen=True)
class Misfit:
    """Of some seconds of motion."""

    total: float
    """Sum over sensors and rotations, each as a share of its range; small for the right wearer."""
    limit: float
    sensors: tuple[str, ...]
    """Those that go far beyond what was learned, the farthest first."""
    rotations: tuple[str, ...]
    """Those that reach far beyond the hand's range, likewise."""

    @property
    def is_clear(self) -> bool:
        return self.total > self.limit and len({*self.sensors, *self.rotations}) >= FEWEST_FAR

    @property
    def is_sideways(self) -> bool:
        """Mostly the sensors whose sign tells the hand."""
        across = sum(name in SIDEWAYS for name in self.sensors[: len(SIDEWAYS)])
        return across >= 2 and across * 2 >= len(self.sensors)


class WearerFit:
    """What one model learned, ready to hold frames against it."""

    def __init__(self, model: CalibrationModel, predictor: GlovePredictor) -> None:
        """``predictor`` of the same model: its rotations are the columns of the angles that will be given."""
        self.sensors, self.rotations = model.layout.sensors, tuple(predictor.rotations)
        self._limit = LINEAR_MISFIT_LIMIT if model.method == "linear" else MISFIT_LIMIT
        self.low, self.high = trained_ranges(model.rotations, self.sensors)
        self._span = np.where(self.high > self.low, self.high - self.low, np.nan)
        ranges = [ACTIVE_RANGE_DEG.get(name, (-np.inf, np.inf)) for name in self.rotations]
        least, most = np.array(ranges).reshape(-1, 2).T
        learned = self._within_training(predictor)
        first, last = self._at_ends(model, learned)
        is_seen = np.abs(last - first) >= LEARNED_SHARE * (most - least)
        self._width = np.where(is_seen, most - least, np.nan)
        self.least, self.most = self._within_reach(model, is_seen, first, last)
        """(S,) readings at the ends of what the hand can do; infinite where training did not show enough."""
        # Where training ended before the hand does, its slope may carry angles past the hand's end.
        missing = np.fmax(0.0, np.fmin(first, last) - least), np.fmax(0.0, most - np.fmax(first, last))
        below, above = (np.nan_to_num((STEEPER - 1.0) * each, posinf=0.0) for each in missing)
        self._least = np.fmin(least, learned.min(axis=0)) - below
        self._most = np.fmax(most, learned.max(axis=0)) + above
        noise = {item.rotation: item.regressor.noise_variance for item in model.rotations}
        self._excused = EXCUSED_SD * np.sqrt(
            [max(0.0, float(noise.get(name, 0.0))) for name in self.rotations]
        )

    def _at_ends(self, model: CalibrationModel, learned: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Angles (R,) at the lowest and highest trained reading of the sensor that measures each; NaN where
        none does."""
        places, count = self._measuring(model), len(self.sensors)
        rows = [(at, column) for column, at in enumerate(places) if at is not None]
        ends = np.full((2, len(places)), np.nan)
        for at, column in rows:
            ends[:, column] = learned[at, column], learned[count + at, column]
        return ends[0], ends[1]

    def _measuring(self, model: CalibrationModel) -> list[int | None]:
        """For each rotation the place of the sensor that measures it; None where the layout has none."""
        known = model.layout.rotations
        sensors = [
            model.layout.correspondence(name).measuring_sensor if name in known else None
            for name in self.rotations
        ]
        return [self.sensors.index(name) if name in self.sensors else None for name in sensors]

    def _within_reach(
        self, model: CalibrationModel, is_seen: np.ndarray, first: np.ndarray, last: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """By the slope between both ends of training, at the ends of the hand's range; never inside of what
        was trained."""
        least, most = np.full(len(self.sensors), -np.inf), np.full(len(self.sensors), np.inf)
        for column, at in enumerate(self._measuring(model)):
            name = self.rotations[column]
            if at is None or not is_seen[column] or name not in ACTIVE_RANGE_DEG:
                continue
            per_deg = (self.high[at] - self.low[at]) / (last[column] - first[column])
            reached = self.low[at] + per_deg * (np.array(ACTIVE_RANGE_DEG[name]) - first[column])
            least[at] = self.low[at] - STEEPER * max(self.low[at] - reached.min(), 0.0)
            most[at] = self.high[at] + STEEPER * max(reached.max() - self.high[at], 0.0)
        return least, most

    def _within_training(self, predictor: GlovePredictor) -> np.ndarray:
        """(2 S, R) angles with each sensor at an end of its trained range, the others in the middle.

        What these reach the right wearer reaches: with joints of more than the usual range, or by a base that
        leaves it.
        """
        middle, places = np.nan_to_num((self.low + self.high) / 2), np.arange(len(self.sensors))
        readings = np.tile(middle, (2, len(places), 1))
        readings[:, places, places] = np.where(np.isnan(self._span), middle, [self.low, self.high])
        return predictor.predict(readings.reshape(-1, len(places))).mean

    def misfit(self, readings: np.ndarray, degrees: np.ndarray) -> Misfit:
        """Of ``readings`` (N, S) and the base's ``degrees`` (N, R) of the same or other frames."""
        is_known = np.isfinite(self.least)
        bend = np.nan_to_num(np.where(is_known, _beyond(readings, self.low, self.high) / self._span, 0.0))
        over = np.fmax(0.0, _beyond(degrees, self._least, self._most) - self._excused)
        over = np.nan_to_num(over / self._width)
        total = READING_WEIGHT * np.minimum(bend, MOST_OF_ONE).sum() + np.minimum(over, MOST_OF_ONE).sum()
        return Misfit(float(total), self._limit, _far(bend, self.sensors), _far(over, self.rotations))


def _far(shares: np.ndarray, names: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(names[place] for place in np.argsort(shares)[::-1] if shares[place] > FAR_SHARE)


def _beyond(values: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """How far the ends of ``values`` (N, C) lie outside, (C,), zero inside."""
    if not len(values):
        return np.zeros(values.shape[1])
    place = int(END_SHARE * len(values))
    ordered = np.partition(values, (place, len(values) - 1 - place), axis=0)
    least, most = ordered[place], ordered[len(values) - 1 - place]
    return np.nan_to_num(np.fmax(0.0, np.fmax(low - least, most - high)))


def check_servable(model: CalibrationModel) -> None:
    """Predict frames at both ends and in the middle of every sensor's range, as for a glove that is worn.

    Raises BadInput, with the rotation where one is to blame, for a model that does not give finite angles.
    """
    try:
        with np.errstate(all="ignore"):
            predictor = GlovePredictor(model)
            fit = WearerFit(model, predictor)
            low, high = model.layout.counts or (0.0, 1.0)
            ends = np.array([np.nan_to_num(fit.low, nan=low), np.nan_to_num(fit.high, nan=high)])
            angles = predictor.predict(np.vstack([ends, ends.mean(axis=0)]))
    except BadInput:
        raise
    except (
        ArithmeticError,
        ValueError,
        LookupError,
        TypeError,
        AttributeError,
        np.linalg.LinAlgError,
    ) as error:
        raise BadInput("the model does not predict a frame of its own layout") from error
    for what, values in (("an angle", angles.mean), ("a standard deviation", angles.sd)):
        wrong = ~(np.abs(values) <= LARGEST_DEG)  # NaN too
        if wrong.any():
            row, column = np.argwhere(wrong)[0]
            raise BadInput(
                f"the model gives {predictor.rotations[column]} {what} of {values[row, column]:g} degrees; "
                f"what can be served is finite and at most {LARGEST_DEG:g}"
            )
