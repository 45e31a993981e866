"""The p value under random signs: near the exact one, and blind to one lucky block; that of signed ranks."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest
from scipy.stats import wilcoxon

from glovecal_models.effects.base.assessment import random_signs, signed_rank


def test_it_is_near_the_share_of_all_signs():
    values = np.random.default_rng(2).normal(0.5, 1.0, 14)
    exact = np.mean([np.dot(signs, values) >= values.sum() for signs in product((-1, 1), repeat=14)])
    assert random_signs(values) == pytest.approx(exact, rel=0.25)


def test_what_acts_in_few_blocks_is_seen_and_one_block_is_not_enough():
    calm = np.random.default_rng(1).normal(-0.05, 0.05, 80)
    assert random_signs(np.append(calm, np.full(20, 1.0))) < 1e-3
    assert random_signs(np.append(calm, 30.0)) > 0.1


def test_too_few_blocks_or_nothing_say_nothing():
    assert random_signs(np.ones(5)) == 1.0
    assert random_signs(np.zeros(50)) == 1.0


@pytest.mark.parametrize("count", [6, 25, 26, 60])
@pytest.mark.parametrize("step", [0.0, 0.5])
def test_signed_ranks_are_those_of_scipy_with_ties_and_zeros_too(count, step):
    values = np.random.default_rng(count).normal(0.4, 1.0, count)
    values = np.round(values / step) * step if step else values
    how = "exact" if count <= 25 else "approx"
    found: Any = wilcoxon(values, alternative="greater", method=how)
    expected = float(found.pvalue)
    assert signed_rank(values, fewest=5) == pytest.approx(expected, rel=1e-12)
