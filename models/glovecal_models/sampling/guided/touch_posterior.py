"""What all touches of a session tell together about the calibration of every joint that moves the tips.

Inverse kinematics of single frames cannot know whether a finger or the thumb was read
wrong, so it divides the gap between them, and repeating it with a better calibration converges slowly. But a
calibration errs in the same way in every frame: priors say how its errors go together, the touches of all
frames and fingers are conditions on them, and one Gauss-Newton search (an iterated Kalman update) finds the
likeliest calibration under which every touch of the session closes. It is equation (6) of Wang & Neff 2013
over a session instead of a frame.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from glovecal_models.errors import Cancelled
from glovecal_models.hand.skeleton import Skeleton
from glovecal_models.progress import Cancel
from glovecal_models.sampling.guided.rotation_posterior import RotationPosterior
from glovecal_models.sampling.inverse_kinematics.contact import Rod, TipChains, Touch

CONTACT_SD_MM = 0.3
"""How far tips that touch are from one point."""
STILL_DEG = 0.02
MOST_STEPS = 15
LEAST_STEP_SHARE = 0.02
"""Of a step that is tried."""


@dataclass(frozen=True)
class TouchFrames:
    """N frames of one contact; readings (N, S), without the sensors' noise."""

    contact: Touch | Rod
    readings: np.ndarray


class TouchPosterior:
    """Posteriors after the touches. ``sensors`` are the columns of all readings given to it."""

    def __init__(
        self,
        priors: Mapping[str, RotationPosterior],
        sensors: Sequence[str],
        skeleton: Skeleton | None,
        touches: Sequence[TouchFrames],
        cancelled: Cancel | None = None,
    ) -> None:
        self.priors = priors
        self._sensors = tuple(sensors)
        self._touches = [
            _Chained(each, TipChains(skeleton, each.contact.fingers), priors)
            for each in touches
            if skeleton is not None
        ]
        self._at = {name: self._frames_of(name) for name in priors}
        self._by_touch: dict[str, np.ndarray] = {}
        self._search(cancelled)

    def angles(self, rotation: str, readings: np.ndarray) -> np.ndarray:
        """(N,), degrees, at readings (N, S); a rule is followed."""
        process = self.priors[rotation]
        columns = self._columns(rotation)
        angle = process.mean(readings[:, columns])
        if rotation in self._by_touch:
            others = self._at[rotation]
            angle = angle + process.covariance(readings[:, columns], others) @ self._by_touch[rotation]
        follows = process.prior.follows
        return angle + sum(weight * self.angles(name, readings) for name, weight in follows.items())

    def variance(self, rotation: str, readings: np.ndarray) -> np.ndarray:
        """(N,), degrees squared, of the calibration's error; what a rule follows counts as independent."""
        process = self.priors[rotation]
        own = readings[:, self._columns(rotation)]
        variance = process.variance(own)
        if rotation in self._by_touch:
            towards = process.covariance(own, self._at[rotation]) @ self._slopes[rotation].T
            variance = variance - np.einsum("nm,mn->n", towards, cho_solve(self._together, towards.T))
        follows = process.prior.follows
        followed = sum(weight**2 * self.variance(name, readings) for name, weight in follows.items())
        return np.maximum(variance, 0.0) + followed

    def told(self, rotation: str, readings: np.ndarray) -> float:
        """Share of the rotation's variance at readings (N, S) that the touches remove, 0 to 1."""
        before = float(self.priors[rotation].variance(readings[:, self._columns(rotation)]).mean())
        if rotation not in self._by_touch or before == 0.0:
            return 0.0
        follows = self.priors[rotation].prior.follows
        followed = sum(w**2 * self.variance(name, readings).mean() for name, w in follows.items())
        return float(np.clip(1 - (self.variance(rotation, readings).mean() - followed) / before, 0.0, 1.0))

    def apart_mm(self, touch: TouchFrames, skeleton: Skeleton) -> np.ndarray:
        """(N,): how far tips are from where they should be with these angles."""
        chains = TipChains(skeleton, touch.contact.fingers)
        angles = np.column_stack([self.angles(name, touch.readings) for name in chains.rotations])
        tips = chains.tips_mm(angles)
        return np.array([np.linalg.norm(touch.contact.missing(each, 0)[0]) for each in tips])

    def _columns(self, rotation: str) -> list[int]:
        return [self._sensors.index(name) for name in self.priors[rotation].prior.sensors]

    def _frames_of(self, rotation: str) -> np.ndarray:
        """Inputs (N, D) of ``rotation`` in the frames of the touches it takes part in."""
        columns = self._columns(rotation)
        rows = [each.readings[:, columns] for each in self._touches if rotation in each.functions]
        return np.concatenate([np.empty((0, len(columns))), *rows])

    def _search(self, cancelled: Cancel | None) -> None:
        """Angles are prior + covariance times ``force`` (N,) of each rotation; steps that do not help are
        shortened."""
        names = [name for name, at in self._at.items() if len(at)]
        if not names:
            return
        prior = {name: self.priors[name].mean(self._at[name]) for name in names}
        covariance = {name: self.priors[name].covariance(self._at[name], self._at[name]) for name in names}
        force = {name: np.zeros(len(prior[name])) for name in names}
        found = prior
        for _ in range(MOST_STEPS):
            if cancelled is not None and cancelled():
                raise Cancelled("the touches were not worked out to the end")
            conditions = self._conditions(found)
            missing, slopes, noise = _stacked(conditions, {name: len(found[name]) for name in names})
            towards = {name: slopes[name] @ covariance[name] for name in names}
            together = noise + sum(towards[name] @ slopes[name].T for name in names)
            self._together, self._slopes = cho_factor(together), slopes
            moved = sum(slopes[name] @ (found[name] - prior[name]) for name in names)
            pull = cho_solve(self._together, missing + moved)
            wanted = {name: slopes[name].T @ pull for name in names}
            noises = [each.noise for each in conditions]
            before, share = self._cost(force, covariance, conditions, noises), 1.0
            while True:
                tried = {name: force[name] + share * (wanted[name] - force[name]) for name in names}
                after = {name: prior[name] + covariance[name] @ tried[name] for name in names}
                if share < LEAST_STEP_SHARE:
                    break
                if self._cost(tried, covariance, self._conditions(after), noises) <= before:
                    break
                share /= 2
            furthest = max(float(np.abs(after[name] - found[name]).max()) for name in names)
            force, found = tried, after
            if furthest < STILL_DEG:
                break
        self._by_touch = force

    def _conditions(self, found: Mapping[str, np.ndarray]) -> list[_Conditions]:
        """Of each contact, at angles (N,) by rotation in the order of ``_frames_of``."""
        used = dict.fromkeys(found, 0)
        conditions = []
        for each in self._touches:
            count = len(each.readings)
            rows = {name: slice(used[name], used[name] + count) for name in each.functions}
            conditions.append(each.conditions({name: found[name][rows[name]] for name in rows}, rows))
            for name in rows:
                used[name] += count
        return conditions

    def _cost(
        self,
        force: Mapping[str, np.ndarray],
        covariance: Mapping[str, np.ndarray],
        conditions: Sequence[_Conditions],
        noises: Sequence[np.ndarray],
    ) -> float:
        """Twice the negative log probability, but for constants."""
        shape = sum(float(each @ covariance[name] @ each) for name, each in force.items())
        pairs = zip(conditions, noises, strict=True)
        left = [float((c.missing * np.linalg.solve(n, c.missing[..., None])[..., 0]).sum()) for c, n in pairs]
        return shape + sum(left)


