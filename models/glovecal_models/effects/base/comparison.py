"""How a diagnosis holds an effect against others: by the held-out error of its columns beside a control."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from glovecal_models.effects.base.assessment import Assessment
from glovecal_models.effects.base.facts import BETWEEN_TAKES, Certainty, Control
from glovecal_models.effects.base.limits import SignificanceLimits
from glovecal_models.effects.base.relations import Motion
from glovecal_models.effects.base.signals import Settings, Signals

# The regression problem that effects are judged on, as an effect with an own ``assess`` sees it.


class Problem(Protocol):
    """All joints on takes that were smoothed alike and sampled at even times."""

    @property
    def rotations(self) -> tuple[str, ...]: ...

    @property
    def signals(self) -> tuple[Signals, ...]:
        """One for each take, ``own`` (N, R)."""
        ...

    @property
    def unit_take(self) -> tuple[int, ...]:
        """The take of each unit."""
        ...

    @property
    def products(self) -> Sequence[Any]:
        """Each joint's static map of the measured angles: ``units`` (with ``base`` (N, P) and ``target``
        (N,), the joint's own sensor in degrees, of each unit), ``whole`` (P,) coefficients of all units,
        ``residual`` (N,) of each unit when it is held out, ``count`` (U,) rows of each unit."""
        ...

    @property
    def limits(self) -> SignificanceLimits:
        """What assessments of it are held against."""
        ...

    def units(self, joint: int) -> Iterator[tuple[int, np.ndarray]]:
        """Take and row indices of each unit of a joint."""
        ...

    def once(self, what: str, work: Callable[[], Any]) -> Any:
        """The result of ``work``, kept for whoever asks for the same again."""
        ...


CHANGES_BETWEEN_TAKES: tuple[Control, ...] = ("context of other takes", "permuted wearings")


@dataclass(frozen=True)
class EffectComparison:
    """As usual; an effect that is judged otherwise derives from it and says how."""

    control: Control = "time-reversed"
    """Columns with the same freedom made of inputs that cannot be right."""
    needs_movement: bool = False
    """Whether single poses cannot show the effect: it needs the movement from one to the next."""
    is_joint_by_joint: bool = False
    """Whether each joint has inputs of its own: signals that the joint's base reads already are left out."""
    certainty: Certainty = BETWEEN_TAKES
    """Asked for where the effect changes between takes; of few takes of any effect."""

    @property
    def changes_between_takes(self) -> bool:
        """Whether it differs between takes, not inside them: only whole takes are witnesses for it."""
        return self.control in CHANGES_BETWEEN_TAKES

    def not_applicable_reason(self, takes: Sequence[Signals]) -> str | None:
        """Of an effect without columns: why these takes cannot show it, as the end of "cannot be judged:
        ..."; None if they can."""
        return None

    def assess(self, problem: Problem) -> Assessment | None:
        """What it explains of ``problem``, where that is not judged as usual. None: as usual."""
        return None

    def first_of_alike(self, problem: Callable[[int], Problem]) -> tuple[str, tuple[str, ...]] | None:
        """Which of the effect and those alike comes first, and all of them that remain possible.

        ``problem`` gives the problem on signals smoothed over so many rows. None: the ranking decides.
        """
        return None

    def reference_delay_s(self, found: Assessment) -> np.ndarray | None:
        """How much later the reference has to come, seconds, (1,) for all takes or (takes,); None if the
        effect is not a delay."""
        return None

    def constants(self, found: Assessment, takes: Sequence[str]) -> Settings | None:
        """Those of the effect that an assessment on takes of these names found; None: none."""
        return None

    def decided_by(self, motion: Motion, found: Assessment, takes: Sequence[Signals]) -> bool:
        """Whether ``motion`` can still tell it from a rival, given what was found in ``takes``, measured and
        smoothed as they were judged."""
        return True

    def consequence(self, found: Assessment, confidence_set: Sequence[str]) -> str:
        """What else a user has to know where it is named, with all that the takes cannot tell from it: a
        sentence, or "" for nothing."""
        return ""
