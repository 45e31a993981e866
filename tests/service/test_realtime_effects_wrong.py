"""Effects that go wrong, live: no value, no number, somebody else's error; the poses go on."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from effect_models import HYSTERESIS, MODEL, UNITS, added, model_with
from loop_by_hand import LoopByHand, as_take, assert_published, degrees, moving_frames

from glovecal_client.wire.pose import RotationFlag
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.effects.declared.expression_effect import ExpressionEffect
from glovecal_models.effects.hysteresis import Hysteresis
from glovecal_models.errors import BadInput
from glovecal_service.realtime.served_model import ServedModel

UPSIDE_DOWN_DEG = 75.0
"""No joint is there in ``moving_frames``."""


@pytest.mark.parametrize("columns", ["1e300 * exp(t * 100)", "400 + 0 * own"])
def test_an_absurd_correction_leaves_the_base_flagged_and_counted(columns: str) -> None:
    document = ExpressionEffect.parse(f"name = wild; columns = {columns}").declaration.to_document()
    wild = added("wild", (), (1.0,), ("I_PIP",), settings={"declaration": document, "context": {}, **UNITS})
    model, frames = model_with(HYSTERESIS, wild), moving_frames(50)
    by_hand = LoopByHand.serving(model)
    by_hand.stream(frames)
    base = GlovePredictor(model).predict(np.array([frame.readings for frame in frames])).mean
    poses = by_hand.poses["g1"]
    np.testing.assert_allclose(degrees(poses)[:, 1], base[:, 1], rtol=1e-6)
    assert all(pose.too_uncertain for pose in poses)
    assert all(pose.rotation_flags[1] & RotationFlag.TOO_UNCERTAIN for pose in poses)
    assert not any(pose.rotation_flags[0] & RotationFlag.TOO_UNCERTAIN for pose in poses)
    assert by_hand.status("g1")["effects"]["unusable_corrections"] == 50


def test_an_effect_that_raises_does_not_stop_the_poses(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither those of its glove, nor those of another glove of the model in the same turn."""
    by_hand = LoopByHand.serving(MODEL)
    by_hand.models.put("g2", by_hand.models.of("g1"))
    step = Hysteresis.step

    def broken(effect: Hysteresis, state: np.ndarray, elapsed_s: float, own: np.ndarray, *rest: Any) -> Any:
        if (own > UPSIDE_DOWN_DEG).any():
            raise RuntimeError("somebody else's code")
        return step(effect, state, elapsed_s, own, *rest)

    monkeypatch.setattr(Hysteresis, "step", broken)
    frames, sound = moving_frames(5), moving_frames(5, run_id=2)
    high = [replace(frame, readings=np.full(3, 254.0, np.float32)) for frame in frames]
    both = zip(high, sound, strict=True)
    by_hand.send([item for one, two in both for item in (("g1", one), ("g2", two))])
    base = GlovePredictor(MODEL).predict(np.array([frame.readings for frame in high])).mean
    assert_published(by_hand.poses["g1"], base)
    assert all(pose.too_uncertain for pose in by_hand.poses["g1"])
    assert_published(by_hand.poses["g2"], as_take(MODEL, sound))
    assert not any(pose.too_uncertain for pose in by_hand.poses["g2"])
    monkeypatch.undo()
    more = [replace(frame, sequence=frame.sequence + 5) for frame in moving_frames(30, start_s=1000.2)]
    by_hand.stream(more)
    assert_published(by_hand.poses["g1"][5:], as_take(MODEL, more))


def test_a_model_whose_effect_is_not_here_or_another_is_refused_before_it_is_served() -> None:
    with pytest.raises(BadInput, match="no effect 'strap'"):
        ServedModel.prepare("1" * 64, model_with(replace(HYSTERESIS, name="strap")))
    older = replace(HYSTERESIS, weights=HYSTERESIS.weights[:, :2])
    with pytest.raises(BadInput, match="learned with 1 parameters and 2 weights, but here it has 1 and 3"):
        ServedModel.prepare("1" * 64, model_with(older))


def test_a_declared_effect_without_a_value_is_left_out_and_flagged() -> None:
    text = "name = strap; columns = 1 / c.strap_n, lowpass(own_deg, tau) - own_deg; parameter tau s 0.1 5 = 1"
    declared = ExpressionEffect.parse(text).declaration.to_document()
    span = {"strap_n": {"low": 0.0, "high": 9.0, "usual": 1.0}}
    strap = added(
        "strap", (1.0,), (1.0, 0.3), ("I_PIP",), settings={"declaration": declared, "context": span, **UNITS}
    )
    model, frames = model_with(HYSTERESIS, strap), moving_frames(60)
    tension = np.where(np.arange(60) % 5 == 0, 0.0, 2.0).astype(np.float32)
    by_hand = LoopByHand.serving(model)
    by_hand.say("g1", context=("strap_n",))
    sent = [replace(frame, context=tension[at : at + 1]) for at, frame in enumerate(frames)]
    by_hand.stream(sent)
    time_s = np.array([frame.monotonic_ns for frame in frames]) / 1e9
    readings = np.array([frame.readings for frame in frames], dtype=np.float64)
    context = {"strap_n": tension.astype(np.float64)}
    assert_published(
        by_hand.poses["g1"], GlovePredictor(model).predict_take(time_s, readings, context, "w").mean
    )
    doubtful = [bool(pose.rotation_flags[1] & RotationFlag.TOO_UNCERTAIN) for pose in by_hand.poses["g1"]]
    assert doubtful == (tension == 0).tolist()
    assert by_hand.status("g1")["effects"]["unusable_corrections"] == 12
