"""What an effect is: a named physical cause that changes readings, and what each kind of effect answers.

A *correction* adds columns to a calibration: functions of the joint's own signal, of other signals and of the
context, in degrees. Their weights are linear and learned in closed form; what they do not depend on linearly
(a time constant, a width) is the effect's *shape*, tried on a grid. The same columns serve in both
directions: of the measured angle they distort a sensor (forward: simulation, diagnosis), of the predicted
angle they correct it (inverse: training, serving), because the inverse of a play, a low pass or a gain is of
its own family to first order. Lanes are joints (and, while a shape is searched, joints times shapes):
everything works on all lanes at once.

Effects known by a *signature* in the recording have no columns. A saturated sensor or a padded recording has
lost information; no column of any calibration brings it back. What helps is to say where (a *finding*), to
mend the measurement (a *repair*), or to claim less (a *wider interval*).

All are stateless: settings and shape are handed in, so that a model can store them. What only some effects
have is one optional member, which answers for itself.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from glovecal_models.effects.base.comparison import EffectComparison
from glovecal_models.effects.base.facts import About, Kind, Shape, Weights
from glovecal_models.effects.base.findings import (
    ClaimedErrors,
    Finding,
    Hold,
    Interval,
    LiveCheck,
    Proposal,
    Recorded,
)
from glovecal_models.effects.base.signals import GloveFrames, Settings, Signals
from glovecal_models.progress import Cancel
from glovecal_models.takes.take import Take


class Stream(ABC):
    """An effect's state between frames of one glove."""

    undefined: str | None = None
    """Why the last frame's columns had no value and are zero; None when they had one."""

    @abstractmethod
    def columns(self, frame: Signals) -> np.ndarray:
        """(1, L, C) for the next frame, given as signals of length 1."""

    @abstractmethod
    def reset(self) -> None:
        """Forget: a new wearing, or frames were missing."""

    @classmethod
    def together(cls, streams: Sequence[Any], frames: GloveFrames) -> np.ndarray:
        """(G, L, C): ``columns`` of each of G gloves' streams, of this class and of one model.

        To be overridden where one call for all is quicker; what raises must then leave every state as it was.
        """
        return np.concatenate([stream.columns(frame) for stream, frame in zip(streams, frames, strict=True)])


class Dynamics(ABC):
    """What an effect answers of time."""

    has_memory: bool = False
    """Whether its columns depend on earlier frames."""

    @property
    def needs_time(self) -> bool:
        """Whether its columns depend on when the frames were: it remembers, or it reads the time itself."""
        return self.has_memory

    @abstractmethod
    def stream(self, settings: Settings, shape: np.ndarray) -> Stream:
        """The effect's columns, frame by frame."""

    @abstractmethod
    def columns_of_takes(
        self, takes: Sequence[Signals], settings: Settings, shape: np.ndarray
    ) -> list[np.ndarray]:
        """The effect's columns of each take; all takes together may be quicker than one after another."""

    def transient_s(self, shape: np.ndarray, settings: Settings) -> float:
        """How long a state started anew still shows, seconds, for lanes of ``shape`` (L, P); 0 without a
        memory."""
        return 0.0

    def unsettled(self, take: Signals, settings: Settings, shape: np.ndarray) -> np.ndarray | None:
        """(N, L) where what came before a start still shows; None: nothing of the joint's motion is
        remembered."""
        return None

    def drawn_weights(self, prior_sd: np.ndarray, generator: np.random.Generator) -> np.ndarray:
        """(C,) weights with which it may distort a sensor, as its columns of the measured angle; of any size:
        whoever puts the effect into a session scales them."""
        return prior_sd * generator.standard_normal(len(prior_sd))


class Late(Dynamics):
    """A reading comes late by it, so that its columns lead; a recording is led by its smoothed motion instead
    (``calibration.offline``)."""


class Effect(ABC):
    """What every effect says of itself."""

    name: str
    about: About
    context: tuple[str, ...] = ()
    """Context columns it needs, all of them."""
    shape: Shape = Shape()
    comparison: EffectComparison | None = None
    """How it is held against others on held-out takes; None: it is not."""


class FurtherColumns:
    """Columns of a calibration beyond those by which the effect is named; by default none."""

    def constants(self, effect: CorrectionEffect, takes: Sequence[Signals]) -> Settings:
        """Constants where the effect is learned."""
        return effect.fit_constants(takes)

    def choices(self, takes: Sequence[Signals], settings: Settings) -> Sequence[Settings]:
        """Settings with more columns, of which a calibration takes those that its takes ask for, or none."""
        return ()

    def with_found(self, settings: Settings, stored: Settings) -> Settings:
        """``settings`` of other takes with those of ``stored`` that were searched in all takes; not to be
        searched again in fewer."""
        return settings

    def as_stored(self, takes: Sequence[Signals], settings: Settings, stored: Settings) -> Settings:
        """``settings`` of other lanes with the further columns that a model with ``stored`` took."""
        return settings

    def described(self, names: Sequence[str], settings: Settings, weights: np.ndarray) -> dict[str, float]:
        """``weights`` (C,) of one lane, of these ``names``, in numbers that tell a reader something."""
        return dict(zip(names, map(float, weights), strict=True))


