"""What a training job trains on: takes with measured angles, and what guided samplings teach a method."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from glovecal_models.calibration.methods import OF_SHAPES
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.errors import NotTrainable
from glovecal_models.hand.rotations import HANDS
from glovecal_models.layout import Layout
from glovecal_models.sampling.guided.guided_calibration import BASELINES, GuidedSamples, guided_samples
from glovecal_models.sampling.guided.labelled_takes import LabelledTake
from glovecal_models.sampling.template.template_samples import (
    TemplateSamples,
    named_takes,
    shape_take,
    template_samples,
)
from glovecal_models.takes.take import Take
from glovecal_models.takes.take_check import excluded_sentences
from glovecal_service.store import Store
from glovecal_service.store.records import SubjectRecord, TakeRecord, hand_of, incomplete_sentences


@dataclass(frozen=True)
class TrainingTakes:
    takes: tuple[Take, ...]
    layout: Layout
    """How rotations are read in training."""
    settings: TrainingSettings
    sentences: tuple[str, ...] = ()
    _sampled: GuidedSamples | TemplateSamples | None = None

    @classmethod
    def of(
        cls,
        store: Store,
        records: Sequence[TakeRecord],
        layout: Layout,
        subject: SubjectRecord,
        settings: TrainingSettings,
    ) -> TrainingTakes:
        """Raises NotTrainable, LayoutMismatch, BadInput, DamagedArtifact.

        A session with no reference system has an error estimate of its own.
        """
        require_one_hand(records)
        shapes = [record for record in records if record.hand_shape and settings.method in OF_SHAPES]
        sampled = [record for record in records if record.sampling and settings.method not in BASELINES]
        plain = tuple(
            store.takes.load(record.id)
            for record in records
            if record not in (*sampled, *shapes) and (record.has_reference or not record.sampling)
        )
        taught = [
            LabelledTake.from_document(store.takes.load(record.id), record.sampling or {})
            for record in sampled
        ]
        taught += [shape_take(store.takes.load(record.id), record.hand_shape or "") for record in shapes]
        every = [*plain, *(labelled.take for labelled in taught)]
        incomplete = [*incomplete_sentences(records), *excluded_sentences(every)]
        if not taught:
            return cls(plain, layout, settings, tuple(incomplete))
        measured = subject.skeleton(hand_of(records)) if subject.dimensions else None
        if settings.method == "two_shapes":
            return cls((*named_takes(taught, measured), *plain), layout, settings, tuple(incomplete))
        if settings.method == "template":
            template = template_samples(taught, layout, measured)
            said = (*incomplete, *template.sentences)
            settings = settings if plain else replace(settings, folds=0)
            return cls((*template.takes, *plain), layout, settings, said, template)
        guided = guided_samples(taught, layout, measured)
        said = [*incomplete, *guided.sentences]
        if measured is None and any(each.contacts for each in taught):
            said.append(
                f"Touches are not used: nobody measured {subject.name}'s hand. Its length is enough: "
                f"glovecal subject measure {subject.name} --hand-length-mm 190"
            )
        settings = settings if plain else replace(settings, folds=0)
        return cls((*guided.takes, *plain), guided.layout, settings, tuple(said), guided)

    def finished(self, model: CalibrationModel) -> CalibrationModel:
        """``model`` as it is kept."""
        return model if self._sampled is None else self._sampled.finished(model)


def require_one_hand(records: Sequence[TakeRecord]) -> None:
    """A model is of one hand. Raises NotTrainable where the takes are of both."""
    of = {hand: next((row for row in records if row.known_hand == hand), None) for hand in HANDS}
    left, right = of["left"], of["right"]
    if left is not None and right is not None:
        raise NotTrainable(
            f"take {left.name} is of a left glove and take {right.name} of a right one, and each hand has "
            "models of its own: choose the hand (--hand left or --hand right), or takes of one hand"
        )
