"""The loop walked by itself: diagnose, add, verify, until the floor is reached or nothing more is known."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import Report, TrainingSettings
from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.comparison.residuals import residuals
from glovecal_models.comparison.rotation_noise import rotation_noise
from glovecal_models.diagnosis.diagnose import diagnose
from glovecal_models.diagnosis.diagnosis import Diagnosis
from glovecal_models.diagnosis.diagnosis_document import (
    errors_deg,
    named_sentence,
    not_judgeable_sentences,
    nothing_named_sentence,
)
from glovecal_models.diagnosis.hold_drift_document import hold_sentence
from glovecal_models.diagnosis.pose_labels import UNITS, are_pose_labels
from glovecal_models.diagnosis.signatures import are_held_levels, own_sensors
from glovecal_models.effects.catalogue import catalogue
from glovecal_models.effects.saturation import saturated_bands
from glovecal_models.effects.signature_effect import SignatureEffect
from glovecal_models.improvement.add_effect import (
    Addition,
    add_effect,
    repaired_takes,
    trained_rotations,
    wanted_of,
)
from glovecal_models.improvement.clocks import clock_settings, coarse_clock_settings
from glovecal_models.improvement.held_out_check import HeldOutErrors, held_out_errors
from glovecal_models.improvement.improvement import CLOCK, Improvement, Step, added_document
from glovecal_models.improvement.known_effects import known_effects
from glovecal_models.improvement.living_sensors import dead_sensors_sentence, without_dead_sensors
from glovecal_models.improvement.prepared_takes import PreparedTakes
from glovecal_models.improvement.remove_effect import remove_effect, unneeded
from glovecal_models.improvement.take_warnings import only_take_sentence, take_warnings
from glovecal_models.improvement.what_stays import repeats_sentence, what_stays
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take

FIRST_GAIN, LATER_GAIN = 0.05, 0.10
"""Of the held-out RMSE of the touched rotations; a second effect must earn more."""
AT_FLOOR = 1.15
MOST_UNDONE = 2
"""After so many that did not help the walk ends."""


def improve(
    takes: Sequence[Take],
    layout: Layout,
    subject: str,
    settings: TrainingSettings | None = None,
    *,
    holdout: Sequence[Take] = (),
    max_steps: int = 6,
    seed: int = 0,
    take_hashes: Sequence[str] = (),
    cancelled: Callable[[], bool] | None = None,
    report: Report | None = None,
) -> Improvement:
    """Train, then add what the diagnosis names while it pays. Raises NotTrainable, BadInput, Cancelled.

    Errors are on ``holdout`` when given, else on takes left out of each fit.
    """
    settings = settings or TrainingSettings()
    walk = _Walk(
        takes, layout, subject, settings, tuple(holdout), seed, tuple(take_hashes), cancelled, report
    )
    walk.start()
    while len(walk.steps) <= max_steps and walk.go_on():
        pass
    return walk.finished()


class _Walk:
    """The state of one walk."""

    def __init__(
        self,
        takes: Sequence[Take],
        layout: Layout,
        subject: str,
        settings: TrainingSettings,
        holdout: tuple[Take, ...],
        seed: int,
        hashes: tuple[str, ...],
        cancelled: Callable[[], bool] | None,
        report: Report | None,
    ) -> None:
        self.takes, self.subject, self.settings = list(takes), subject, settings
        self.layout, dead = without_dead_sensors(layout, takes)
        self.holdout, self.seed, self.hashes = holdout, seed, hashes
        self.cancelled, self.report = cancelled, report
        self.steps: list[Step] = []
        self.undone: list[Addition] = []
        alone = only_take_sentence(self.takes)
        self.sentences = [
            *take_warnings(self.takes),
            *([dead_sensors_sentence(dead)] if dead else ()),
            *([alone] if alone and not holdout else ()),
        ]
        self.stopped = "nothing_named"
        self.diagnosis: Diagnosis | None = None
        self.floors: dict[str, NoiseFloor] = {}
        self.errors = HeldOutErrors({}, {})
        self.clocks_scanned = False

    def start(self) -> None:
        """The base model, its error and its floor."""
        self._say("training the base", 0.02)
        model = train(
            self.takes, self.layout, self.subject, replace(self.settings, folds=0),
            take_hashes=self.hashes, cancelled=self.cancelled,
        )  # fmt: skip
        self._say("measuring the base on takes left out", 0.1)
        self.errors = self._held_out(model)
        self._step(model, None)
        found = residuals(model, self.takes)
        noise = rotation_noise(found, seed=self.seed)
        self.floors = {name: item.floor for name, item in noise.items() if item.floor is not None}

    def go_on(self) -> bool:
        """One round; False when the walk is over."""
        model = self.steps[-1].model
        share = 0.15 + 0.12 * len(self.steps)
        if CLOCK not in {item.name for item in wanted_of(model)}:
            clocks = self._coarse_clocks()
            if clocks is not None and self._add(CLOCK, None, clocks, None):
                return True
        if self._add_repairs():
            return True
        self._say("looking for what is missing", share)
        takes = repaired_takes(self.takes, wanted_of(model))
        floors = {name: floor.floor_deg for name, floor in self.floors.items()}
        self.diagnosis = diagnose(
            takes, self.layout, linear=self.settings.method in ("raw", "linear"), known=known_effects(model),
            noise_floor_deg=floors, seed=self.seed, cancelled=self.cancelled,
        )  # fmt: skip
        tried = {item.effect for item in self.undone}
        for item in self.diagnosis.naming.ranked:
            if item.effect in tried:
                continue
            where = [item.joints[i] for i in item.touched]
            clock = None
            if item.effect == CLOCK:
                clock = clock_settings([take.name for take in self.takes], item.shapes[0])
            if self._add(item.effect, where, clock, self.diagnosis):
                return True
            self.stopped = "not_better"
            tried.add(item.effect)
            if len(tried) > MOST_UNDONE:
                return False
        if tried:
            return self._add_saturation()
        self.stopped = "noise_floor" if self._is_at_floor() else "nothing_named"
        return self._add_saturation()

    def finished(self) -> Improvement:
        """Sum up."""
        if self.stopped != "noise_floor" and self._is_at_floor():
            self.stopped = "noise_floor"
        last = next((s.added for s in reversed(self.steps) if s.added is not None), None)
        if self.stopped != "noise_floor" and last is not None and last["verdict"] == "ambiguous":
            self.stopped = "ambiguous"
        if (
            self.stopped == "nothing_named"
            and self.diagnosis
            and len(self.diagnosis.naming.confidence_set) > 1
        ):
            self.stopped = "ambiguous"
        if self.diagnosis is not None:
            self.sentences[:0] = self.diagnosis.reference_problems
            held = self.diagnosis.hold_drift
            if held is not None:
                self.sentences += [hold_sentence(held), UNITS]
                self.stopped = "ambiguous" if len(held.confidence_set) > 1 else "nothing_named"
            self.sentences += [item.sentence for item in self.diagnosis.findings]
            if held is None and not self.diagnosis.findings and not self.diagnosis.naming.ranked:
                self.sentences.append(nothing_named_sentence(self.diagnosis))
            self.sentences += not_judgeable_sentences(self.diagnosis.not_judgeable)
            self.sentences.append(self.diagnosis.left.sentence)
            if held is None:
                self.sentences += self._what_stays()
        self._say("done", 1.0)
        return Improvement(
            tuple(self.steps), self.floors, self.stopped, self.diagnosis, tuple(self.undone),
            self._baselines(), tuple(self.sentences),
        )  # fmt: skip

    def _what_stays(self) -> list[str]:
        repeats = repeats_sentence(self.floors)
        stays = what_stays(self.steps[-1].per_rotation, self.floors)
        return [stays] if repeats is None else [repeats, stays]

    def _add(
        self, name: str, where: list[str] | None, clock: dict[str, Any] | None, diagnosis: Diagnosis | None
    ) -> bool:
        model = self.steps[-1].model
        every = trained_rotations(model)
        chosen = every if where is None or name == CLOCK else [item for item in where if item in every]
        concerned = set((clock or {}).get("where", chosen))
        judged = [item for item in chosen if item in concerned]
        self._say(f"adding {name}", 0.2 + 0.12 * len(self.steps))
        added_before = sum(1 for step in self.steps if step.added is not None)
        addition = add_effect(
            model, self.takes, name, rotations=chosen, constants=clock, settings=self.settings,
            before=self._of(chosen), judged=judged, least_gain=LATER_GAIN if added_before else FIRST_GAIN,
            take_hashes=self.hashes, cancelled=self.cancelled,
        )  # fmt: skip
        self.sentences.append(addition.sentence)
        if not addition.added:
            self.undone.append(addition)
            return False
        self.errors = self.errors.with_those_of(addition.after)
        model = self._pruned(addition)
        self._step(model, added_document(addition, clock, diagnosis), diagnosis)
        return True

    def _pruned(self, addition: Addition) -> CalibrationModel:
        """Without earlier effects that the new one makes needless; an alias may have been added first."""
        model = addition.model
        for earlier in addition.wanted:
            if earlier.name == addition.effect or not earlier.has_columns:
                continue
            without = unneeded(
                model, self.takes, earlier.name, self._of(earlier.rotations), self.settings, self.cancelled
            )
            if without is not None:
                self._say(f"taking {earlier.name} out again", 0.5)
                self.errors = self.errors.with_those_of(without)
                self.sentences.append(f"{earlier.name} is not needed any more beside {addition.effect}.")
                model = remove_effect(
                    model, self.takes, earlier.name, settings=self.settings, take_hashes=self.hashes,
                    cancelled=self.cancelled,
                )  # fmt: skip
        return model

    def _coarse_clocks(self) -> dict[str, Any] | None:
        """Looked for once: the scan takes its time."""
        if self.clocks_scanned:
            return None
        self.clocks_scanned = True
        if are_pose_labels(self.takes):
            return None
        return coarse_clock_settings(self.takes)

    def _add_repairs(self) -> bool:
        """Repeated frames and faulty sensors first: they look like lag, or like anything."""
        model = self.steps[-1].model
        has = {item.name for item in wanted_of(model)} | {item.effect for item in self.undone}
        takes = repaired_takes(self.takes, wanted_of(model))
        sensor_of = own_sensors(self.layout, trained_rotations(model))
        if not sensor_of or are_held_levels(takes) or are_pose_labels(takes):
            return False
        for name in ("repeated_samples", "sensor_fault"):
            effect = catalogue()[name]
            if name in has or not isinstance(effect, SignatureEffect):
                continue
            found = effect.find(takes, sensor_of)
            if found:
                self.sentences += [item.sentence for item in found]
                if self._add(name, None, {"where": sorted({w for item in found for w in item.where})}, None):
                    return True
        return False

    def _add_saturation(self) -> bool:
        model = self.steps[-1].model
        sensor_of = own_sensors(self.layout, trained_rotations(model))
        if "saturation" in {item.name for item in wanted_of(model)} or not sensor_of:
            return False
        if are_pose_labels(self.takes):
            return False
        bands = saturated_bands(repaired_takes(self.takes, wanted_of(model)), sensor_of)
        if not bands:
            return False
        where = list(dict.fromkeys(band.rotation for band in bands))
        return self._add("saturation", where, {"bands": [band.to_settings() for band in bands]}, None)

    def _of(self, rotations: Sequence[str]) -> HeldOutErrors:
        return HeldOutErrors(
            {name: self.errors.square[name] for name in rotations},
            {name: self.errors.count[name] for name in rotations},
        )

    def _held_out(self, model: CalibrationModel) -> HeldOutErrors:
        prepared = PreparedTakes.of(self.takes, self.layout)
        return held_out_errors(
            prepared, trained_rotations(model), [], self.settings, cancelled=self.cancelled
        )

    def _step(
        self, model: CalibrationModel, added: dict[str, Any] | None, diagnosis: Diagnosis | None = None
    ) -> None:
        per_rotation, over_all = self._errors(model)
        decoy = None
        if diagnosis is not None and diagnosis.naming.ranked:
            assessed = {item.effect: item for item in diagnosis.naming.ranked}
            first = diagnosis.naming.ranked[0]
            before, _, with_decoy = errors_deg(assessed.get((added or {}).get("effect", ""), first))
            decoy = self.steps[-1].rmse_deg * min(with_decoy / max(before, 1e-12), 1.0)
            if added is not None and added["effect"] == first.effect:
                self.sentences.append(named_sentence(diagnosis))
        self.steps.append(Step(model, added, over_all, per_rotation, decoy))

    def _errors(self, model: CalibrationModel) -> tuple[dict[str, float], float]:
        """On the holdout when there is one, else on takes left out."""
        if not self.holdout:
            return {name: self.errors.rmse_deg(name) for name in self.errors.square}, self.errors.over_all_deg
        found = residuals(model, self.holdout)
        error = found.stacked("error")
        each = {
            name: float(np.sqrt(np.nanmean(error[:, found.column(name)] ** 2)))
            for name in found.measured_rotations
        }
        return each, float(np.sqrt(np.nanmean(error**2)))

    def _is_at_floor(self) -> bool:
        if self.diagnosis is not None and self.diagnosis.reference_problems:
            return False  # errors against a wrong reference, and its floor, mean nothing
        last = self.steps[-1].per_rotation
        floors = [(last[name], floor) for name, floor in self.floors.items() if name in last]
        return bool(floors) and all(
            not floor.is_lower_bound and error <= AT_FLOOR * floor.high_deg for error, floor in floors
        )

    def _baselines(self) -> dict[str, float]:
        found: dict[str, float] = {}
        for method in ("raw", "linear"):
            if method == self.settings.method:
                continue
            settings = TrainingSettings(method=method, folds=self.settings.folds)  # pyright: ignore[reportArgumentType]
            if self.holdout:
                plain = TrainingSettings(method=method, folds=0)  # pyright: ignore[reportArgumentType]
                model = train(self.takes, self.layout, self.subject, plain)
                found[method] = float(
                    np.sqrt(np.nanmean(residuals(model, self.holdout).stacked("error") ** 2))
                )
            else:
                prepared = PreparedTakes.of(self.takes, self.layout)
                names = trained_rotations(self.steps[0].model)
                found[method] = held_out_errors(prepared, names, [], settings).over_all_deg
        return found

    def _say(self, text: str, share: float) -> None:
        if self.report:
            self.report(text, min(share, 1.0))
