"""What an effect is: a named physical cause that changes readings, and what it has to answer.

An effect adds *columns* to a calibration: functions of the joint's own signal, of other signals and of the
context, in degrees. Their weights are linear and learned in closed form; what they do not depend on linearly
(a time constant, a width) is the effect's *shape*, tried on a grid. The same columns serve in both
directions: of the measured angle they distort a sensor (forward: simulation, diagnosis), of the predicted
angle they correct it (inverse: training, serving), because the inverse of a play, a low pass or a gain is of
its own family to first order.

Lanes are joints (and, while a shape is searched, joints times shapes): everything works on all lanes at once.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from glovecal_models.effects.base.assessment import Assessment
from glovecal_models.effects.base.facts import Control, EffectFacts, Motion, Settings
from glovecal_models.effects.base.problem import Problem
from glovecal_models.effects.base.signals import GloveFrames, Signals
from glovecal_models.takes.take import Take

LEAST_SETTLING_S = 1.0
"""An effect with a memory counts as settled after this or, if longer, its longest time constant."""
Uncertainty = Callable[[np.ndarray], np.ndarray]
"""From the joints' own signal (N, L), degrees, to their correction's variance (N, L), degrees squared."""


class Effect(EffectFacts, ABC):
    """One physical cause. Stateless: settings and shape are handed in, so that a model can store them."""

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

    def assess(self, problem: Problem) -> Assessment | None:
        """What it explains of ``problem``, where that is not judged as usual: by the held-out error of its
        columns beside that of its control. None: as usual."""
        return None

    def told_from_alikes(self, problem: Callable[[int], Problem]) -> tuple[str, tuple[str, ...]] | None:
        """Which of this effect and those in ``alike`` comes first, and all of them that remain possible.

        ``problem`` gives the problem on signals smoothed over so many rows. None: the ranking decides.
        """
        return None

    def reference_delay_s(self, found: Assessment) -> np.ndarray | None:
        """How much later the reference has to come, seconds, (1,) for all takes or (takes,); None: it is no
        matter of time."""
        return None

    def decided_by(self, motion: Motion, found: Assessment, takes: Sequence[Take]) -> bool:
        """Whether a rival's ``motion`` can still tell the two apart, given what was found in ``takes``."""
        return True

    def consequence(self, found: Assessment, confidence_set: Sequence[str]) -> str:
        """What else a user has to know where it is named, with all that the takes cannot tell from it: a
        sentence, or "" for nothing."""
        return ""

    def unavailable_inputs(self, settings: Settings, context: Collection[str], wearing: str) -> str | None:
        """What it would have to be told and is not, so that it corrects nothing; None if nothing.

        ``context`` are the columns whose values are known now.
        """
        unknown = [name for name in self.context if name not in context]
        return f"context {unknown[0]} is not sent" if unknown else None

    def knows_wearing(self, settings: Settings, wearing: str) -> bool:
        """Whether it learned what is special about this wearing."""
        return False

    def transient_s(self, shape: np.ndarray, settings: Settings) -> float:
        """How long a state started anew still shows, seconds, for lanes of ``shape`` (L, P); 0 without a
        memory."""
        if not self.has_memory or not len(shape):
            return 0.0
        times = [shape[:, at].max() for at, item in enumerate(self.parameters) if item.unit == "s"]
        return float(max([LEAST_SETTLING_S, *times]))

    def fit_constants(self, takes: Sequence[Signals]) -> Settings:
        """Constants from the training takes; the same settings are used wherever the effect is applied."""
        return {}

    def fit_repair_constants(self, takes: Sequence[Signals]) -> Settings:
        """The same where it is learned: with more columns than naming it needs, if a repair wants them."""
        return self.fit_constants(takes)

    @abstractmethod
    def grid(self, takes: Sequence[Signals], settings: Settings) -> np.ndarray:
        """Shapes to try, (G, L, P); P is ``len(parameters)``, G at least 1."""

    @abstractmethod
    def columns(self, take: Signals, settings: Settings, shape: np.ndarray) -> np.ndarray:
        """(N, L, C), degrees for a weight of one; ``shape`` is (L, P). Zero weight changes nothing."""

    def columns_of_takes(
        self, takes: Sequence[Signals], settings: Settings, shape: np.ndarray
    ) -> list[np.ndarray]:
        """``columns`` of each take; to be overridden where all takes together are quicker."""
        return [self.columns(take, settings, shape) for take in takes]

    tells_own_uncertainty: ClassVar[bool] = False
    """Whether ``uncertainty`` tells all that is unknown of its weights."""

    def uncertainty(self, settings: Settings, weights: np.ndarray, wearing: str) -> Uncertainty | None:
        """What is not known of its correction in a wearing, ``weights`` (L, C); None: nothing."""
        return None

    def form_inputs(self, take: Signals, columns: np.ndarray, settings: Settings) -> Mapping[str, np.ndarray]:
        """The signals (N, L) that a learned form may be a function of, by name (``learned_form``).

        ``columns`` (N, L, C) are the effect's own of ``take``. None: the columns are all there is to learn.
        The joint's own signal among them (``OWN``) means that a function of it alone is part of the effect;
        together with another input it always is.
        """
        return {}

    form_unit: ClassVar[str] = ""
    """Of those signals, all alike; "" where they have none, or are context columns of any unit."""

    take_sd_deg: ClassVar[float] = 0.0
    """What single takes are expected to have of their own, as a standard deviation: a learned form is chosen
    only for what it explains beyond that."""

    def settings_with_curves(self, takes: Sequence[Signals], settings: Settings) -> Sequence[Settings]:
        """Settings of the same effect with more columns, of which a calibration takes the ones that its takes
        ask for, or none."""
        return ()

    def settings_with_found(self, settings: Settings, stored: Settings) -> Settings:
        """``settings`` of other takes with those of ``stored`` that were searched in all takes; not to be
        searched again in fewer."""
        return settings

    def settings_as_stored(self, takes: Sequence[Signals], settings: Settings, stored: Settings) -> Settings:
        """``settings`` of other lanes with the further columns that a model with ``stored`` took."""
        return settings

    @abstractmethod
    def stream(self, settings: Settings, shape: np.ndarray) -> Stream:
        """The same columns, frame by frame."""

    @abstractmethod
    def weight_names(self, settings: Settings) -> tuple[str, ...]:
        """What each of the C weights multiplies, with its unit, such as "per kelvin (deg/K)"."""

    def prior_sd(self, settings: Settings) -> np.ndarray:
        """How large each of the C weights may be expected to be, as a standard deviation."""
        return np.ones(len(self.weight_names(settings)))

    def forward_weights(self, settings: Settings, generator: np.random.Generator) -> np.ndarray:
        """(C,) weights with which it may distort a sensor, as its columns of the measured angle; of any size:
        whoever puts the effect into a session scales them."""
        return self.prior_sd(settings) * generator.standard_normal(len(self.prior_sd(settings)))

    def is_of_training(self, settings: Settings) -> bool:
        """Whether training takes taught it something: they are asked again when a model is learned anew."""
        return True

    def described(self, settings: Settings, shape: np.ndarray, weights: np.ndarray) -> dict[str, float]:
        """Numbers with units in their names for one lane's shape (P,) and weights (C,)."""
        values = {
            f"{item.name}_{item.unit}": float(v) for item, v in zip(self.parameters, shape, strict=True)
        }
        return values | dict(zip(self.weight_names(settings), map(float, weights), strict=True))


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


