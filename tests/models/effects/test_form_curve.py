"""The small picture of a learned form: degrees over each input, in bins of as many frames each."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from glovecal_models.effects.base.form_curve import CURVE_BINS, FormCurve, LaneCurves
from glovecal_models.effects.base.learned_form import OWN
from glovecal_models.errors import BadInput


def curves(count: int = 6000) -> tuple[LaneCurves, dict[str, np.ndarray], np.ndarray]:
    """Adds a neighbour's bend, one-sided, times what share of its range the joint itself is bent."""
    random = np.random.default_rng(0)
    inputs = {"I_MCP": random.normal(0, 1, count), OWN: random.uniform(0, 90, count)}
    degrees = 3.0 * np.maximum(inputs["I_MCP"], 0) * inputs[OWN] / 90
    return LaneCurves.over(inputs, "SD", degrees), inputs, degrees


def test_a_curve_is_the_mean_in_each_bin_and_its_spread() -> None:
    found, inputs, degrees = curves()
    over, own = found.inputs
    assert (over.input, over.unit, own.input, own.unit) == ("I_MCP", "SD", OWN, "deg")
    assert len(over.at) == CURVE_BINS
    order = np.argsort(inputs["I_MCP"])
    bins = np.array_split(order, CURVE_BINS)
    np.testing.assert_allclose(over.at, [inputs["I_MCP"][rows].mean() for rows in bins], rtol=1e-3, atol=1e-3)
    np.testing.assert_allclose(over.mean_deg, [degrees[rows].mean() for rows in bins], rtol=1e-3, atol=1e-3)
    assert max(over.mean_deg[:5]) < 0.01
    last = bins[-1]
    assert over.low_deg[-1] == pytest.approx(np.quantile(degrees[last], 0.1), rel=1e-3)
    assert over.high_deg[-1] == pytest.approx(np.quantile(degrees[last], 0.9), rel=1e-3)
    assert over.high_deg[-1] - over.low_deg[-1] > 3, "it depends on the joint's own angle too"


def test_slopes_and_the_range_stand_with_units() -> None:
    found, inputs, degrees = curves()
    numbers = found.described()
    assert numbers["lowest_added_deg"] == 0
    assert numbers["highest_added_deg"] == pytest.approx(degrees.max(), rel=1e-4)
    quantiles = np.quantile(inputs["I_MCP"], (0.1, 0.9))
    expected = 1.5 * quantiles[1] / np.ptp(quantiles)  # half the slope on half of the range
    assert numbers["slope_deg_per_SD[I_MCP]"] == pytest.approx(expected, rel=0.1)
    assert numbers["slope_deg_per_deg[own]"] == pytest.approx(3 * 0.4 / 90, rel=0.1)  # E max(z, 0) = 0.4


@pytest.mark.parametrize("values", [np.zeros(50), np.repeat([1.0, 2.0, 7.0], 20), np.array([3.0])])
def test_few_different_values_are_fewer_bins(values: np.ndarray) -> None:
    found = FormCurve.over("c", "", values, 2 * values)
    assert list(found.at) == sorted(set(values))
    assert found.mean_deg == found.low_deg == found.high_deg == tuple(2 * at for at in found.at)
    assert found.slope_deg_per_unit == pytest.approx(2 if len(set(values)) > 1 else 0)


def test_its_document_is_small_and_gives_it_back() -> None:
    found = curves()[0]
    text = json.dumps(found.to_document())
    assert len(text) < 1500
    assert LaneCurves.from_document(json.loads(text)) == found


@pytest.mark.parametrize(
    "change",
    [{"inputs": 3}, {"inputs": [{}]}, {"lowest_deg": "low"}, {"inputs": [{"input": "a", "at": [1, 2]}]}],
)
def test_a_damaged_document_is_refused(change: dict[str, Any]) -> None:
    with pytest.raises(BadInput, match="not the curves of a learned form"):
        LaneCurves.from_document(curves()[0].to_document() | change)