class FormSignals(dict[str, np.ndarray]):
    """The signals (N, L) that a learned form may be a function of, by name (``learned_form``)."""

    def __init__(
        self, signals: Mapping[str, np.ndarray] | None = None, unit: str = "", take_sd_deg: float = 0.0
    ) -> None:
        """``unit``: of those signals, all alike; "" where they have none, or are context columns of any unit.
        ``take_sd_deg``: what single takes are expected to have of their own, as a standard deviation: a form
        is chosen only for what it explains beyond that."""
        super().__init__(signals or {})
        self.unit: str = unit
        self.take_sd_deg: float = take_sd_deg


class CorrectionEffect(Effect):
    """Adds columns to the prediction."""

    comparison: EffectComparison = EffectComparison()  # pyright: ignore[reportIncompatibleVariableOverride]
    """Always: nobody writes to it, so that a narrower type is safe."""
    further: FurtherColumns = FurtherColumns()

    @property
    @abstractmethod
    def dynamics(self) -> Dynamics:
        """How it goes from frame to frame."""

    def not_applicable_reason(self, takes: Sequence[Signals]) -> str | None:
        """Why these takes cannot show the effect, as the end of "cannot be judged: ..."; None if they can."""
        for name in self.context:
            known = [
                take.context[name][np.isfinite(take.context[name])] for take in takes if name in take.context
            ]
            if not known or not sum(map(len, known)):
                return f"no context column c.{name} was recorded"
            values = np.concatenate(known)
            if np.ptp(values) <= 1e-9 * max(1.0, float(np.abs(values).max())):
                return f"the context column c.{name} never changes ({values[0]:g})"
        return None

    def fit_constants(self, takes: Sequence[Signals]) -> Settings:
        """Constants from the training takes; the same settings are used wherever the effect is applied."""
        return {}

    @abstractmethod
    def columns(self, take: Signals, settings: Settings, shape: np.ndarray) -> np.ndarray:
        """(N, L, C), degrees for a weight of one; ``shape`` is (L, P). Zero weight changes nothing."""

    @abstractmethod
    def weights(self, settings: Settings) -> Weights:
        """The C weights of its columns."""

    def form_inputs(self, take: Signals, columns: np.ndarray, settings: Settings) -> FormSignals:
        """Of a learned form; ``columns`` (N, L, C) are the effect's own of ``take``.

        None: the columns are all there is to learn. The joint's own signal among them (``OWN``) means that a
        function of it alone is part of the effect; together with another input it always is.
        """
        return FormSignals()


class SignatureEffect(Effect):
    """Is found and shown: a *finding*, if it is of no other kind."""

    @abstractmethod
    def find(
        self,
        takes: Sequence[Take],
        sensor_of: Mapping[str, str],
        errors: Sequence[np.ndarray] | None = None,
    ) -> tuple[Finding, ...]:
        """What is found in ``takes``, the largest first.

        ``sensor_of`` names each rotation's own sensor; ``errors`` is, for each take, a calibrated model's
        error (N, len(sensor_of)) at the frames, degrees, NaN where there is no reference. Raises BadInput
        for sensors that a take does not have and for errors of another shape.
        """

    def proposed(self, recorded: Recorded) -> Proposal | None:
        """What would be added for what is found in takes; None when nothing is, or it is only told."""
        if recorded.only_held_levels or not recorded.sensor_of:
            return None
        every = recorded.found_before.find(self, recorded.takes, recorded.sensor_of)
        found = [item for item in every if not item.is_only_told]
        where = sorted({place for item in found for place in item.where})
        return Proposal({"where": where}, None, tuple(item.sentence for item in found)) if found else None


class RepairByPrediction(ABC):
    """Repairs a take that training never saw by what a model predicts for it."""

    @abstractmethod
    def repaired_to(
        self, take: Take, settings: Settings, rotations: Sequence[str], predicted: np.ndarray
    ) -> Take:
        """The take repaired; ``predicted`` (N, R) degrees at its frames."""


class LiveRepair(ABC):
    """Acts on live frames, too."""

    @abstractmethod
    def checked_live(
        self,
        takes: Sequence[Take],
        sensor_of: Mapping[str, str],
        sensors: Sequence[str],
        reads: Mapping[str, tuple[str, ...]],
        cancelled: Cancel | None = None,
    ) -> LiveCheck:
        """How it acts on live frames; ``reads``: the sensors that each rotation is read from, of the model's
        ``sensors``. Raises Cancelled."""

    @abstractmethod
    def hold(self, settings: Settings, rotations: Sequence[str], sensors: Sequence[str]) -> Hold | None:
        """What it does to live frames; None: nothing."""


