"""Effects into a model, and out of it again."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

from glovecal._calls import Progress, library_call
from glovecal._effects import declared, is_declaration
from glovecal._model import CalibrationModel, inner_model
from glovecal._takes import takes_in
from glovecal_models.presentation.document import Answer, Presentation
from glovecal_models.progress import Cancel
from glovecal_models.takes.take import Take

if TYPE_CHECKING:
    from glovecal_models.calibration.methods import Method
    from glovecal_models.calibration.model import CalibrationModel as InnerModel
    from glovecal_models.calibration.training_settings import TrainingSettings
    from glovecal_models.improvement.addition import Addition as InnerAddition


@dataclass(frozen=True, eq=False, repr=False)
class Addition(Answer):
    """What became of an effect that was added: a model that has it, or why it was undone."""

    inner: InnerAddition
    """``glovecal_models.improvement.addition.Addition``: squared errors and frames of each rotation."""

    @property
    def effect(self) -> str:
        """Its name."""
        return self.inner.effect

    @property
    def rotations(self) -> tuple[str, ...]:
        """Where it was put."""
        return self.inner.rotations

    @property
    def added(self) -> bool:
        """Whether the held-out error fell enough for it to stay."""
        return self.inner.added

    @property
    def model(self) -> CalibrationModel:
        """The model with the effect; the one it started from when the effect was undone."""
        return CalibrationModel(self.inner.model)

    @property
    def sentence(self) -> str:
        """The held-out errors before and after, and why it stays or not."""
        from glovecal_models.improvement.text import addition_sentence

        return addition_sentence(self.inner)

    @property
    def parameters(self) -> dict[str, dict[str, float]]:
        """What was learned, for each rotation; units in the names."""
        return self.inner.parameters

    def presentation(self) -> Presentation:
        from glovecal_models.improvement.answer import EffectAdded
        from glovecal_models.improvement.text import effect_tried

        return EffectAdded(**effect_tried(self.inner)).presentation()


def add_effect(
    model: CalibrationModel,
    takes: Take | Iterable[Take],
    effect: str,
    *,
    rotations: Sequence[str] | None = None,
    samples: int = 2000,
    seed: int = 0,
    cancelled: Cancel | None = None,
    progress: Progress = None,
) -> Addition:
    """Learn a model anew with one effect, and keep it only if the held-out error falls by 5 % or more.

    ``takes`` are the training takes. ``effect``: a name (``effects()`` lists them), or an effect of your own
    as text, such as ``"name = strap; columns = c.strap_n * own"``. ``rotations``: None for all. ``samples``
    and ``seed`` as for ``train``. The model given stays as it is. Raises BadInput when the effect or a
    rotation is unknown, or when the takes cannot carry it; Cancelled.
    """
    from glovecal_models.improvement.add_effect import add_effect as add_inner

    inner, takes = inner_model(model), takes_in(takes)
    wanted = declared([effect])[0] if is_declaration(effect) else effect
    asked = None if rotations is None else tuple(rotations)
    with library_call(progress) as report:
        report(f"looking at the takes for {wanted if isinstance(wanted, str) else wanted.name}", 0.0)
        found = add_inner(
            inner,
            takes,
            wanted,
            rotations=asked,
            settings=_settings(inner, samples, seed),
            parent_id=CalibrationModel(inner).id,
            cancelled=cancelled,
            report=report,
        )
        report("done", 1.0)
    return Addition(found)


def remove_effect(
    model: CalibrationModel,
    takes: Take | Iterable[Take],
    effect: str,
    *,
    samples: int = 2000,
    seed: int = 0,
    cancelled: Cancel | None = None,
    progress: Progress = None,
) -> CalibrationModel:
    """The model learned anew from its training takes without one of its effects; the one given stays.

    ``samples`` and ``seed`` as for ``train``. Raises BadInput when it has no such effect; Cancelled.
    """
    from glovecal_models.improvement.remove_effect import remove_effect as remove_inner

    inner = inner_model(model)
    with library_call(progress) as report:
        report(f"learning without {effect}", 0.0)
        child = remove_inner(
            inner,
            takes_in(takes),
            effect,
            settings=_settings(inner, samples, seed),
            parent_id=CalibrationModel(inner).id,
            cancelled=cancelled,
        )
        report("done", 1.0)
    return CalibrationModel(child)


def _settings(model: InnerModel, samples: int, seed: int) -> TrainingSettings:
    from glovecal_models.calibration.training_settings import TrainingSettings

    return TrainingSettings(cast("Method", model.method), samples=samples, seed=seed)
