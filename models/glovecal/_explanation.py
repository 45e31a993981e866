"""What one frame's angles are made of."""

from __future__ import annotations

from collections.abc import Sequence

from glovecal._calls import library_call
from glovecal._model import CalibrationModel, inner_model
from glovecal_models.calibration.answer import Explanation
from glovecal_models.takes.take import Take


def explain(
    model: CalibrationModel, take: Take, at_s: float, *, rotations: Sequence[str] | None = None
) -> Explanation:
    """What the angles of the frame nearest to ``at_s`` (seconds by the take's clock) are made of.

    Raises BadInput for a time outside the take and for a rotation that the model does not have.
    """
    from glovecal_models.calibration.explanation import explain as explain_frame

    with library_call():
        return explain_frame(inner_model(model), take, at_s, rotations or ())
