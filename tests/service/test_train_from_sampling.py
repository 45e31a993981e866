"""Training from the takes of a guided sampling, as a job: poses, widgets and touches."""

from __future__ import annotations

import numpy as np
import pytest
from asked_session import RECORDING, asked_session
from jobs_waiting import result_of

from glovecal_models.calibration.artifact import load
from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_models.sampling.catalogue import make_protocol
from glovecal_models.sampling.sampled_takes import sampled_takes
from glovecal_models.simulation.simulated_glove import SimulatedGlove
from glovecal_service.store import Store

GLOVE = SimulatedGlove(5)
LAYOUT = GLOVE.layout


@pytest.fixture(scope="module")
def sampled(dispatched) -> Store:
    """Anna, whose hand is measured, and bea, whose is not and who has no widgets."""
    store, _ = dispatched
    skeleton = hand_skeleton()
    session = asked_session(
        make_protocol("new_subject", LAYOUT), GLOVE, seed=5, rate_hz=30, skeleton=skeleton, at_once_s=0.2
    )
    store.layouts.put(LAYOUT)
    for name, dimensions in (("measured-anna", {"hand_length": 190.0}), ("bea", {})):
        store.subjects.create(name, dimensions=dimensions)
        for each in sampled_takes(session.state, {RECORDING: session.take}, name=name):
            if each.kind != "range" and (name == "measured-anna" or each.kind != "fk_cross_couple"):
                told = {"sampling": {"id": "0" * 12, **each.to_document()}}
                store.takes.add(
                    each.take, subject=name, layout=LAYOUT.name, source="sampling", accounting=told
                )
    return store


def trained(store: Store, subject: str, **more):
    payload = {"subject": subject, "layout": LAYOUT.name, "samples": 150, **more}
    return result_of(store, store.jobs.create("train", payload).id)


def test_touches_teach_and_the_error_is_of_what_was_left_out(sampled: Store) -> None:
    result = trained(sampled, "measured-anna")
    said = " ".join(result["sentences"])
    assert "Tips of thumb and index: read " in said
    assert "Touches left out, one at a time, miss by (mm, median): touch-I " in said
    model = load(sampled.models.load_bytes(result["model"]))
    assert model.error_estimate["how"] == "widgets left out, one at a time"
    assert set(model.error_estimate["touch_mm"]) == {"touch-I", "touch-M", "touch-R", "touch-P", "rod-I-60"}
    assert result["held_out_rmse_deg"] == pytest.approx(model.error_estimate["rmse_deg"])
    assert result["per_rotation"]["IM_ABD"] < 5.0
    assert result["per_rotation"]["I_MCP"] is None  # poses are no measurement of their own error
    virtual = next(item for item in model.rotations if item.rotation == "T_VIR")
    assert virtual.correspondence.kind == "MS1R"
    assert np.isfinite(virtual.regressor.predict(np.zeros((1, 2))).mean).all()


def test_without_a_measured_hand_touches_wait_and_the_user_is_told(sampled: Store) -> None:
    result = trained(sampled, "bea")
    assert any("Touches are not used: nobody measured bea's hand" in each for each in result["sentences"])
    assert result["held_out_rmse_deg"] is None


def test_a_baseline_takes_the_known_angles_as_they_are(sampled: Store) -> None:
    result = trained(sampled, "measured-anna", method="linear")
    assert not any("Tips" in each for each in result["sentences"])
    assert result["held_out_rmse_deg"] is not None


def test_a_template_is_made_of_the_shapes_and_touches_of_a_sampling(sampled: Store) -> None:
    result = trained(sampled, "measured-anna", method="template", activate=True)
    said = " ".join(result["sentences"])
    assert "hand shapes tell scale and offset of" in said
    assert "Distance of the tips that the template leaves (mm, median): touch-I " in said
    model = load(sampled.models.load_bytes(result["model"]))
    assert (model.method, model.simulated) == ("template", True)
    assert "PALM_ARCH" in model.rotation_names
    assert result["held_out_rmse_deg"] is None
    active = sampled.models.active("measured-anna", LAYOUT.name)
    assert active is not None
    assert active.id == result["model"]


def test_the_glove_makers_two_shapes_leave_out_what_they_do_not_show(sampled: Store) -> None:
    result = trained(sampled, "measured-anna", method="two_shapes")
    model = load(sampled.models.load_bytes(result["model"]))
    assert {"T_TMC", "TI_ABD", "I_MCP", "I_PIP"} <= set(model.rotation_names)
    assert "M_MCP" not in model.rotation_names
    assert any(each.startswith("Not in both shapes, not in the model: M_MCP") for each in result["sentences"])


def test_a_template_is_the_prior_mean_of_lmc_gpr(sampled: Store) -> None:
    template = trained(sampled, "measured-anna", method="template")["model"]
    result = trained(sampled, "measured-anna", prior=template, samples=60)
    model = load(sampled.models.load_bytes(result["model"]))
    assert model.method == "lmc_gpr"
    by_name = {item.rotation: item for item in model.rotations}
    assert by_name["TI_ABD"].correspondence.sensors[-1] == "PALM_ARCH"
    assert by_name["I_MCP"].regressor.settings()["evidence"]["prior"] == ["I_MCP"]
