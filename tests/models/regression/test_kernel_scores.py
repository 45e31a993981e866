"""Which kernel is taken, what is said of it, and what is refused when it is read again."""

import json
from typing import Any

import numpy as np
import pytest

from glovecal_models.covariance.functions import Polynomial
from glovecal_models.errors import DamagedArtifact
from glovecal_models.regression.fast_lmc import fit_lmc_gpr
from glovecal_models.regression.kernel_candidates import CANDIDATE, CANDIDATES, candidates_of
from glovecal_models.regression.kernel_scores import (
    CandidateScore,
    KernelScores,
    choice_of,
    keeping_choice,
    kernel_of,
    kernel_sentences,
    with_choice,
)

TAKES = (2.0, 1.8, 1.9, 2.1, 1.7)


def score(name: str, nlml: float, rmse: float, by_take: tuple[float, ...] = TAKES, parameters: int = 5):
    return CandidateScore(name, nlml, parameters, rmse, by_take)


def scores(*others: CandidateScore, default: float = 1.9, spread: float = 20.0) -> KernelScores:
    first = score("lmc_gpr", 500.0, default)
    return KernelScores((first, *others), 400, 1.0, straight_line_deg=4.1, spread_deg=spread)


def lower(share: float) -> tuple[float, ...]:
    return tuple(share * value for value in TAKES)


def test_clearly_better_in_both_is_taken_and_said() -> None:
    found = scores(score("polynomial_3", 462.0, 1.2, lower(0.6)))
    assert found.chosen.name == "polynomial_3"
    assert found.sentence("I_PIP") == (
        "I_PIP: a polynomial of degree 3 fits best: 1.20 degrees on takes left out against "
        "1.90 for LMC-GPR (a straight line: 4.10); its evidence is 38 nats better on the same 400 samples."
    )


@pytest.mark.parametrize(
    ("other", "why"),
    [
        (score("polynomial_3", 496.0, 1.2, lower(0.6)), "4 nats"),
        (score("polynomial_3", 480.0, 1.2, lower(0.6), parameters=13), "dearly bought: 8 parameters more"),
        (score("polynomial_3", 400.0, 1.82, lower(0.96)), "4 % less error"),
        (score("polynomial_3", 400.0, 1.2, (0.5, 0.5, 0.5, 2.2, 1.8)), "worse on two of five takes"),
        (CandidateScore("polynomial_3", 400.0, 5, 1.2, (0.6, 0.6)), "two takes"),
        (CandidateScore("polynomial_3", 400.0, 5), "not measured"),
    ],
)
def test_lmc_gpr_stays_unless_another_is_clearly_better_in_both(other: CandidateScore, why: str) -> None:
    found = KernelScores(
        (CandidateScore("lmc_gpr", 500.0, 5, 1.9, TAKES[: len(other.rmse_by_take_deg) or 5]), other),
        400, 1.0, 4.1, 20.0,
    )  # fmt: skip
    assert found.chosen is found.default, why
    assert found.sentence("I_PIP").startswith("I_PIP: LMC-GPR stays, 1.90 degrees on takes left out")


def test_where_takes_left_out_are_beyond_all_kernels_nothing_is_chosen() -> None:
    found = scores(score("general", 460.0, 11.0, lower(0.6)), default=14.0, spread=16.0)
    assert found.chosen.name == "lmc_gpr"
    assert "no kernel foretells these takes" in found.sentence("I_PIP")


def test_of_about_equal_ones_the_simplest_is_taken() -> None:
    better = score("polynomial_2", 480.0, 1.23, lower(0.65)), score("general", 440.0, 1.2, lower(0.6))
    assert scores(*better).chosen.name == "polynomial_2"
    much = score("general", 440.0, 1.1, lower(0.55))
    assert scores(better[0], much).chosen.name == "general"


def test_a_weight_of_less_than_one_makes_parameters_cheaper() -> None:
    whole = scores(score("general", 500.0, 1.9, parameters=9))
    part = KernelScores(whole.scores, 400, 0.1, None, None)
    assert whole.evidence_gain(whole.scores[1]) < part.evidence_gain(part.scores[1]) < 0


