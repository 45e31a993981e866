"""Whether a model can do what it is served for: predict frames of its own layout."""

from __future__ import annotations

import numpy as np

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.calibration.wearer_fit import WearerFit
from glovecal_models.errors import BadInput

LARGEST_DEG = 1e5
"""No linear model leaves this within its sensors' range, and a pose's float32 holds it."""


def check_servable(model: CalibrationModel) -> None:
    """Predict frames at both ends and in the middle of every sensor's range, as for a glove that is worn.

    Raises BadInput, with the rotation where one is to blame, for a model that does not give finite angles.
    """
    try:
        with np.errstate(all="ignore"):
            predictor = GlovePredictor(model)
            fit = WearerFit(model, predictor)
            low, high = model.layout.counts or (0.0, 1.0)
            ends = np.array([np.nan_to_num(fit.low, nan=low), np.nan_to_num(fit.high, nan=high)])
            angles = predictor.predict(np.vstack([ends, ends.mean(axis=0)]))
    except BadInput:
        raise
    except (
        ArithmeticError,
        ValueError,
        LookupError,
        TypeError,
        AttributeError,
        np.linalg.LinAlgError,
    ) as error:
        raise BadInput("the model does not predict a frame of its own layout") from error
    for what, values in (("an angle", angles.mean), ("a standard deviation", angles.sd)):
        wrong = ~(np.abs(values) <= LARGEST_DEG)  # NaN too
        if wrong.any():
            row, column = np.argwhere(wrong)[0]
            raise BadInput(
                f"the model gives {predictor.rotations[column]} {what} of {values[row, column]:g} degrees; "
                f"what can be served is finite and at most {LARGEST_DEG:g}"
            )
