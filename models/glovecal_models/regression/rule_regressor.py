"""A rotation nobody measured, computed from other calibrated rotations by the layout's expression.

Wang & Neff 2013, section 3.3 (0S1R): DIP = 2/3 PIP. When a take did measure the rotation it is trained
like any other; this rule is what remains when none did.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from glovecal_models.errors import DamagedArtifact
from glovecal_models.regression.regressor import Prediction


@dataclass(frozen=True)
class RuleRegressor:
    """Weighted sum of other rotations; ``predict`` takes those rotations (degrees) as inputs."""

    rotations: tuple[str, ...]
    weights: np.ndarray
    """Shape (len(rotations),), degrees per degree."""

    @property
    def method(self) -> str:
        return "rule"

    @property
    def noise_variance(self) -> float:
        return 0.0

    def predict(self, inputs: np.ndarray) -> Prediction:
        """Mean and (zero) variance from rotations in degrees, shape (N, len(rotations))."""
        inputs = np.asarray(inputs, dtype=float)
        return Prediction(inputs @ self.weights, np.zeros(len(inputs)))

    def arrays(self) -> dict[str, np.ndarray]:
        return {"weights": np.asarray(self.weights, dtype=np.float64)}

    def settings(self) -> dict[str, Any]:
        return {"method": "rule", "rotations": list(self.rotations)}

    @classmethod
    def restore(cls, arrays: Mapping[str, np.ndarray], settings: Mapping[str, Any]) -> RuleRegressor:
        rotations, weights = tuple(settings.get("rotations", ())), arrays.get("weights")
        if weights is None or weights.shape != (len(rotations),) or not np.isfinite(weights).all():
            raise DamagedArtifact(f"rule for {len(rotations)} rotations needs as many finite weights")
        return cls(rotations, weights)
