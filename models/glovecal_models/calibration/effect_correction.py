"""What a model's effects add to its base's prediction: for a whole take, or frame by frame."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from glovecal_models.calibration.added_effect import AddedEffect, weight_variance
from glovecal_models.calibration.correction_parts import CorrectionParts, IntervalInflation, VarianceInflation
from glovecal_models.calibration.unseen_wearing import UnseenWearing
from glovecal_models.effects.base.effect import CorrectionEffect, RepairEffect, Stream, unavailable_inputs
from glovecal_models.effects.base.facts import Uncertainty
from glovecal_models.effects.base.findings import Hold
from glovecal_models.effects.base.signals import GloveFrames, Signals
from glovecal_models.errors import BadInput, reason_of

LARGEST_CORRECTION_DEG = 360.0
"""No effect turns a joint by more than this; what is larger, or no number, is an effect gone wrong."""


def usable_correction(correction: np.ndarray) -> np.ndarray:
    """Where ``correction``, degrees of any shape, is a number that an effect may add."""
    return np.abs(correction) <= LARGEST_CORRECTION_DEG


class SignalScale:
    """Sensors in standard deviations, as effects see their neighbours; the same in training and serving."""

    def __init__(self, sensors: Sequence[str], centre: np.ndarray, scale: np.ndarray) -> None:
        self.sensors: tuple[str, ...] = tuple(sensors)
        self.centre: np.ndarray = centre
        self.scale: np.ndarray = np.maximum(scale, 1e-9)

    def others(self, readings: np.ndarray) -> dict[str, np.ndarray]:
        """Each sensor (N,), from ``readings`` (N, S) raw counts."""
        return dict(zip(self.sensors, ((readings - self.centre) / self.scale).T, strict=True))


class _Others:
    """The neighbours' signals of some frames, worked out once when an effect asks for them."""

    def __init__(self, scale: SignalScale, readings: np.ndarray) -> None:
        self._scale, self._readings = scale, readings
        self._found: dict[str, np.ndarray] | None = None

    def __call__(self) -> dict[str, np.ndarray]:
        if self._found is None:
            self._found = self._scale.others(self._readings)
        return self._found


class Correction(NamedTuple):
    """What effects say about the N frames of a take."""

    degrees: np.ndarray
    """(N, R), to be added to the base's prediction."""
    inflation: VarianceInflation | None
    """Of all N frames; None: the claims stay as they are."""


class Corrections(NamedTuple):
    """What effects say about one frame of each of G gloves."""

    degrees: np.ndarray
    """(G, R), to be added to the base's prediction; NaN where an effect raised an error."""
    undefined: np.ndarray | None
    """(G, R) True where an effect had no value and was left out; None: nowhere."""
    inflation: VarianceInflation | None
    """Of all G frames; None: the claims stay as they are."""
    problems: Mapping[int, str]
    """Errors by the number of the glove; its states are no longer those of its frames."""


