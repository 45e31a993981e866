"""Which regressors an artifact may hold: the method's name decides the class."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from glovecal_models.errors import DamagedArtifact
from glovecal_models.regression.linear_regressor import LinearRegressor
from glovecal_models.regression.process_regressor import ProcessRegressor
from glovecal_models.regression.regressor import Regressor, RuleRegressor

_KINDS: dict[str, type[Regressor]] = {
    "linear": LinearRegressor,
    "lmc_gpr": ProcessRegressor,
    "gpr": ProcessRegressor,
    "polynomial_gpr": ProcessRegressor,
    "general_gpr": ProcessRegressor,
    "spgp": ProcessRegressor,
    "rule": RuleRegressor,
}


def restore_regressor(arrays: Mapping[str, np.ndarray], settings: Mapping[str, Any]) -> Regressor:
    """The regressor whose ``arrays`` and ``settings`` these are. Raises DamagedArtifact."""
    method = settings.get("method")
    if method not in _KINDS:
        raise DamagedArtifact(f"unknown method {method!r}; known are {', '.join(_KINDS)}")
    return _KINDS[method].restore(arrays, settings)
