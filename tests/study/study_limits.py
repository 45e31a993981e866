"""Limits for a study with other values, read from a TOML file: by name, in a table for each stage."""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from glovecal_models.errors import BadInput
from glovecal_models.improvement.limits import IMPROVEMENT_LIMITS, ImprovementLimits
from glovecal_models.limit import described_limits, with_limits

STAGES = ("diagnosis", "comparison", "improvement")
"""What the blind study asks; limits of effects belong to the diagnosis."""


def read_limits(path: Path) -> ImprovementLimits:
    """Raises BadInput for what is no TOML, and for stages and names that there are not; OSError."""
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as problem:
        raise BadInput(f"{path} cannot be read as TOML: {problem}") from None
    return limits_from(document)


def limits_from(document: Mapping[str, Any]) -> ImprovementLimits:
    """The limits as they are, but for the values in ``document``. Raises BadInput."""
    limits = IMPROVEMENT_LIMITS
    for stage, values in document.items():
        if stage not in STAGES or not isinstance(values, Mapping):
            raise BadInput(f"there is no table of limits {stage!r}; there are {', '.join(STAGES)}")
        if stage == "improvement":
            limits = with_limits(limits, values)
        else:
            limits = replace(limits, **{stage: with_limits(getattr(limits, stage), values)})
    return limits


def other_limits(limits: ImprovementLimits) -> dict[str, float]:
    """Those that are not as usual, such as "diagnosis.clear_share"."""
    sets = {"diagnosis": limits.diagnosis, "comparison": limits.comparison, "improvement": limits}
    return {
        f"{stage}.{name}": getattr(some, name)
        for stage, some in sets.items()
        for name, (usual, _) in described_limits(type(some)).items()
        if getattr(some, name) != usual
    }


def digest(software: str, limits: ImprovementLimits) -> str:
    """Under which answers are kept: of the programs, and of limits that are not as usual."""
    others = other_limits(limits)
    return hashlib.sha256(f"{software} {sorted(others.items())}".encode()).hexdigest() if others else software