class EffectCorrection:
    """All effects of one model together, for a take or for the frames of one glove."""

    def __init__(
        self,
        effects: Sequence[AddedEffect],
        rotations: Sequence[str],
        scale: SignalScale,
        noise: np.ndarray | None = None,
        unseen: UnseenWearing | None = None,
    ) -> None:
        """``rotations``: the columns of the base's prediction; ``noise`` (R,) degrees squared, claimed for
        their measurement, which effects that widen the interval build on; ``unseen`` what to add to it in a
        wearing that training did not see.

        Raises BadInput for an effect that this machine does not have, or has in another version.
        """
        self._lanes = [(item, _columns_of(item, rotations)) for item in effects if item.weights.any()]
        self._count, self._scale = len(rotations), scale
        self._effects = [_fitting(item) for item, _ in self._lanes]
        self._streams = [item.stream() for item, _ in self._lanes]
        self._unseen = None if unseen is None or not any(unseen.added_variance.values()) else unseen
        self._between = np.array(
            [unseen.added_variance.get(name, 0.0) for name in rotations] if unseen else []
        )
        self._uncertain: tuple[str, list[tuple[np.ndarray | slice, Uncertainty]]] | None = None
        """Of the wearing asked about last."""
        measured = np.zeros(len(rotations)) if noise is None else noise
        self._intervals = IntervalInflation(effects, rotations, scale.sensors, measured)
        self._holds = _holds(effects, rotations, scale.sensors)
        self._started_s: float | None = None
        self.faulty_sensors: tuple[str, ...] = ()
        """Those that fail in the last frame."""
        self.context: tuple[str, ...] = tuple(
            dict.fromkeys(name for effect in self._effects for name in effect.context)
        )
        """Context columns that the effects read."""
        self.settling_s: float = max((item.transient_s for item, _ in self._lanes), default=0.0)
        """So long after a start the state still shows that it was started anew; 0: nothing is remembered."""

    @property
    def is_empty(self) -> bool:
        return not self._lanes and not self._inflates and self._unseen is None

    @property
    def _inflates(self) -> bool:
        return bool(self._holds) or not self._intervals.is_empty

    @property
    def names(self) -> tuple[str, ...]:
        """Effects that act on poses: corrections in their order, then those of the interval, then faults."""
        correcting = tuple(item.name for item, _ in self._lanes)
        return (*correcting, *self._intervals.names, *(name for name, _ in self._holds))

    @property
    def rows(self) -> np.ndarray:
        """Indices of the rotations that are corrected."""
        corrected = np.zeros(self._count, dtype=bool)
        for _, lanes in self._lanes:
            corrected[lanes] = True
        return np.flatnonzero(corrected)

    @property
    def needing_time(self) -> tuple[str, ...]:
        """Names of the effects whose columns depend on when the frames were."""
        names = tuple(effect.name for effect in self._effects if effect.dynamics.needs_time)
        return (*names, *self._intervals.needing_time, *(name for name, _ in self._holds))

    def silent(self, context: Collection[str], wearing: str) -> tuple[str, ...]:
        """A sentence for each effect that corrects nothing for want of something it is not told.

        ``context`` are the columns whose values are known.
        """
        said = [
            (unavailable_inputs(effect, item.settings, context, wearing), effect.name)
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
        parts: CorrectionParts | None = None,
    ) -> Correction:
        """For the base's prediction ``base`` (N, R), degrees, and ``readings`` (N, S), raw counts.

        ``parts`` are told what each effect adds.
        """
        first, inflation = base, None
        if self._inflates and len(base):
            base, readings, inflation = self._inflated(time_s, base, readings, parts)
        total = base - first
        others = self._scale.others(readings) if self._lanes else {}
        unknown = self._unknown_variance(base, wearing)
        for item, lanes in self._lanes:
            take = Signals(time_s, base[:, lanes], others, context, wearing, zero_deg=item.zero_deg)
            found = item.contribution(take)
            total[:, lanes] += found.degrees
            if found.variance is not None:
                unknown = np.zeros_like(base) if unknown is None else unknown
                unknown[:, lanes] += found.variance
            if parts is not None:
                parts.corrected(item, lanes, found.degrees, found.variance, base, [wearing])
        return Correction(total, inflation if unknown is None else VarianceInflation.more(inflation, unknown))

    @staticmethod
    def of_frames(
        gloves: Sequence[EffectCorrection],
        time_s: np.ndarray,
        base: np.ndarray,
        readings: np.ndarray,
        context: Sequence[Mapping[str, float]],
        wearing: Sequence[str],
        parts: CorrectionParts | None = None,
    ) -> Corrections:
        """The next frame of each of G gloves that share a model; what each would get in a take of its own.

        ``time_s`` is (G,), ``base`` (G, R), ``readings`` (G, S); ``parts`` are told what each effect adds.
        Raises nothing.
        """
        of_all, first, inflation = gloves[0], base, None
        if of_all._inflates:
            base, readings, inflation = _inflated_frames(gloves, time_s, base, readings, parts)
        total = base - first
        if not of_all._lanes:
            return Corrections(total, None, _with_unknown(gloves, base, wearing, inflation), {})
        others = _Others(of_all._scale, readings)
        problems: dict[int, str] = {}
        undefined: np.ndarray | None = None
        for number, (item, lanes) in enumerate(of_all._lanes):
            frames = GloveFrames(time_s, base[:, lanes], others, context, wearing, item.zero_deg)
            streams = [glove._streams[number] for glove in gloves]
            columns = _columns(streams, frames, item.weights.shape, problems)
            added = np.add.reduce(columns * item.weights, axis=2)
            total[:, lanes] += added
            factor = item.variance_factor
            variance = None if factor is None else weight_variance(columns, factor)
            if variance is not None:
                inflation = inflation or VarianceInflation.none(base.shape)
                inflation.variance[:, lanes] += variance
            if parts is not None:
                parts.corrected(item, lanes, added, variance, base, wearing)
            without = [row for row, stream in enumerate(streams) if stream.undefined is not None]
            if without:
                undefined = np.zeros(base.shape, dtype=bool) if undefined is None else undefined
                for row in without:
                    undefined[row, lanes] = True
        for row in problems:
            total[row, of_all.rows] = np.nan
        inflation = _with_unknown(gloves, base, wearing, inflation)
        return Corrections(total, undefined, inflation, problems)

    def _unknown_variance(self, base: np.ndarray, wearing: str) -> np.ndarray | None:
        """(N, R), degrees squared: what is not known of the corrections of ``base`` (N, R); None: nothing."""
        if self._uncertain is None or self._uncertain[0] != wearing:
            self._uncertain = wearing, self._uncertain_in(wearing)
        if not self._uncertain[1]:
            return None
        total = np.zeros_like(base)
        for lanes, variance in self._uncertain[1]:
            total[:, lanes] += variance(base[:, lanes])
        return total

    def _uncertain_in(self, wearing: str) -> list[tuple[np.ndarray | slice, Uncertainty]]:
        of_wearings = [
            (each, item, lanes)
            for effect, (item, lanes) in zip(self._effects, self._lanes, strict=True)
            if (each := effect.weights(item.settings).of_wearings) is not None
        ]
        found = [(lanes, each.uncertainty(item.weights, wearing)) for each, item, lanes in of_wearings]
        uncertain = [(lanes, variance) for lanes, variance in found if variance is not None]
        if self._unseen is None:
            return uncertain
        if self._unseen.is_seen(wearing):
            return []
        if any(each.knows(wearing) for each, _, _ in of_wearings):
            return uncertain

        def beyond(own: np.ndarray) -> np.ndarray:
            said = np.zeros_like(own)
            for lanes, each in uncertain:
                said[:, lanes] += each(own[:, lanes])
            # Both are of the same differences between wearings: the larger counts, never their sum.
            return np.maximum(self._between - said, 0.0)

        return [*uncertain, (slice(None), beyond)]

    def _inflated(
        self, time_s: np.ndarray, base: np.ndarray, readings: np.ndarray, parts: CorrectionParts | None
    ) -> tuple[np.ndarray, np.ndarray, VarianceInflation]:
        """The take without what failing sensors read, and the variance inflation of all its frames."""
        variance = self._intervals.added_variance(time_s - time_s[0], readings, parts)
        is_faulty = np.zeros(base.shape, dtype=bool)
        for name, hold in self._holds:
            hold.reset()
            held = [hold.frame(*frame) for frame in zip(time_s.tolist(), base, readings, strict=True)]
            if parts is not None:
                parts.held(name, held, base)
            base, readings = np.stack([item.base for item in held]), np.stack([i.readings for i in held])
            variance += np.stack([item.variance for item in held])
            is_faulty |= np.stack([item.is_faulty for item in held])
        return base, readings, VarianceInflation(variance, is_faulty)

    def reset(self) -> None:
        """A new wearing, or frames were lost: effects with a memory start anew."""
        for stream in self._streams:
            stream.reset()
        self._started_s = None
        for _, hold in self._holds:
            hold.reset()


