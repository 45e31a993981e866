"""What goes wrong in a step, and the sentence that it gets."""

from __future__ import annotations

import numpy as np
import pytest

from glovecal_models.errors import BadInput
from glovecal_models.sampling.catalogue import rod_step, touch_steps
from glovecal_models.sampling.protocol import Step, widget_step
from glovecal_models.sampling.state import ActiveRanges, GloveReading
from glovecal_models.sampling.verdict import faults, inconsistent_widgets

from .conftest import STEPS, Bench, moving, pose

SENSORS = ("T_TMC", "TI_ABD", "I_MCP", "P_MCP", "P_PIP")


def ranges() -> ActiveRanges:
    found = ActiveRanges.unknown(len(SENSORS), (0.0, 255.0))
    found.widen(np.array([[50.0] * 5, [150.0] * 5]))
    return found


def readings(values: np.ndarray, rate_hz: float = 100.0, first: int = 0) -> list[GloveReading]:
    return [GloveReading(n / rate_hz, first + n, "r", row) for n, row in enumerate(values)]


def still(count: int = 100) -> np.ndarray:
    return np.full((count, 5), 100.0)


def swinging(columns: list[int], count: int = 400) -> np.ndarray:
    values = still(count)
    values[:, columns] += 45 * np.sin(np.arange(count) / 25)[:, None]
    return values


def reasons(step: Step, frames: list[GloveReading], **more) -> str:
    return " ".join(faults(step, frames, SENSORS, ranges(), **more))


def test_a_still_hand_is_good() -> None:
    assert reasons(pose("flat"), readings(still())) == ""


def test_noise_is_no_motion_and_hides_none() -> None:
    noisy = still(40) + 2.4 * np.random.default_rng(1).standard_normal((40, 5))
    assert reasons(pose("flat"), readings(noisy, rate_hz=30)) == ""
    drifting = noisy.copy()
    drifting[:, 2] += np.linspace(0, 15, 40)
    assert reasons(pose("flat"), readings(drifting, rate_hz=30)).startswith("the hand moved: I_MCP by ")


@pytest.mark.parametrize("moves", [False, True])
def test_a_jump_in_the_middle_is_named_with_its_time(moves: bool) -> None:
    step = touch_steps()[0] if moves else pose("flat")
    values = swinging([2]) if moves else still()
    values[60:, 2] += 40
    told = reasons(step, readings(values))
    assert told.startswith("sensor I_MCP jumped by ")
    assert told.endswith(" % of its range after 0.6 s: a loose wire, or the glove slipped.")


def test_one_bad_frame_is_a_jump() -> None:
    values = still()
    values[30, 3] = 255.0
    assert reasons(pose("flat"), readings(values)).startswith("sensor P_MCP jumped by 155 %")


def test_missing_frames_are_counted() -> None:
    frames = readings(still())
    assert reasons(pose("flat"), frames[::2]) == "49 of 99 frames did not arrive."
    assert reasons(pose("flat"), frames[:50] + frames[55:]) == ""
    assert reasons(pose("flat"), frames[:5]) == "only 5 frames came; 10 are needed."
    late = [
        GloveReading(f.time_s + (0.5 if f.sequence > 50 else 0), f.sequence, "r", f.values) for f in frames
    ]
    assert reasons(pose("flat"), late) == "the glove was silent for 0.5 s."
    restarted = frames[:50] + [GloveReading(f.time_s, f.sequence, "s", f.values) for f in frames[50:]]
    assert reasons(pose("flat"), restarted) == "the capture daemon was started again meanwhile."


def test_what_had_to_move_and_did_not_is_named() -> None:
    step = widget_step("TI_ABD", 20.0, ("T_TMC", "I_MCP"))
    assert reasons(step, readings(swinging([0, 2]))) == ""
    assert reasons(step, readings(swinging([0]))).startswith("I_MCP went through 0 % of its range only")


def test_a_glove_of_the_other_hand_moves_the_wrong_end() -> None:
    step = widget_step("TI_ABD", 20.0, ("T_TMC",))
    assert "a glove of the other hand?" in reasons(step, readings(swinging([3, 4])))


def test_a_dead_sensor_is_named_at_the_start() -> None:
    assert reasons(STEPS[0], readings(swinging([0, 1, 2, 3]))) == (
        "sensor P_PIP did not move (0 from lowest to highest reading): is it plugged in?"
    )


def test_a_touch_that_never_happened() -> None:
    step = touch_steps()[0]
    frames = readings(swinging([2]))
    assert reasons(step, frames, flat=dict.fromkeys(SENSORS, 60.0)) == ""
    assert "it did not touch the thumb" in reasons(step, frames, flat=dict.fromkeys(SENSORS, 100.0))
    assert reasons(rod_step(60.0), frames, flat=None) == ""


class NeverTouching:
    def learn(self, state, step, readings) -> None:
        pass

    def why_not(self, state, step, readings) -> str:
        return f"the tips of {step.touches} stay 9 mm apart."


def test_the_touch_check_of_inverse_kinematics_has_the_last_word(bench) -> None:
    step = Step("touch", "ik", "move", "Touch.", 3.0, "touch", moves=("I_MCP",), touches=("T", "I"))
    it: Bench = bench((STEPS[0], step))
    it.sampling._touch_check = NeverTouching()
    it.event("go")
    it.pass_time(5.9, moving)
    it.event("go")
    it.pass_time(5.2, moving)
    assert it.state.attempts[-1].reasons == ("the tips of ('T', 'I') stay 9 mm apart.",)


def test_widgets_that_agree() -> None:
    assert inconsistent_widgets("IM_ABD", {0: 100, 10: 121, 20: 139, 30: 161}) is None
    assert inconsistent_widgets("IM_ABD", {0: 100, 10: 121}) is None
    assert inconsistent_widgets("IM_ABD", {0: 160, 10: 140, 20: 121}) is None


@pytest.mark.parametrize(
    ("told", "named"),
    [
        ({0: 100, 10: 120, 20: 140, 5: 160}, "IM_ABD at 5 degrees reads like about 30 degrees"),
        ({0: 100, 10: 160, 20: 140, 30: 162}, "IM_ABD at 10 degrees reads like about 29 degrees"),
        ({0: 100, 10: 120, 20: 110}, "IM_ABD at 0, 10, 20 degrees: the sensor neither rises nor falls"),
    ],
)
def test_a_widget_with_a_wrong_angle_is_named(told, named) -> None:
    assert (inconsistent_widgets("IM_ABD", told) or "").startswith(named)


def test_the_angle_of_a_widget_is_corrected_when_the_step_is_done_again(bench) -> None:
    steps = (STEPS[0], widget_step("I_MCP", 10.0, ("I_PIP",)))
    it: Bench = bench(steps)
    it.event("skip")
    it.event("redo", step="I_MCP+10", angle_deg=20.0)
    assert it.state.now().angles == {"I_MCP": 20.0}
    assert it.state.now().needs == "the 20 degree widget"
    for step, angle in (("loosen", 20.0), ("I_MCP+10", 500.0), ("I_MCP+10", float("nan"))):
        with pytest.raises(BadInput, match=r"widget"):
            it.event("redo", step=step, angle_deg=angle)
