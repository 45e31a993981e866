"""A home-made glove trained without knowing its sensors: what is chosen, kept, served and told."""

from dataclasses import replace

import numpy as np
import pytest
from unknown_sensors import (
    LAYOUT,
    LINEAR_GLOVE,
    POLYNOMIAL_GLOVE,
    SLEEVE,
    UNKNOWN_GLOVE,
    flex_takes,
    sleeve_takes,
)

from glovecal_models.calibration.artifact import dump, load, model_id, read_manifest
from glovecal_models.calibration.kernel_choice import score_candidates
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.calibration.sample_weight import Recorded
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings, settings_of
from glovecal_models.comparison.compare import compare
from glovecal_models.errors import BadInput, Cancelled, DamagedArtifact, NotTrainable
from glovecal_models.improvement.add_effect import add_effect
from glovecal_models.layout import Layout
from glovecal_models.regression.kernel_candidates import CANDIDATES, candidates_of
from glovecal_models.regression.kernel_scores import choice_of, kernel_of
from glovecal_models.takes.take import Take

AUTO = TrainingSettings(method="auto", folds=0)


def kernels(model: CalibrationModel) -> dict[str, str | None]:
    return {item.rotation: kernel_of(item.regressor) for item in model.rotations}


def only(*rotations: str) -> Layout:
    return replace(LAYOUT, correspondences=tuple(LAYOUT.correspondence(name) for name in rotations))


FEW = only("T_MCP", "I_PIP", "P_PIP")


def split(responses, seed: int, product: float = 1.0) -> tuple[list[Take], list[Take]]:
    """Four short takes to learn from, four that have no part in anything."""
    every = flex_takes(responses, seed, 8, 60, product=product)
    return every[:4], every[4:]


@pytest.fixture(scope="module")
def polynomial() -> CalibrationModel:
    return train(split(POLYNOMIAL_GLOVE, 0)[0], FEW, "anna", AUTO)


def test_linear_sensors_are_left_to_lmc_gpr_to_the_last_digit() -> None:
    takes, new = split(LINEAR_GLOVE, 0, product=0.0)
    layout = only("T_MCP", "I_PIP")
    model = train(takes, layout, "anna", AUTO)
    assert set(kernels(model).values()) == {"lmc_gpr"}
    plain = train(takes, layout, "anna", TrainingSettings(method="lmc_gpr", folds=0))
    assert np.array_equal(
        GlovePredictor(model).predict(new[0].readings).mean,
        GlovePredictor(plain).predict(new[0].readings).mean,
    )


def test_polynomial_sensors_are_named_and_new_takes_are_predicted_no_worse(polynomial) -> None:
    found = kernels(polynomial)
    assert found["T_MCP"] == "polynomial_2"  # a product of two sensors
    assert found["I_PIP"] == "polynomial_2"
    assert found["P_PIP"] == "polynomial_3"
    takes, new = split(POLYNOMIAL_GLOVE, 0)
    plain = train(takes, FEW, "anna", TrainingSettings(method="lmc_gpr", folds=0))
    mine, theirs = compare(polynomial, new), compare(plain, new)
    assert mine.rotations["T_MCP"].rmse_deg < 0.96 * theirs.rotations["T_MCP"].rmse_deg
    assert mine.overall.rmse_deg < theirs.overall.rmse_deg
    for rotation in polynomial.rotations:
        assert 0.55 < mine.rotations[rotation.rotation].coverage < 0.85  # 0.68 is truthful


def test_a_product_of_four_sensors_learned_from_little_saves_a_third_of_the_error() -> None:
    every = sleeve_takes(10, 8, 50)
    model = train(every[:4], SLEEVE, "anna", AUTO)
    plain = train(every[:4], SLEEVE, "anna", TrainingSettings(method="lmc_gpr", folds=0))
    assert kernels(model) == {"BEND": "polynomial_2"}
    assert compare(model, every[4:]).overall.rmse_deg < 0.7 * compare(plain, every[4:]).overall.rmse_deg


def test_steps_and_sigmoids_are_not_taken_for_polynomials() -> None:
    takes, _ = split(UNKNOWN_GLOVE, 1)
    model = train(takes, only("I_PIP", "M_PIP", "R_PIP"), "anna", AUTO)
    assert set(kernels(model).values()) <= {"lmc_gpr", "general"}
    for item in model.rotations:
        choice = choice_of(item.regressor)
        assert choice is not None
        assert [score.name for score in choice.scores] == [item.name for item in CANDIDATES]


def test_what_was_tried_is_kept_and_the_same_training_gives_the_same_process(polynomial) -> None:
    artifact = dump(polynomial)
    again = train(split(POLYNOMIAL_GLOVE, 0)[0], only("P_PIP"), "anna", AUTO).rotations[0].regressor
    first = polynomial.rotations[-1].regressor
    assert again.settings() == first.settings()
    assert all(np.array_equal(values, first.arrays()[name]) for name, values in again.arrays().items())
    restored = load(artifact, expected_id=model_id(artifact))
    for before, after in zip(polynomial.rotations, restored.rotations, strict=True):
        assert choice_of(after.regressor) == choice_of(before.regressor) is not None
        choice = choice_of(after.regressor)
        assert choice is not None
        assert choice.chosen.name == kernel_of(after.regressor)
        error = choice.chosen.held_out_rmse_deg
        scale = choice.straight_line_deg, choice.spread_deg
        assert None not in (error, *scale)
        assert (error or 0.0) < (scale[0] or 0.0) < (scale[1] or 0.0)
    assert read_manifest(artifact)["rotations"][0]["regressor"]["method"] == "polynomial_gpr"