def _with_unknown(
    gloves: Sequence[EffectCorrection],
    base: np.ndarray,
    wearing: Sequence[str],
    inflation: VarianceInflation | None,
) -> VarianceInflation | None:
    """``inflation`` of one frame of each glove, with what is not known of their wearings."""
    for row, glove in enumerate(gloves):
        unknown = glove._unknown_variance(base[row : row + 1], wearing[row])
        if unknown is not None:
            inflation = inflation or VarianceInflation(np.zeros_like(base), np.zeros(base.shape, dtype=bool))
            inflation.variance[row] += unknown[0]
    return inflation


def _columns_of(item: AddedEffect, rotations: Sequence[str]) -> np.ndarray | slice:
    """Of the base's prediction; a slice, which costs less, for an effect on all of them."""
    if tuple(rotations) == item.rotations:
        return slice(None)
    return np.array([list(rotations).index(name) for name in item.rotations])


def _columns(
    streams: Sequence[Stream], frames: GloveFrames, weights: tuple[int, ...], problems: dict[int, str]
) -> np.ndarray:
    """(G, L, C) of one effect; zero for gloves where it raises, with the error in ``problems``."""
    try:
        return type(streams[0]).together(streams, frames)
    except Exception:  # an effect may be somebody else's code: one glove's error is not another's
        columns = np.zeros((len(streams), *weights))
    for row, (stream, frame) in enumerate(zip(streams, frames, strict=True)):
        try:
            columns[row] = stream.columns(frame)[0]
        except Exception as error:
            problems[row] = reason_of(error)
    return columns


