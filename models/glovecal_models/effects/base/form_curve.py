"""A small picture of a learned form: what the effect adds over the values of each of its inputs.

Numbers of training, kept with the form: a form's weights say nothing to a reader, degrees over an input do.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from glovecal_models.effects.base.learned_form import OWN
from glovecal_models.errors import BadInput
from glovecal_models.presentation.document import answer

CURVE_BINS = 12
LOW, HIGH = 0.1, 0.9
"""Quantiles: of a bin's frames, and of the input between which the mean slope is taken."""
DIGITS = 5
LARGEST_CURVES = 64
"""Inputs of one joint that a stored picture may have."""
OWN_UNIT = "deg"


@answer
class FormCurve:
    """What an effect adds to one joint, over one input in bins of as many frames each."""

    input: str
    """As the effect names it; "own" for the joint's own angle."""
    unit: str
    """Of the input: "SD" of training, "deg", or "" where it has none."""
    at: tuple[float, ...]
    """(B,) mean of the input in each bin, rising."""
    mean_deg: tuple[float, ...]
    """(B,) mean of what the effect adds."""
    low_deg: tuple[float, ...]
    """(B,) 10 % quantile of it."""
    high_deg: tuple[float, ...]
    """(B,) 90 % quantile: wide where it depends on more than this input."""
    slope_deg_per_unit: float
    """Mean slope between the input's 10 and 90 % quantiles."""

    @classmethod
    def over(cls, name: str, unit: str, values: np.ndarray, degrees: np.ndarray) -> FormCurve:
        """Of ``values`` (N,) of an input and what the effect adds there, ``degrees`` (N,); N at least 1."""
        edges = np.unique(np.quantile(values, np.arange(1, CURVE_BINS) / CURVE_BINS))
        number = np.searchsorted(edges, values, side="right")
        bins = [number == place for place in range(len(edges) + 1) if np.any(number == place)]
        at = np.array([values[rows].mean() for rows in bins])
        mean = np.array([degrees[rows].mean() for rows in bins])
        spread = np.array([np.quantile(degrees[rows], (LOW, HIGH)) for rows in bins])
        low, high = np.quantile(values, (LOW, HIGH))
        rise = np.diff(np.interp((low, high), at, mean))[0]
        slope = rise / (high - low) if high > low else 0.0
        return cls(
            name,
            unit,
            _short(at),
            _short(mean),
            _short(spread[:, 0]),
            _short(spread[:, 1]),
            _short([slope])[0],
        )

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> FormCurve:
        """Raises KeyError, TypeError, ValueError."""
        at, mean, low, high = (
            tuple(map(float, document[key])) for key in ("at", "mean_deg", "low_deg", "high_deg")
        )
        if not 1 <= len(at) <= CURVE_BINS or {len(mean), len(low), len(high)} != {len(at)}:
            raise ValueError(f"curves of {len(at)}, {len(mean)}, {len(low)} and {len(high)} bins")
        slope = float(document["slope_deg_per_unit"])
        return cls(str(document["input"]), str(document["unit"]), at, mean, low, high, slope)


@answer
class LaneCurves:
    """What an effect adds to one joint in training: its range, and a curve for each input."""

    lowest_deg: float
    highest_deg: float
    inputs: tuple[FormCurve, ...]

    @classmethod
    def over(cls, inputs: Mapping[str, np.ndarray], unit: str, degrees: np.ndarray) -> LaneCurves:
        """Of every input's values (N,) by name and what the effect adds, ``degrees`` (N,); ``unit`` of all
        inputs but the joint's own angle."""
        lowest, highest = _short([degrees.min(), degrees.max()])
        curves = (
            FormCurve.over(name, OWN_UNIT if name == OWN else unit, values, degrees)
            for name, values in inputs.items()
        )
        return cls(lowest, highest, tuple(curves))

    def described(self) -> dict[str, float]:
        """Numbers with units in their names."""
        slopes = {
            f"slope_deg_per_{item.unit or 'unit'}[{item.input}]": item.slope_deg_per_unit
            for item in self.inputs
        }
        return {"lowest_added_deg": self.lowest_deg, "highest_added_deg": self.highest_deg, **slopes}

    def to_document(self) -> dict[str, Any]:
        """Plain data of a few kB at most."""
        return asdict(self)

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> LaneCurves:
        """Inverse of ``to_document``. Raises BadInput."""
        try:
            inputs = document["inputs"][:LARGEST_CURVES]
            curves = tuple(FormCurve.from_document(item) for item in inputs)
            return cls(float(document["lowest_deg"]), float(document["highest_deg"]), curves)
        except (KeyError, TypeError, ValueError) as error:
            raise BadInput(
                "not the curves of a learned form: something in it is missing, or no number"
            ) from error


def _short(values: Sequence[float] | np.ndarray) -> tuple[float, ...]:
    return tuple(float(f"{value:.{DIGITS}g}") for value in values)
