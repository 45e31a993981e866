"""What one angle is made of: the base's value and what each effect adds, each with its standard deviation.

The terms are written down by the prediction that is served, so they add up to its angle. Rules are linear:
the terms of a rotation by rule are those of the rotations that it follows, weighted alike.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.calibration.answer import (
    AngleTerms,
    Explanation,
    FrameExplanation,
    Measured,
    Repair,
    Term,
    TermKind,
)
from glovecal_models.calibration.correction_parts import CorrectionParts
from glovecal_models.calibration.effect_correction import EffectCorrection, usable_correction
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.predictor import GloveAngles, GlovePredictor
from glovecal_models.calibration.samples import require_layout
from glovecal_models.effects.base.dynamics import LONGEST_GAP_S
from glovecal_models.effects.base.effect import RepairEffect, has_memory
from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean
from glovecal_models.takes.take import Take

BASE, NOISE = "base", "measurement noise"
OUTSIDE_S = 0.05
"""A time this little before or after a take is a rounded one."""
ORDER: tuple[TermKind, ...] = ("base", "held", "correction", "noise", "interval")


@dataclass(frozen=True)
class PredictedFrame:
    """One frame as it was predicted; base and angles have one row."""

    time_s: float
    readings: np.ndarray
    """(S,), raw, in the order of the model's sensors."""
    base: GloveAngles
    """The regressors alone."""
    angles: GloveAngles
    """With the effects, as served."""
    correction: np.ndarray
    """(1, R), degrees: the sum of what ``parts`` hold."""
    parts: CorrectionParts
    """Its last row is this frame."""
    since_start_s: float
    """How long ago effects with a memory began anew."""
    settling_s: float
    """How long they take; 0: nothing is remembered."""
    silent: Sequence[str]
    """As ``EffectCorrection.silent`` says."""


class FrameExplainer:
    """Explains the frames of one glove one after another, as live poses are predicted."""

    def __init__(self, model: CalibrationModel) -> None:
        """Raises BadInput for an effect that this machine does not have."""
        self._model, self._predictor = model, GlovePredictor(model)
        self._stream = self._predictor.stream()
        self._began_s = self._last_s = -np.inf

    def frame(
        self, time_s: float, readings: np.ndarray, context: Mapping[str, float], wearing: str
    ) -> FrameExplanation:
        """The next frame; ``readings`` (S,), raw, in the order of the model's sensors. Raises BadInput."""
        if not 0.0 <= time_s - self._last_s <= LONGEST_GAP_S:
            self._began_s = time_s
        self._last_s = time_s
        base = self._predictor.predict(readings[None])
        parts = CorrectionParts(1, len(self._predictor.rotations))
        found = EffectCorrection.of_frames(
            [self._stream], np.array([time_s]), base.mean, readings[None], [context], [wearing], parts
        )
        angles = self._predictor.corrected(base, found.degrees, found.undefined, found.inflation)
        known = [name for name, value in context.items() if np.isfinite(value)]
        frame = PredictedFrame(
            time_s, readings, base, angles, found.degrees, parts, time_s - self._began_s,
            self._stream.settling_s, self._stream.silent(known, wearing),
        )  # fmt: skip
        return explained(self._model, self._predictor, frame)

    def reset(self) -> None:
        """A new run or wearing."""
        self._stream.reset()
        self._began_s = self._last_s = -np.inf


def explain(model: CalibrationModel, take: Take, at_s: float, rotations: Sequence[str] = ()) -> Explanation:
    """The frame of ``take`` nearest to ``at_s``, seconds of the take's own clock.

    ``rotations``: only these; none named: all of the model. Effects with a memory start at the take's first
    frame, as in ``GlovePredictor.predict_take``. Raises BadInput for a time outside the take and for a
    rotation that the model does not have, LayoutMismatch.
    """
    require_layout(take, model.layout)
    chosen = chosen_rotations(model, rotations)
    first, last = float(take.time_s[0]), float(take.time_s[-1])
    if not first - OUTSIDE_S <= at_s <= last + OUTSIDE_S:
        raise BadInput(f"take {take.name!r} lasts from {first:.3f} to {last:.3f} s; there is no {at_s:g} s")
    number = int(np.argmin(np.abs(take.time_s - at_s)))
    columns = [take.sensors.index(name) for name in model.layout.sensors]
    # What comes later changes nothing: prediction is causal.
    until = slice(0, number + 1)
    time_s, readings = take.time_s[until], take.readings[until][:, columns]
    context = {name: column[until] for name, column in take.context.items()}
    predictor = GlovePredictor(model)
    effects = predictor.stream()
    base = predictor.predict(readings)
    parts = CorrectionParts(len(time_s), len(predictor.rotations))
    found = effects.of_take(time_s, base.mean, readings, context, take.wearing, parts)
    angles = predictor.corrected(base, found.degrees, inflation=found.inflation)
    gaps = np.flatnonzero(np.diff(time_s) > LONGEST_GAP_S)
    began_s = float(time_s[gaps[-1] + 1]) if len(gaps) else first
    known = [name for name, column in context.items() if np.isfinite(column[-1])]
    last = PredictedFrame(
        float(time_s[-1]), readings[-1], base.row(-1), angles.row(-1), found.degrees[-1:], parts,
        float(time_s[-1]) - began_s, effects.settling_s, effects.silent(known, take.wearing),
    )  # fmt: skip
    frame = explained(model, predictor, last)
    measured = _measured(model, take, number, predictor)
    frame = replace(
        frame, rotations=[item.with_measured(measured.get(item.rotation)) for item in frame.rotations]
    )
    return Explanation(
        **frame.facts(chosen), name=take.name, wearing=take.wearing, simulated=take.simulated, frame=number
    )


