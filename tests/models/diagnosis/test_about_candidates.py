"""Beside the candidates of a diagnosis: why a significant one is in no confidence set, what is comparable."""

from __future__ import annotations

from glovecal_models.diagnosis.answer import MissingEffects, NamedEffect
from glovecal_models.diagnosis.trial.answer import Candidate


def candidate(effect: str, *where: str) -> Candidate:
    return Candidate(effect, where, 3.0, 2.0, 2.9, {}, {}, None, passes=bool(where))


def told(*candidates: Candidate, rivals: tuple[str, ...] = ()) -> list[str]:
    first = candidates[0]
    named = NamedEffect(first.effect, tuple(first.where), "correction", (first.effect, *rivals), {})
    return MissingEffects({}, named, candidates, [], None, None, []).about_candidates


def test_a_significant_effect_outside_of_the_set_says_why():
    lag, slip = candidate("lag", "I_PIP"), candidate("garment_slip")
    [sentence] = told(candidate("hysteresis", "I_PIP"), lag, slip)
    assert sentence.startswith("Significant and not in the confidence set: lag. With hysteresis ")
    assert told(candidate("hysteresis", "I_PIP"), lag, slip, rivals=("lag",)) == []


def test_rows_of_other_rotations_are_told():
    [sentence] = told(candidate("hysteresis", "I_PIP"), candidate("lag", "I_MCP"), rivals=("lag",))
    assert "not to be compared" in sentence