@dataclass(frozen=True)
class _Conditions:
    """Of N frames of one contact with C components."""

    missing: np.ndarray
    """(N, C), mm."""
    slopes: dict[str, np.ndarray]
    """(N, C) by rotation, mm per degree."""
    noise: np.ndarray
    """(N, C, C), mm squared."""
    rows: dict[str, slice]
    """Where each rotation has these frames."""


def _stacked(
    conditions: Sequence[_Conditions], lengths: Mapping[str, int]
) -> tuple[np.ndarray, dict[str, np.ndarray], np.ndarray]:
    """All M components: missing (M,), slopes (M, N) by rotation, noise (M, M)."""
    total = sum(each.missing.size for each in conditions)
    slopes = {name: np.zeros((total, length)) for name, length in lengths.items()}
    noise, start = np.zeros((total, total)), 0
    for each in conditions:
        size = each.missing.shape[1]
        for frame, own in enumerate(each.noise):
            block = slice(start, start + size)
            noise[block, block] = own
            for name, slope in each.slopes.items():
                slopes[name][block, each.rows[name].start + frame] = slope[frame]
            start += size
    return np.concatenate([each.missing.ravel() for each in conditions]), slopes, noise


class _Chained:
    """Frames of one contact with the chains of its tips, and the priors ("functions") that move them."""

    def __init__(
        self, touch: TouchFrames, chains: TipChains, priors: Mapping[str, RotationPosterior]
    ) -> None:
        self.contact, self.readings = touch.contact, touch.readings
        self._chains, self._priors = chains, priors
        followed = [rule for name in chains.rotations for rule in priors[name].prior.follows]
        self.functions = tuple(dict.fromkeys([*chains.rotations, *followed]))

    def conditions(self, found: Mapping[str, np.ndarray], rows: dict[str, slice]) -> _Conditions:
        angles = np.column_stack([self._angle(name, found) for name in self._chains.rotations])
        tips, slopes = self._chains.tips_and_slopes(angles)
        missing, onto = zip(*(self.contact.missing(each, i) for i, each in enumerate(tips)), strict=True)
        by_angle = np.einsum("ngcfx,nfxk->ngck", np.stack(onto), slopes)
        by_angle = by_angle.reshape(len(tips), -1, len(self._chains.rotations))
        by_function = {name: np.zeros(by_angle.shape[:2]) for name in self.functions}
        for column, name in enumerate(self._chains.rotations):
            by_function[name] += by_angle[:, :, column]
            for rule, weight in self._priors[name].prior.follows.items():
                by_function[rule] += weight * by_angle[:, :, column]
        return _Conditions(
            np.stack(missing).reshape(len(tips), -1), by_function, self._noise(by_function), rows
        )

    def _noise(self, slopes: Mapping[str, np.ndarray]) -> np.ndarray:
        """(N, C, C), mm squared: skin, and what is new in each frame of every joint."""
        size = next(iter(slopes.values())).shape[1]
        noise = np.tile(CONTACT_SD_MM**2 * np.eye(size), (len(self.readings), 1, 1))
        for name, slope in slopes.items():
            noise += self._priors[name].prior.frame_sd_deg ** 2 * slope[:, :, None] * slope[:, None, :]
        return noise

    def _angle(self, name: str, found: Mapping[str, np.ndarray]) -> np.ndarray:
        follows = self._priors[name].prior.follows
        return found[name] + sum(weight * found[rule] for rule, weight in follows.items())