def chosen_rotations(model: CalibrationModel, wanted: Sequence[str]) -> tuple[str, ...]:
    """``wanted`` in the model's order, all where none is named. Raises BadInput for one it does not have."""
    there = model.rotation_names
    unknown = [name for name in wanted if name not in there]
    if unknown:
        raise BadInput(f"no rotation {unknown[0]!r} in this model; {did_you_mean(unknown[0], there)}")
    return tuple(name for name in there if name in wanted) if wanted else there


def explained(model: CalibrationModel, predictor: GlovePredictor, frame: PredictedFrame) -> FrameExplanation:
    """What the angles of a frame that was predicted already are made of; ``predictor`` is the model's.

    Safe beside a prediction in another thread: it only reads what was written down.
    """
    base, angles, parts = frame.base, frame.angles, frame.parts
    usable = usable_correction(frame.correction[0])
    noise = np.array([item.regressor.noise_variance for item in model.rotations])
    every = np.ones(len(noise), dtype=bool)
    sure = np.maximum(base.sd[0] ** 2 - noise, 0.0)
    rows = [
        _Row(BASE, "base", base.mean[0].copy(), sure, sure.copy(), every.copy()),
        _Row(NOISE, "noise", 0.0 * noise, noise.copy(), noise.copy(), every.copy()),
    ]
    for part in parts.found:
        degrees = np.where(usable, part.degrees[-1], 0.0)
        rows.append(
            _Row(
                part.name,
                part.kind,
                degrees,
                part.variance[-1].copy(),
                part.claimed[-1],
                part.acts[-1].copy(),
            )
        )
    for target, sources, weights in predictor.rules:
        for row in rows:
            row.follow_rule(target, sources, weights)
    rows.sort(key=lambda row: ORDER.index(row.kind))
    names = predictor.rotations
    by_rule = {target: tuple(names[at] for at in sources) for target, sources, _ in predictor.rules}
    of_sensor = dict(zip(model.layout.sensors, frame.readings.tolist(), strict=True))
    found = tuple(
        AngleTerms(
            rotation=item.rotation,
            degrees=float(angles.mean[0, at]),
            sd_deg=float(angles.sd[0, at]),
            flags=int(angles.flags[0, at]),
            terms=tuple(row.term(at) for row in rows if row.acts[at]),
            sources=by_rule.get(at, ()),
            readings={} if at in by_rule else {name: of_sensor[name] for name in item.correspondence.sensors},
            is_corrected=bool(usable[at]),
        )
        for at, item in enumerate(model.rotations)
    )
    remembering = [item.name for item in model.effects if has_memory(item.effect) and item.weights.any()]
    return FrameExplanation(
        time_s=frame.time_s,
        rotations=found,
        faulty_sensors=parts.faulty_sensors[-1],
        transient_s=frame.since_start_s if frame.since_start_s < frame.settling_s else None,
        settling_s=frame.settling_s,
        remembering=tuple(dict.fromkeys(remembering)),
        silent=tuple(frame.silent),
    )


@dataclass
class _Row:
    """One term of all R rotations, each array (R,)."""

    name: str
    kind: TermKind
    degrees: np.ndarray
    variance: np.ndarray
    claimed: np.ndarray
    acts: np.ndarray

    def follow_rule(self, target: int, sources: np.ndarray, weights: np.ndarray) -> None:
        self.acts[target] = self.acts[sources].any()
        self.degrees[target] = self.degrees[sources] @ weights
        used = sources[self.acts[sources]]
        share = weights[self.acts[sources]] ** 2
        self.variance[target] = self.variance[used] @ share
        self.claimed[target] = self.claimed[used] @ share

    def term(self, at: int) -> Term:
        variance = float(self.variance[at])
        stored = None if np.isnan(variance) else variance
        return Term(
            self.name,
            self.kind,
            float(self.degrees[at]),
            stored,
            is_claimed=stored is not None and bool(np.isclose(self.claimed[at], variance)),
        )


def _measured(
    model: CalibrationModel, take: Take, number: int, predictor: GlovePredictor
) -> dict[str, Measured]:
    """What was measured at the frame ``number``, with the repairs that a comparison makes, in its order."""
    names = predictor.rotations
    recorded = take.reference_at_frames(names)[number]
    if not np.isfinite(recorded).any():
        return {}
    at_s, before = float(take.time_s[number]), recorded
    repairs: list[tuple[str, np.ndarray]] = []
    effects = [
        (known, item.settings) for item in model.effects if isinstance(known := item.effect, RepairEffect)
    ]
    for needs_prediction in (False, True):
        for effect, settings in effects:
            by_prediction = effect.by_prediction
            if (by_prediction is not None) != needs_prediction:
                continue
            if by_prediction is not None:
                columns = [take.sensors.index(name) for name in model.layout.sensors]
                readings = take.readings[:, columns]
                predicted = predictor.predict_take(take.time_s, readings, take.context, take.wearing).mean
                take = by_prediction.repaired_to(take, settings, names, predicted)
            else:
                take = effect.repaired([take], settings)[0]
            kept = np.flatnonzero(take.time_s == at_s)
            after = take.reference_at_frames(names)[kept[0]] if len(kept) else np.full(len(names), np.nan)
            repairs.append((effect.name, after - before))
            before = after
    return {
        name: Measured(
            float(recorded[at]),
            tuple(Repair(effect, _number(change[at])) for effect, change in repairs),
            _number(before[at]),
        )
        for at, name in enumerate(names)
        if np.isfinite(recorded[at])
    }


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