def test_a_choice_that_is_not_of_its_process_is_refused(polynomial) -> None:
    first, *rest = polynomial.rotations
    for wrong in ({"scores": []}, {"chosen": "general"}, "polynomial_2"):
        kept = first.regressor.evidence["kernel_choice"]
        damaged = {**kept, **wrong} if isinstance(wrong, dict) else wrong
        evidence = first.regressor.evidence | {"kernel_choice": damaged}
        other = replace(first, regressor=replace(first.regressor, evidence=evidence))
        with pytest.raises(DamagedArtifact, match="kernel_choice"):
            load(dump(replace(polynomial, rotations=(other, *rest))))


def test_frame_by_frame_is_the_recorded_take(polynomial) -> None:
    readings = split(POLYNOMIAL_GLOVE, 0)[1][0].readings
    predictor = GlovePredictor(polynomial)
    whole = predictor.predict(readings)
    single = [predictor.predict(frame[None]) for frame in readings]
    assert np.concatenate([item.mean for item in single]) == pytest.approx(whole.mean, abs=1e-9)
    assert np.concatenate([item.sd for item in single]) == pytest.approx(whole.sd, abs=1e-9)
    assert max(len(item.regressor.nodes) for item in polynomial.rotations) < 30


def test_an_effect_is_added_to_the_kernels_that_were_chosen(polynomial) -> None:
    takes = split(POLYNOMIAL_GLOVE, 0)[0]
    slower = [replace(t, time_s=4 * t.time_s, reference_time_s=4 * t.reference_time_s) for t in takes]
    settings = settings_of(polynomial, TrainingSettings(method="auto", folds=2))
    assert dict(settings.kernels) == kernels(polynomial)
    found = add_effect(
        polynomial,
        slower,
        "creep",
        rotations=["P_PIP"],
        settings=settings,
        least_gain=-9.0,
        control_share=1.0,
    )
    assert found.added
    assert kernels(found.model) == kernels(polynomial)
    assert choice_of(found.model.rotations[-1].regressor) == choice_of(polynomial.rotations[-1].regressor)
    assert load(dump(found.model)).effects[0].name == "creep"


def test_a_kernel_can_be_insisted_on() -> None:
    takes, _ = split(LINEAR_GLOVE, 0, product=0.0)
    layout = only("I_PIP")
    general = train(takes, layout, "anna", TrainingSettings(method="general_gpr", folds=0))
    assert kernels(general) == {"I_PIP": "general"}
    assert choice_of(general.rotations[0].regressor) is None
    any_degree = train(takes, layout, "anna", TrainingSettings(method="polynomial_gpr", folds=0))
    assert kernels(any_degree) == {"I_PIP": "polynomial_2"}
    choice = choice_of(any_degree.rotations[0].regressor)
    assert choice is not None
    assert [score.name for score in choice.scores] == [c.name for c in candidates_of("polynomial_gpr")]
    with pytest.raises(BadInput, match="no kernel 'magic' for I_PIP; there are lmc_gpr, polynomial_2"):
        train(takes, layout, "anna", replace(AUTO, kernels=(("I_PIP", "magic"),)))


def recorded(takes: int = 4, frames: int = 30) -> Recorded:
    random = np.random.default_rng(3)
    reading = random.uniform(size=takes * frames)
    target = 60 * reading**2 + random.normal(scale=1.0, size=len(reading))
    owner = np.repeat(np.arange(takes), frames)
    return Recorded(np.round(1023 * reading)[:, None], target, owner, np.arange(len(reading)))


def test_errors_are_measured_only_where_they_matter_and_the_choice_is_the_same() -> None:
    thorough = score_candidates(recorded(), CANDIDATES).scores
    quick = score_candidates(recorded(), CANDIDATES, thorough=False).scores
    assert quick.chosen == thorough.chosen
    assert [score.nlml for score in quick.scores] == [score.nlml for score in thorough.scores]
    assert all(score.held_out_rmse_deg is not None for score in thorough.scores)
    assert any(score.held_out_rmse_deg is None for score in quick.scores)


def test_a_few_samples_leave_nothing_to_judge_on_and_lmc_gpr_stays() -> None:
    found = score_candidates(recorded(takes=1, frames=12), CANDIDATES).scores
    assert found.chosen.name == "lmc_gpr"
    assert found.straight_line_deg is None
    assert "nothing to judge other kernels on" in found.sentence("I_PIP")
    with pytest.raises(NotTrainable):
        score_candidates(recorded(takes=1, frames=4), CANDIDATES)


def test_cancelled_between_candidates_and_progress_is_told() -> None:
    said: list[str] = []
    with pytest.raises(Cancelled):
        score_candidates(
            recorded(), CANDIDATES,
            cancelled=lambda: any("degree 2" in item for item in said),
            report=lambda sentence, share: said.append(sentence),
        )  # fmt: skip
    assert said == ["trying LMC-GPR", "trying a polynomial of degree 2"]
