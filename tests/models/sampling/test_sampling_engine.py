"""Every transition of the protocol, by a clock that the test turns."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glovecal_models.errors import BadInput
from glovecal_models.sampling.engine import EVENTS, NotNow, Sampling, begin_sampling
from glovecal_models.sampling.protocol import Protocol
from glovecal_models.sampling.state import GloveReading, SamplingState

from .conftest import STEPS, STILL, Bench, moving


def test_a_step_goes_from_waiting_to_judged(ready: Bench) -> None:
    assert (ready.state.step, ready.state.said) == ("flat", "Step 2 of 4. Do flat.")
    assert ready.pass_time(5.0) == "waiting"
    assert ready.event("go") == "countdown"
    assert ready.pass_time(1.9) == "countdown"
    assert ready.pass_time(0.15) == "settling"
    assert ready.pass_time(0.6) == "recording"
    assert ready.state.said == "Hold still."
    assert ready.pass_time(1.0) == "judged"
    attempt = ready.state.attempts[-1]
    assert (attempt.step, attempt.outcome, attempt.reasons) == ("flat", "good", ())
    assert attempt.means == {"I_MCP": 100.0, "I_PIP": 50.0}
    assert attempt.begins_s is not None
    assert attempt.ends_s is not None
    assert attempt.ends_s - attempt.begins_s == pytest.approx(1.0, abs=0.05)
    assert ready.pass_time(0.7) == "waiting"
    assert ready.state.step == "fist"


def do_step(bench: Bench, hand=lambda at_s: STILL) -> None:
    bench.event("go")
    bench.pass_time(4.5, hand)


def test_a_hand_that_does_not_rest_is_not_recorded(ready: Bench) -> None:
    ready.event("go")
    assert ready.pass_time(9.0, moving) == "settling"
    assert ready.pass_time(2.0, moving) == "judged"
    assert ready.state.attempts[-1].reasons[0].startswith("the hand did not come to rest (")
    assert ready.state.said.startswith("Repeat: ")
    assert ready.pass_time(20.0) == "judged"
    assert ready.event("go") == "countdown"


def test_a_hand_that_moves_while_recorded_is_named(ready: Bench) -> None:
    ready.event("go")
    ready.pass_time(2.8)
    ready.pass_time(1.0, lambda at_s: (100 + 20 * np.sin(6 * at_s), 50))
    (reason,) = ready.state.attempts[-1].reasons
    assert reason.startswith("the hand moved: I_MCP by ")


def test_redo_replaces_and_undo_brings_back(ready: Bench) -> None:
    do_step(ready)
    assert ready.state.step == "fist"
    assert ready.event("redo") == "waiting"
    assert ready.state.step == "flat"
    do_step(ready, lambda at_s: (120, 60))
    assert ready.state.step == "fist"
    assert ready.state.finished()["flat"].means["I_MCP"] == 120
    ready.event("undo")
    assert ready.state.finished()["flat"].means["I_MCP"] == 100
    assert ready.state.step == "fist"
    ready.event("undo")
    assert ready.state.step == "flat"
    ready.event("undo")
    assert ready.state.step == "loosen"
    with pytest.raises(NotNow, match="nothing to undo"):
        ready.event("undo")


def test_a_step_that_cannot_be_done_is_left_out_with_a_mark(ready: Bench) -> None:
    ready.event("skip")
    assert ready.state.step == "fist"
    assert ready.state.finished()["flat"].outcome == "skipped"
    ready.event("undo")
    assert ready.state.step == "flat"


def test_pause_and_resume_begin_the_step_again(ready: Bench) -> None:
    ready.event("go")
    ready.pass_time(2.8)
    assert ready.event("pause") == "paused"
    assert ready.pass_time(60.0, None) == "paused"
    with pytest.raises(NotNow, match="paused"):
        ready.event("go")
    assert ready.event("resume") == "waiting"
    assert ready.pass_time(0.5) == "waiting"
    assert ready.state.step == "flat"
    assert ready.state.attempts[-1].step == "loosen"


@pytest.mark.parametrize("how", ["pause", "kill", "lose"])
def test_a_good_verdict_stands_whatever_comes_next(ready: Bench, how: str) -> None:
    ready.event("go")
    assert ready.pass_time(3.7) == "judged"
    if how == "pause":
        ready.event("pause")
        ready.event("resume")
    elif how == "kill":
        ready.sampling.interrupted(ready.now_s)
    else:
        # Nothing more is heard: the verdict's moment passes first, then the next step waits for the glove.
        assert ready.pass_time(2.0, None) == "lost"
    assert ready.state.step == "fist"


def test_a_lost_glove_is_waited_for(ready: Bench) -> None:
    ready.event("go")
    ready.pass_time(2.7)
    assert ready.pass_time(0.9, None) == "recording"
    assert ready.pass_time(0.2, None) == "lost"
    assert ready.pass_time(600.0, None) == "lost"
    assert ready.pass_time(0.2) == "lost"
    assert ready.pass_time(0.3) == "waiting"
    assert ready.state.said == "Signal restored. Step 2 of 4. Do flat."
    do_step(ready)
    assert ready.state.step == "fist"


def test_the_gloves_button_is_go_and_only_when_it_goes_down(ready: Bench) -> None:
    assert ready.pass_time(0.02, button=True) == "countdown"
    ready.pass_time(4.5, button=True)
    assert (ready.state.phase, ready.state.step) == ("waiting", "fist")
    ready.pass_time(0.1, button=False)
    ready.pass_time(0.02, button=True)
    assert ready.state.phase == "countdown"


def test_on_the_timer_all_goes_by_itself(bench) -> None:
    it = bench(trigger="timer")
    hands = {"loosen": moving, "": lambda at_s: STILL}
    for _ in range(400):
        it.pass_time(0.1, hands.get(it.state.step, hands[""]))
    assert it.state.phase == "done"
    # 3 poses of countdown, settling, recording; the loosening has no settling.
    assert it.state.capture_s == pytest.approx(3 * 3.5 + 5.0, abs=0.3)


def test_a_still_hand_triggers_only_after_it_has_moved(bench) -> None:
    it = bench(trigger="still")
    assert it.pass_time(3.1, moving) == "countdown", "stillness cannot begin a motion"
    it.pass_time(5.9, moving)
    assert it.state.step == "flat"
    it.pass_time(1.0, moving)
    assert it.state.phase == "waiting"
    assert it.pass_time(1.3) == "recording"
    it.pass_time(1.8)
    assert (it.state.step, it.state.phase) == ("fist", "waiting")
    assert it.pass_time(5.0) == "waiting"


def test_stop_ends_it_and_nothing_can_follow(ready: Bench) -> None:
    assert ready.event("stop") == "stopped"
    for name in EVENTS:
        with pytest.raises(NotNow, match="too late"):
            ready.event(name)


def test_unknown_events_and_steps_change_nothing(ready: Bench) -> None:
    before = ready.state.to_document()
    for name, more in (("jump", {}), ("redo", {"step": "ok"}), ("go", {"step": "flat"})):
        with pytest.raises(BadInput):
            ready.event(name, **more)
    assert ready.state.to_document() == before


def test_after_a_kill_the_running_step_begins_again(ready: Bench) -> None:
    ready.event("go")
    ready.pass_time(3.0)
    document = json.loads(json.dumps(ready.state.to_document()))
    again = Bench(Sampling(SamplingState.from_document(document)))
    again.now_s = ready.now_s + 5
    again.sampling.interrupted(again.now_s)
    assert (again.state.phase, again.state.step) == ("waiting", "flat")
    do_step(again)
    assert again.state.step == "fist"


def test_a_document_of_another_version_is_refused(ready: Bench) -> None:
    with pytest.raises(BadInput, match="version 2"):
        SamplingState.from_document(ready.state.to_document() | {"version": 2})


def test_a_protocol_has_steps_of_different_names() -> None:
    with pytest.raises(BadInput, match="no step"):
        Protocol("empty", ())
    with pytest.raises(BadInput, match="two steps"):
        Protocol("twice", (STEPS[0], replace(STEPS[1], name="loosen")))


EVENT = st.sampled_from([*EVENTS, "still", "move", "nothing", "kill"])


@settings(max_examples=60)
@given(st.lists(st.tuples(EVENT, st.floats(0.02, 3.0)), max_size=25))
def test_whatever_happens_the_document_tells_all(happenings) -> None:
    """The phase is always one of the machine's, the step is the protocol's, and JSON holds everything."""
    state = begin_sampling(Protocol("p", STEPS), ("I_MCP", "I_PIP"), counts=(0, 255))
    bench = Bench(Sampling(state))
    for what, seconds in happenings:
        finished = set(bench.state.finished())
        if what in EVENTS:
            try:
                bench.event(what)
            except NotNow:
                continue
        elif what == "kill":
            document = json.loads(json.dumps(bench.state.to_document()))
            assert SamplingState.from_document(document).to_document() == bench.state.to_document()
            now_s = bench.now_s
            bench = Bench(Sampling(SamplingState.from_document(document)))
            bench.now_s = now_s
            bench.sampling.interrupted(now_s)
        else:
            bench.pass_time(seconds, {"still": lambda at_s: STILL, "move": moving, "nothing": None}[what])
        assert what == "undo" or finished <= set(bench.state.finished())
        over = bench.state.phase in ("done", "stopped")
        assert over or bench.state.step in [step.name for step in STEPS]
        assert (bench.state.phase == "done") <= (len(bench.state.finished()) == len(STEPS))


@given(st.lists(st.floats(-1e9, 1e9), min_size=1, max_size=4), st.booleans())
def test_frames_of_another_glove_or_out_of_order_do_no_harm(values, button) -> None:
    sampling = Sampling(begin_sampling(Protocol("p", STEPS), ("I_MCP", "I_PIP")))
    for time_s, sequence in ((5.0, 3), (4.0, 2), (5.0, 3), (6.0, 9)):
        sampling.frame(1.0, GloveReading(time_s, sequence, "r", np.array(values), button))
        sampling.tick(1.0)
    assert sampling.state.phase in ("waiting", "countdown")