class InstantEffect(Effect):
    """An effect without memory: each frame's columns depend on that frame alone."""

    def stream(self, settings: Settings, shape: np.ndarray) -> Stream:
        return _InstantStream(self, settings, shape)


class _InstantStream(Stream):
    def __init__(self, effect: InstantEffect, settings: Settings, shape: np.ndarray) -> None:
        self._effect, self._settings, self._shape = effect, settings, shape

    def columns(self, frame: Signals) -> np.ndarray:
        return self._effect.columns(frame, self._settings, self._shape)

    def reset(self) -> None:
        """There is nothing to forget."""

    @classmethod
    def together(cls, streams: Sequence[Any], frames: GloveFrames) -> np.ndarray:
        first, signals = streams[0], frames.as_one()
        if signals is None:
            return super().together(streams, frames)
        return first._effect.columns(signals, first._settings, first._shape)


class ColumnlessEffect(InstantEffect):
    """Zero columns, one shape of zeros."""

    control: ClassVar[Control] = "none"

    def grid(self, takes: Sequence[Signals], settings: Settings) -> np.ndarray:
        return np.zeros((1, takes[0].own.shape[1], len(self.parameters)))

    def columns(self, take: Signals, settings: Settings, shape: np.ndarray) -> np.ndarray:
        return np.zeros((len(take), take.own.shape[1], 0))

    def weight_names(self, settings: Settings) -> tuple[str, ...]:
        return ()