def _inflated_frames(
    gloves: Sequence[EffectCorrection],
    time_s: np.ndarray,
    base: np.ndarray,
    readings: np.ndarray,
    parts: CorrectionParts | None,
) -> tuple[np.ndarray, np.ndarray, VarianceInflation]:
    """The next frames without what failing sensors read, and the variance inflation."""
    starts = []
    for glove, time in zip(gloves, time_s.tolist(), strict=True):
        if glove._started_s is None:
            glove._started_s = time
        starts.append(glove._started_s)
    inflation = VarianceInflation(
        gloves[0]._intervals.added_variance(time_s - np.array(starts), readings, parts),
        np.zeros(base.shape, dtype=bool),
    )
    if not gloves[0]._holds:
        return base, readings, inflation
    base, readings = base.copy(), readings.copy()
    for row, glove in enumerate(gloves):
        failing: list[str] = []
        for name, hold in glove._holds:
            held = hold.frame(float(time_s[row]), base[row], readings[row])
            if parts is not None:
                parts.held(name, [held], base, row)
            base[row], readings[row] = held.base, held.readings
            inflation.variance[row] += held.variance
            inflation.is_faulty[row] |= held.is_faulty
            failing += held.sensors
        glove.faulty_sensors = tuple(dict.fromkeys(failing))
    return base, readings, inflation


def _holds(
    effects: Sequence[AddedEffect], rotations: Sequence[str], sensors: Sequence[str]
) -> list[tuple[str, Hold]]:
    """What effects do to live frames, by their names; the last of each name counts."""
    found: dict[str, Hold] = {}
    for item in effects:
        effect = item.effect
        live = effect.live if isinstance(effect, RepairEffect) else None
        hold = None if live is None else live.hold(item.settings, rotations, sensors)
        if hold is not None:
            found[item.name] = hold
    return list(found.items())


def _fitting(added: AddedEffect) -> CorrectionEffect:
    """Its effect, if it still has the parameters and columns that the model learned."""
    effect = added.correction
    wanted = (len(effect.shape.parameters), len(effect.weights(added.settings).names))
    learned = (added.shape.shape[1], added.own_count)
    if learned != wanted:
        raise BadInput(
            f"effect {added.name!r} was learned with {learned[0]} parameters and {learned[1]} weights, "
            f"but here it has {wanted[0]} and {wanted[1]}; install the version it was learned with"
        )
    return effect