class RepairEffect(SignatureEffect):
    """Mends the measurement."""

    @property
    def by_prediction(self) -> RepairByPrediction | None:
        """None: takes are repaired by themselves."""
        return None

    @property
    def live(self) -> LiveRepair | None:
        """None: it does nothing to live frames."""
        return None

    @abstractmethod
    def repaired(self, takes: Sequence[Take], settings: Settings | None = None) -> tuple[Take, ...]:
        """The takes with the effect taken out of the measurement.

        ``settings`` of a model; None: as it is found in these takes.
        """

    def between_levels(self, takes: Sequence[Take], sensor_of: Mapping[str, str]) -> tuple[Finding, ...]:
        """What is found in takes that only hold one known angle after another; by default nothing."""
        return ()

    def described(self, settings: Settings) -> dict[str, Any]:
        """What of the settings is told to a user."""
        return settings


@dataclass(frozen=True)
class Weighed:
    """What takes say of a hidden effect and of a cause that it may be taken for."""

    needs_cause: bool
    """Whether the cause is there, be it beside the effect or alone."""
    is_instead: bool | None
    """True: the effect is there and the cause is not; False: the other way round; None: they do not tell."""


class Hidden(ABC):
    """What takes of usual length may hold without showing it.

    A diagnosis asks for it once nothing that was compared explains the error. It can be learned where a user
    asks for it, though nothing of it is found, and stays if the claim on such takes is no worse.
    """

    @abstractmethod
    def weighed_against(
        self,
        cause: CorrectionEffect,
        takes: Sequence[Take],
        sensor_of: Mapping[str, str],
        errors: Sequence[np.ndarray],
    ) -> Weighed | None:
        """None for a cause that it is not taken for; ``sensor_of``: the rotations on which that saves error;
        ``errors`` as for ``find``."""

    @abstractmethod
    def widens(self, settings: Settings, rotations: Sequence[str]) -> bool:
        """Whether it found anything that makes any of ``rotations`` less sure."""


class IntervalEffect(SignatureEffect):
    """Widens the claimed interval: no correction brings back what the sensor does not say.

    How wide is learned from errors on held-out takes of training, never from the fit's own residuals: those
    of a flexible base are too small.
    """

    @property
    def hidden(self) -> Hidden | None:
        """None: what takes hold of it is found in them."""
        return None

    @abstractmethod
    def learned(self, held_out: Sequence[ClaimedErrors], found: Settings) -> Settings:
        """Constants for the rotations of ``held_out``; ``found`` are those that the takes themselves gave."""

    @abstractmethod
    def interval(
        self, settings: Settings, rotations: Sequence[str], sensors: Sequence[str], noise: np.ndarray
    ) -> Interval:
        """For L ``rotations`` whose measurement noise has the variance ``noise`` (L,), degrees squared."""

    @abstractmethod
    def sentence(self, settings: Settings, rotations: Sequence[str]) -> str:
        """What the claimed standard deviation of ``rotations`` does, without a full stop."""

    @abstractmethod
    def described_on(self, settings: Settings, rotation: str) -> dict[str, float]:
        """The learned numbers of one rotation, units in their names."""


def kind_of(effect: Effect) -> Kind:
    """How it acts on a calibration."""
    if isinstance(effect, CorrectionEffect):
        return "correction"
    if isinstance(effect, RepairEffect):
        return "repair"
    if isinstance(effect, IntervalEffect):
        return "interval"
    return "finding" if isinstance(effect, SignatureEffect) else "nothing"


def is_asked_last(effect: Effect) -> bool:
    """Whether a diagnosis asks for it once nothing that was compared explains the error."""
    return isinstance(effect, IntervalEffect) and effect.hidden is not None


def is_between_takes(effect: Effect) -> bool:
    """Whether it differs between takes, not inside them."""
    return effect.comparison is not None and effect.comparison.changes_between_takes


def needs_movement(effect: Effect) -> bool:
    """Whether single poses cannot show it beside others."""
    return effect.comparison is not None and effect.comparison.needs_movement


def has_memory(effect: Effect) -> bool:
    """Whether it corrects by what was before."""
    return isinstance(effect, CorrectionEffect) and effect.dynamics.has_memory


def why_not_shown(effect: Effect, takes: Sequence[Signals]) -> str | None:
    """Why these takes cannot show an effect that is compared with others, as above."""
    if isinstance(effect, CorrectionEffect):
        return effect.not_applicable_reason(takes)
    return None if effect.comparison is None else effect.comparison.not_applicable_reason(takes)


def unavailable_inputs(
    effect: CorrectionEffect, settings: Settings, context: Collection[str], wearing: str
) -> str | None:
    """What the effect would have to be told and is not, so that it corrects nothing; None if nothing.

    ``context`` are the columns whose values are known now.
    """
    unknown = [name for name in effect.context if name not in context]
    if unknown:
        return f"context {unknown[0]} is not sent"
    of_wearings = effect.weights(settings).of_wearings
    return None if of_wearings is None else of_wearings.unknown(wearing)


def described(
    effect: CorrectionEffect, settings: Settings, shape: np.ndarray, weights: np.ndarray
) -> dict[str, float]:
    """Numbers with units in their names for one lane's shape (P,) and weights (C,)."""
    pairs = zip(effect.shape.parameters, shape, strict=True)
    values = {f"{item.name}_{item.unit}": float(value) for item, value in pairs}
    return values | effect.further.described(effect.weights(settings).names, settings, weights)
