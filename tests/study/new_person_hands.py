"""Simulated hands beside the ankles of ``new_person.py``: each by the seven others, two wearings each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from glovecal_models.calibration.people_prior import PeoplePlane, own_takes, people_prior
from glovecal_models.regression.linear_regressor import LinearRegressor, fit_linear
from glovecal_models.simulation.protocol import Segment, Unrest, free_motion
from glovecal_models.simulation.simulated_glove import SimulatedGlove, simulate_take
from glovecal_models.takes.take import Take

HANDS, WEARINGS, SECONDS, RATE_HZ = range(600, 608), 2, 20.0, 20
FIRST, NEXT = "wearing-0", "wearing-1"
POSE_FRAMES = 6
HALF_95 = 1.959964
Pairs = list[tuple[np.ndarray, np.ndarray]]
Errors = dict[tuple[str, str], list[tuple[float, float]]]
"""By amount and how: mean square of the error, and the share that the 95 % interval holds."""


def takes_of(hand: int) -> list[Take]:
    """Two of free motion in each wearing."""
    takes = []
    for wearing in range(WEARINGS):
        glove = SimulatedGlove(hand, wearing=wearing)
        for number in range(2):
            random = np.random.default_rng([hand, wearing, number])
            segment = Segment("free", free_motion(SECONDS, random), Unrest(random))
            take = simulate_take(
                glove, segment, seed=100 * hand + 10 * wearing + number, rate_hz=RATE_HZ
            ).take
            takes.append(replace(take, wearing=f"wearing-{wearing}"))
    return takes


def asked(hands: Sequence[int] = HANDS) -> Errors:
    """In the second wearing of each hand: its second take, after parts of its first."""
    takes, errors = {str(hand): takes_of(hand) for hand in hands}, Errors()
    layout = SimulatedGlove(hands[0]).layout
    for hand, own in takes.items():
        prior = people_prior({name: each for name, each in takes.items() if name != hand}, layout)
        for plane in prior.planes:
            pairs = own_takes(own, plane)
            known = plane.of_person({FIRST: pairs[FIRST]})
            shown, left = pairs[NEXT]
            for amount, given in _amounts(*shown).items():
                mine = {NEXT: given} if given else {}
                for how, prior_plane in (("new person", plane), ("known person", known)):
                    errors.setdefault((amount, how), []).append(_error(prior_plane.regressor(mine), *left))
                if given:
                    errors.setdefault((amount, "alone"), []).append(_error(_alone(given, plane), *left))
    return errors


def _amounts(inputs: np.ndarray, target: np.ndarray) -> dict[str, Pairs]:
    count = len(target)
    poses = [slice(at, at + POSE_FRAMES) for at in (count // 6, count // 2, 5 * count // 6)]
    return {
        "none": [],
        "3 poses": [(inputs[rows], target[rows]) for rows in poses],
        "10 s": [(inputs[: count // 2], target[: count // 2])],
        "20 s": [(inputs, target)],
    }


def _alone(given: Pairs, plane: PeoplePlane) -> LinearRegressor:
    inputs, target = (np.concatenate(part) for part in zip(*given, strict=True))
    return fit_linear(inputs, target, sensor_names=plane.sensors)


def _error(regressor: LinearRegressor, inputs: np.ndarray, target: np.ndarray) -> tuple[float, float]:
    predicted = regressor.predict(inputs)
    error = predicted.mean - target
    inside = np.abs(error) < HALF_95 * np.sqrt(predicted.variance + regressor.noise_variance)
    return float(np.mean(error**2)), float(inside.mean())


def table(errors: Errors) -> str:
    """Degrees over all rotations and hands, and what their 95 % intervals hold."""
    hows = ("alone", "new person", "known person")
    lines = ["| own data | " + " | ".join(hows) + " |", "|---" * 4 + "|"]
    for amount in dict.fromkeys(amount for amount, _ in errors):
        cells = []
        for how in hows:
            square, inside = np.mean(errors.get((amount, how), [(np.nan, np.nan)]), axis=0)
            cells.append("" if np.isnan(square) else f"{np.sqrt(square):.1f} ({100 * inside:.0f} %)")
        lines.append(f"| {amount} | " + " | ".join(cells) + " |")
    return "\n".join(lines)
