"""Reading one number of a stored regressor: damaged documents are refused by the number's name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from glovecal_models.errors import DamagedArtifact


def stored_number(settings: Mapping[str, Any], name: str, least: float) -> float:
    """``settings[name]`` as a float; raises DamagedArtifact unless finite and at least ``least``."""
    value = settings.get(name)
    if (
        isinstance(value, bool)
        or not isinstance(value, (int, float))
        or not np.isfinite(value)
        or value < least
    ):
        raise DamagedArtifact(f"{name} is {value!r}, expected a finite number of at least {least:g}")
    return float(value)
