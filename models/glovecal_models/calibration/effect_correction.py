"""What a model's effects add to its base's prediction: for a whole take, or frame by frame."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from glovecal_models.calibration.added_effect import AddedEffect
from glovecal_models.effects.effect import Effect, Signals, Uncertainty
from glovecal_models.errors import BadInput

LARGEST_CORRECTION_DEG = 360.0
"""No effect turns a joint by more than this; what is larger, or no number, is an effect gone wrong."""


def usable_correction(correction: np.ndarray) -> np.ndarray:
    """Where ``correction``, degrees of any shape, is a number that an effect may add."""
    return np.abs(correction) <= LARGEST_CORRECTION_DEG


class SignalScale:
    """Sensors in standard deviations, as effects see their neighbours; the same in training and serving."""

    def __init__(self, sensors: Sequence[str], centre: np.ndarray, scale: np.ndarray) -> None:
        self.sensors, self.centre, self.scale = tuple(sensors), centre, np.maximum(scale, 1e-9)

    def others(self, readings: np.ndarray) -> dict[str, np.ndarray]:
        """Each sensor (N,), from ``readings`` (N, S) raw counts."""
        return dict(zip(self.sensors, ((readings - self.centre) / self.scale).T, strict=True))


class EffectCorrection:
    """All effects of one model together."""

    def __init__(self, effects: Sequence[AddedEffect], rotations: Sequence[str], scale: SignalScale) -> None:
        """``rotations``: the columns of the base's prediction.

        Raises BadInput for an effect that this machine does not have, or has in another version.
        """
        self._lanes = [
            (item, np.array([list(rotations).index(name) for name in item.rotations]))
            for item in effects
            if item.weights.any()
        ]
        self._scale = scale
        self._effects = [_fitting(item) for item, _ in self._lanes]
        self._streams = [
            effect.stream(item.settings, item.shape)
            for effect, (item, _) in zip(self._effects, self._lanes, strict=True)
        ]
        self._uncertain: tuple[str, list[tuple[np.ndarray, Uncertainty]]] | None = None
        """Of the wearing asked about last."""
        self.undefined: np.ndarray | None = None
        """(R,) True for rotations that some effect could not correct in the last frame; None: no such."""
        self.context = tuple(dict.fromkeys(name for effect in self._effects for name in effect.context))
        """Context columns that the effects read."""
        self.settling_s = max(
            (
                effect.settling_s(item.shape[item.weights.any(axis=1)])
                for effect, (item, _) in zip(self._effects, self._lanes, strict=True)
            ),
            default=0.0,
        )
        """So long after a start the state still shows that it was started anew; 0: nothing is remembered."""

    @property
    def is_empty(self) -> bool:
        return not self._lanes

    @property
    def names(self) -> tuple[str, ...]:
        """Effects that correct something, in their order."""
        return tuple(item.name for item, _ in self._lanes)

    @property
    def rows(self) -> np.ndarray:
        """Indices of the rotations that are corrected."""
        return (
            np.unique(np.concatenate([lanes for _, lanes in self._lanes]))
            if self._lanes
            else np.empty(0, int)
        )

    @property
    def needing_time(self) -> tuple[str, ...]:
        """Names of the effects whose columns depend on when the frames were."""
        return tuple(effect.name for effect in self._effects if effect.needs_time)

    def silent(self, context: Collection[str], wearing: str) -> tuple[str, ...]:
        """A sentence for each effect that corrects nothing for want of something it is not told.

        ``context`` are the columns whose values are known.
        """
        said = [
            (effect.lacks(item.settings, context, wearing), effect.name)
            for effect, (item, _) in zip(self._effects, self._lanes, strict=True)
        ]
        return tuple(f"{lacking}: {name} is not corrected" for lacking, name in said if lacking)

    def of_take(
        self,
        time_s: np.ndarray,
        base: np.ndarray,
        readings: np.ndarray,
        context: Mapping[str, np.ndarray],
        wearing: str,
    ) -> np.ndarray:
        """(N, R) degrees to add to ``base`` (N, R); ``readings`` (N, S) raw counts."""
        total = np.zeros_like(base)
        others = self._scale.others(readings) if self._lanes else {}
        for item, lanes in self._lanes:
            take = Signals(time_s, base[:, lanes], others, context, wearing, zero_deg=item.zero_deg)
            columns = item.effect.columns(take, item.settings, item.shape)
            total[:, lanes] += np.einsum("nlc,lc->nl", columns, item.weights)
        return total

    def of_frame(
        self,
        time_s: float,
        base: np.ndarray,
        readings: np.ndarray,
        context: Mapping[str, float],
        wearing: str,
    ) -> np.ndarray:
        """(R,) degrees to add to ``base`` (R,), the next frame of a stream; the same as in a take."""
        total, self.undefined = np.zeros_like(base), None
        if not self._lanes:
            return total
        others = self._scale.others(readings[None, :])
        time = np.array([time_s])
        now = {name: np.array([value]) for name, value in context.items()}
        for (item, lanes), stream in zip(self._lanes, self._streams, strict=True):
            frame = Signals(time, base[None, lanes], others, now, wearing, zero_deg=item.zero_deg)
            total[lanes] += np.einsum("lc,lc->l", stream.columns(frame)[0], item.weights)
            if stream.undefined is not None:
                if self.undefined is None:
                    self.undefined = np.zeros(len(base), dtype=bool)
                self.undefined[lanes] = True
        return total

    def variance(self, base: np.ndarray, wearing: str) -> np.ndarray | None:
        """(N, R), degrees squared: what is not known of the corrections of ``base`` (N, R); None: nothing."""
        if self._uncertain is None or self._uncertain[0] != wearing:
            self._uncertain = wearing, self._uncertain_in(wearing)
        if not self._uncertain[1]:
            return None
        total = np.zeros_like(base)
        for lanes, variance in self._uncertain[1]:
            total[:, lanes] += variance(base[:, lanes])
        return total

    def _uncertain_in(self, wearing: str) -> list[tuple[np.ndarray, Uncertainty]]:
        found = [
            (lanes, effect.uncertainty(item.settings, item.weights, wearing))
            for effect, (item, lanes) in zip(self._effects, self._lanes, strict=True)
        ]
        return [(lanes, variance) for lanes, variance in found if variance is not None]

    def reset(self) -> None:
        """A new wearing, or frames were lost: effects with a memory start anew."""
        for stream in self._streams:
            stream.reset()


def _fitting(added: AddedEffect) -> Effect:
    """Its effect, if it still has the parameters and columns that the model learned."""
    effect = added.effect
    wanted = (len(effect.parameters), len(effect.weight_names(added.settings)))
    learned = (added.shape.shape[1], added.weights.shape[1])
    if learned != wanted:
        raise BadInput(
            f"effect {added.name!r} was learned with {learned[0]} parameters and {learned[1]} weights, "
            f"but here it has {wanted[0]} and {wanted[1]}; install the version it was learned with"
        )
    return effect