def test_sentences_name_each_change_and_gather_the_rest() -> None:
    changed, same = scores(score("polynomial_2", 460.0, 1.2, lower(0.6))), scores()
    said = kernel_sentences({"I_MCP": same, "I_PIP": changed, "IM_ABD": same})
    assert said[0].startswith("I_PIP: a polynomial of degree 2 fits best")
    assert said[1].startswith("LMC-GPR stays for I_MCP, IM_ABD: no other kernel is clearly better there")
    untold = KernelScores((CandidateScore("lmc_gpr", 1.0, 5),), 20, 1.0, None, None)
    assert "nothing to judge other kernels on" in kernel_sentences({"I_PIP": untold})[0]


def test_every_candidate_belongs_to_a_method_and_lmc_gpr_comes_first() -> None:
    assert candidates_of("auto") == CANDIDATES
    assert CANDIDATES[0].name == "lmc_gpr"
    assert {item.name for item in candidates_of("polynomial_gpr")} == {
        "polynomial_2", "polynomial_3", "polynomial_3_smooth",
    }  # fmt: skip
    assert [item.name for item in candidates_of("general_gpr")] == ["general"]
    assert CANDIDATE["lmc_gpr"].parameters(3) == 4 + 4 + 1
    assert CANDIDATE["general"].parameters(3) == 0 + 8 + 1


def document(**changes: Any) -> dict[str, Any]:
    found = scores(score("polynomial_3", 462.0, 1.2, lower(0.6))).to_document()
    return json.loads(json.dumps(found)) | changes


def test_a_document_gives_back_the_same_choice() -> None:
    found = scores(score("polynomial_3", 462.0, 1.2, lower(0.6)), CandidateScore("general", 470.0, 9))
    assert KernelScores.from_document(json.loads(json.dumps(found.to_document()))) == found


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ([], "expected an object with scores"),
        (document(scores=[]), "kernel_choice has no scores"),
        (document(scores="lmc_gpr"), "is of none of lmc_gpr, polynomial_2"),
        (document(scores=[{"name": "magic"}]), "is of none of lmc_gpr, polynomial_2"),
        (document(chosen="lmc_gpr"), "says 'lmc_gpr', its scores say 'polynomial_3'"),
        (document(samples=0), "samples is 0, expected a finite number of at least 1"),
        (document(spread_deg="wide"), "spread_deg is 'wide'"),
        (document(scores=[{**document()["scores"][0], "nlml": None}]), "nlml is None"),
        (document(scores=[{**document()["scores"][0], "rmse_by_take_deg": 3}]), "expected a list of numbers"),
        (document(scores=[{**document()["scores"][0], "rmse_by_take_deg": [-1]}]), "error of a take is -1"),
    ],
)
def test_a_damaged_document_is_refused(wrong: Any, sentence: str) -> None:
    with pytest.raises(DamagedArtifact, match=sentence):
        KernelScores.from_document(wrong)


def test_a_choice_must_be_of_the_process_that_keeps_it() -> None:
    inputs = np.linspace(0, 1, 40)[:, None]
    target = 40 * inputs[:, 0] ** 3 + np.random.default_rng(0).normal(scale=0.5, size=40)
    process = fit_lmc_gpr(inputs, target)
    assert choice_of(process) is None
    assert kernel_of(process) == "lmc_gpr"
    kept = with_choice(process, scores())
    assert choice_of(kept) == scores()
    assert choice_of(keeping_choice(kept, process)) == scores()
    polynomial = CANDIDATE["polynomial_3"].fit(inputs, target)
    assert polynomial.covariance.settings() == Polynomial(3).settings()
    assert choice_of(keeping_choice(kept, polynomial)) is None
    wrong = with_choice(process, scores(score("polynomial_3", 462.0, 1.2, lower(0.6))))
    with pytest.raises(DamagedArtifact, match="kernel_choice says 'polynomial_3', but the process has"):
        choice_of(wrong)
