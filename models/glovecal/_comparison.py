"""A model against measurements: how large its errors are, and what they depend on."""

from __future__ import annotations

from collections.abc import Iterable

from glovecal._calls import library_call
from glovecal._model import CalibrationModel, about, inner_model
from glovecal._takes import takes_in
from glovecal_models.comparison.answer import Comparison
from glovecal_models.comparison.where.answer import WhereItFails
from glovecal_models.takes.take import Take


def compare(
    model: CalibrationModel,
    takes: Take | Iterable[Take],
    *,
    offline: bool = False,
    hand_length_mm: float | None = None,
) -> Comparison:
    """Hold a model against takes with reference angles, best such as it was not trained on.

    ``offline``: angles are estimated with both directions of time, with the live error beside them.
    ``hand_length_mm``: from the wrist crease to the tip of the middle finger, for errors of fingertips.
    Raises BadInput when nothing was measured, when the takes are of another layout, or for a length that no
    hand has.
    """
    from glovecal_models.comparison.compare import compare as compare_inner
    from glovecal_models.hand.dimensions import HandDimensions

    length = None if hand_length_mm is None else {"hand_length": hand_length_mm}
    hand = None if length is None else HandDimensions.from_measured(length)
    with library_call():
        inner, every = inner_model(model), takes_in(takes)
        return about(compare_inner(inner, every, offline=offline, dimensions=hand), every, model)


def where(model: CalibrationModel, takes: Take | Iterable[Take], *, seed: int = 0) -> WhereItFails:
    """Hold each rotation's error against its noise floor and every recorded column.

    A column is significant only if circularly shifted errors do not depend on it as much; ``seed`` is of the
    shifts. Raises BadInput when nothing was measured, or when the takes are of another layout.
    """
    from glovecal_models.comparison.residuals import residuals
    from glovecal_models.comparison.where_it_fails import where_it_fails

    with library_call():
        inner, every = inner_model(model), takes_in(takes)
        return about(where_it_fails(residuals(inner, every), seed=seed), every, model)
