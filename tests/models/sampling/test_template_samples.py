"""Automatic initialisation from five hand shapes: its least squares, its sampling, and the model it gives."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from asked_session import RECORDING, asked_session

from glovecal_models.calibration.artifact import dump, load
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.errors import NotTrainable
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.skeleton import Skeleton, hand_skeleton
from glovecal_models.layout import Layout
from glovecal_models.sampling.catalogue import make_protocol
from glovecal_models.sampling.guided.labelled_takes import LabelledTake
from glovecal_models.sampling.inverse_kinematics.contact import Touch
from glovecal_models.sampling.sampled_takes import sampled_takes
from glovecal_models.sampling.shown_hands import (
    SHAPES,
    KnownAngle,
    Observation,
    shape_angles,
    touching_angles,
)
from glovecal_models.sampling.template.initialisation import (
    TemplateEquations,
    TouchConditions,
    equations_for,
    initialised,
)
from glovecal_models.sampling.template.template_samples import template_calibration, template_samples
from glovecal_models.simulation.simulated_glove import SimulatedGlove

LAYOUT = Layout.built_in("cyberglove18")
SIZES = HandDimensions.from_measured({"hand_length": 182})
RIGHT, LEFT = (hand_skeleton(SIZES, hand, "arching") for hand in ("right", "left"))


@cache
def sampled(seed: int = 1) -> tuple[LabelledTake, ...]:
    glove = SimulatedGlove(seed)
    protocol = make_protocol("five_shapes", LAYOUT)
    session = asked_session(protocol, glove, seed=seed, rate_hz=30, skeleton=RIGHT, at_once_s=0.2)
    return tuple(
        LabelledTake.of(each) for each in sampled_takes(session.state, {RECORDING: session.take}, name="s")
    )


def exact(skeleton: Skeleton) -> tuple[TemplateEquations, np.ndarray, list[Observation]]:
    """Readings that follow a template exactly, in five shapes whose angles are known but for the "o"."""
    random = np.random.default_rng(3)
    names = tuple(name for name in LAYOUT.sensors if not name.startswith("W_"))
    readings = random.uniform(60, 180, (12, len(LAYOUT.sensors)))
    equations = equations_for(LAYOUT.sensors, readings, dict.fromkeys(names, (0.0, 1.0)), True)
    found = np.array([random.uniform(30, 60) if part else 25.0 for _, part in equations.parameters])
    found[equations.parameters.index(("TI_ABD", "PALM_ARCH"))] = 4.0
    seen = []
    for row in readings:
        angles = {name: equations.angles(name, row[None], found)[0] for name in names}
        seen.append(
            Observation("", row[None], {name: KnownAngle(float(a), 0.01) for name, a in angles.items()})
        )
    return equations, found, seen


@pytest.mark.parametrize("skeleton", [RIGHT, LEFT], ids=["right", "left"])
def test_exact_shapes_give_the_exact_template(skeleton: Skeleton) -> None:
    equations, found, seen = exact(skeleton)
    result = initialised(seen, LAYOUT.sensors, skeleton)
    assert result.equations.parameters == equations.parameters
    np.testing.assert_allclose(result.found, found, atol=0.02)


def test_slopes_of_a_touch_are_finite_differences() -> None:
    equations, found, seen = exact(RIGHT)
    touching = Observation("touch-P", seen[0].readings, {}, Touch(("T", "P")))
    conditions = TouchConditions.of(touching, equations, RIGHT)
    slopes, step = conditions.missing(found)[1], 1e-5
    for column in range(len(found)):
        move = step * np.eye(len(found))[column]
        ahead, behind = (conditions.missing(found + sign * move)[0] for sign in (1, -1))
        np.testing.assert_allclose(slopes[:, column], (ahead - behind) / (2 * step), atol=1e-5)


def test_the_left_hand_gives_the_same_template() -> None:
    right, left = (template_samples(sampled(), LAYOUT, hand).initialisation for hand in (RIGHT, LEFT))
    np.testing.assert_allclose(left.found, right.found, atol=1e-3)


def test_a_touch_tells_what_no_name_does() -> None:
    """The index finger's gain is unknown but for the touch, at which its tip has to meet the thumb's."""
    known = touching_angles(RIGHT, Touch(("T", "I")))
    assert set(known) == set(RIGHT.chain("T")) | set(RIGHT.chain("I"))
    result = template_samples(sampled(), LAYOUT, RIGHT).initialisation
    assert max(result.contact_mm.values()) < 8.0
    apart = [each for each in sampled() if not each.contacts]
    without = template_samples(apart, LAYOUT, RIGHT)
    assert without.initialisation.contact_mm == {}
    assert "No shape with fingertips together" in without.sentences[1]


def test_the_trained_model_is_the_initialisation() -> None:
    samples = template_samples(sampled(), LAYOUT, RIGHT)
    model = template_calibration(sampled(), LAYOUT, "anna", RIGHT)
    readings = np.concatenate([each.readings for each in samples.seen])
    angles = GlovePredictor(model).predict(readings)
    for column, name in enumerate(model.rotation_names):
        expected = samples.initialisation.angles(name, readings)
        np.testing.assert_allclose(angles.mean[:, column], expected, atol=1e-6)
    assert model.simulated
    assert model.method == load(dump(model)).method == "template"
    assert "rmse_deg" not in model.error_estimate
    assert min(angles.sd[:, model.rotation_names.index(name)].min() for name in ("I_MCP", "T_TMC")) >= 2.5


def test_the_calibration_take_lasts_about_a_minute_and_holds_every_shape() -> None:
    protocol = make_protocol("five_shapes", LAYOUT, seed=3)
    assert 45 < protocol.capture_s < 120
    held = [step for step in protocol.steps if step.kind != "range"]
    assert {step.pose for step in held} == set(SHAPES)
    assert all(step.motion == "hold" for step in held)
    assert [step.pose for step in held[:5]] == list(SHAPES)
    assert held == [step for step in make_protocol("five_shapes", LAYOUT).steps if step.kind != "range"]


def test_shapes_tell_angles_of_named_poses_only() -> None:
    assert shape_angles("flat")["I_PIP"] == KnownAngle(0.0, 2.5)
    assert shape_angles("fist")["I_DIP"].degrees == pytest.approx(95 * 2 / 3)
    assert shape_angles("touch-I") == {}


def test_what_tells_nothing_is_refused() -> None:
    with pytest.raises(NotTrainable, match="0 hand shapes tell no rotation at two angles"):
        template_samples([], LAYOUT, None)
