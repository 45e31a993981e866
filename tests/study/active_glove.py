"""One simulated glove sampled in several ways, and how wrong its models are after equal capture time."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from asked_session import RECORDING, AskedSession, asked_session
from assumed_angles import assumed_angles

from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.errors import NotTrainable
from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG
from glovecal_models.layout import Layout
from glovecal_models.sampling.active.known_readings import known_from_takes
from glovecal_models.sampling.active.next_step import NextStep, candidate_steps
from glovecal_models.sampling.catalogue import make_protocol
from glovecal_models.sampling.guided.guided_calibration import guided_calibration
from glovecal_models.sampling.guided.labelled_takes import LabelledTake
from glovecal_models.sampling.protocol import Protocol
from glovecal_models.sampling.sampled_takes import sampled_takes
from glovecal_models.sampling.state import Choose, GloveReading, NextSteps, SamplingState
from glovecal_models.simulation.protocol import evaluation_segment, free_segment
from glovecal_models.simulation.simulated_glove import SimulatedGlove, SimulatedTake, simulate_take

FULL_S = 252.0
SHARES = (0.4, 0.5, 0.6, 0.7, 0.8)
"""Of the fixed protocol's capture time, at which models are compared; its end is one more."""
FREE_S = 40.0
GROWING_WAYS = ("any step", "active")
"""Whose protocols choose step by step, and may be stopped at any time."""
WAYS = ("fixed", "fixed, any order", *GROWING_WAYS)


@dataclass(frozen=True)
class ActiveGlove:
    seed: int
    most_s: float = math.inf
    """Capture time after which growing protocols ask for nothing more."""


def glove_answer(glove: ActiveGlove, ways: Sequence[str] = WAYS) -> dict[str, Any]:
    """Points of every way: capture seconds, samples, errors in degrees."""
    worn = SimulatedGlove(glove.seed)
    tests = [
        simulate_take(worn, segment, seed=900 + glove.seed, rate_hz=60)
        for segment in (evaluation_segment(900 + glove.seed), free_segment(900 + glove.seed, FREE_S))
    ]
    return {way: list(_points(way, worn, glove, tests)) for way in ways}


def _points(
    way: str, worn: SimulatedGlove, glove: ActiveGlove, tests: list[SimulatedTake]
) -> Iterator[dict[str, Any]]:
    session, ends = sampled(way, worn, glove.seed, glove.most_s)
    whole = session.state.capture_s
    cuts = [share * FULL_S for share in SHARES if share * FULL_S < whole] if way != "fixed" else []
    for cut_s in [*cuts, whole]:
        attempts = [each for each, at in zip(session.state.attempts, ends, strict=True) if at <= cut_s]
        taught = _taught(session, replace(session.state, attempts=attempts))
        loosen = session.state.finished()["loosen"]
        yield {"capture_s": cut_s, "is_end": cut_s == whole, **_errors(worn, taught, tests, session, loosen)}


def sampled(
    way: str, worn: SimulatedGlove, seed: int, most_s: float = math.inf
) -> tuple[AskedSession, list[float]]:
    """The session, and the capture time at which each attempt ended."""
    ends: list[float] = []

    def watch(state: SamplingState, reading: GloveReading) -> GloveReading:
        ends.extend([state.capture_s] * (len(state.attempts) - len(ends)))
        return reading

    protocol, choose = _protocol(way, worn.layout, np.random.default_rng([seed, 77]))
    choose = choose and _until(choose, most_s)
    session = asked_session(protocol, worn, seed=seed, choose=choose, disturb=watch)
    return session, ends + [session.state.capture_s] * (len(session.state.attempts) - len(ends))


def _protocol(way: str, layout: Layout, random: np.random.Generator) -> tuple[Protocol, Choose | None]:
    if way == "active":
        return make_protocol("active", layout), NextStep(layout)
    if way == "any step":
        return make_protocol("active", layout), _at_random(candidate_steps(layout), random)
    fixed = make_protocol("fk_only", layout)
    if way == "fixed":
        return fixed, None
    first, rest, last = fixed.steps[:3], list(fixed.steps[3:-2]), fixed.steps[-2:]
    order = [rest[place] for place in random.permutation(len(rest))]
    return replace(fixed, steps=(*first, *order, *last)), None


def _at_random(steps: list, random: np.random.Generator) -> Callable[[SamplingState], NextSteps]:
    """Candidates of the active protocol in any order, none twice, for as long as the fixed protocol takes."""
    waiting = [steps[place] for place in random.permutation(len(steps))]

    def choose(state: SamplingState) -> NextSteps:
        over = not waiting or state.capture_s > FULL_S
        return NextSteps((), True, "") if over else NextSteps((waiting.pop(),), False, "")

    return choose


def _until(choose: Choose, most_s: float) -> Choose:
    """Nothing more after ``most_s`` of capture."""
    return lambda state: NextSteps((), True, "") if state.capture_s > most_s else choose(state)


def _taught(session: AskedSession, state: SamplingState) -> list[LabelledTake]:
    return [LabelledTake.of(each) for each in sampled_takes(state, {RECORDING: session.take}, name="s")]


def _errors(
    worn: SimulatedGlove,
    taught: list[LabelledTake],
    tests: list[SimulatedTake],
    session: AskedSession,
    loosen: Any,
) -> dict[str, Any]:
    """RMSE over the rotations that sensors read; one without a model counts as the middle of its range."""
    frames = session.take.time_s
    moving = (frames >= loosen.begins_s) & (frames <= loosen.ends_s)
    free = replace(session.take, time_s=frames[moving], readings=session.take.readings[moving])
    takes = [each.take for each in taught if each.take.rotations]
    known = known_from_takes(takes, worn.sensors, [free])
    answer: dict[str, Any] = {
        "samples": sum(
            int(np.isfinite(take.reference_at_frames(take.rotations)).any(1).sum()) for take in takes
        )
    }
    predictor = _trained(taught, worn.layout)
    for name, test in zip(("poses_deg", "free_deg"), tests, strict=True):
        readings = test.take.readings
        assumed = assumed_angles(worn.layout, known, readings)
        trained = {} if predictor is None else _columns(predictor, readings)
        for how, angles in (("trained", trained), ("assumed", assumed)):
            answer[f"{how}_{name}"] = _rmse(worn, angles, test.truth)
    return answer


def _trained(taught: list[LabelledTake], layout: Layout) -> GlovePredictor | None:
    """As ``glovecal train`` does it."""
    try:
        return GlovePredictor(guided_calibration(taught, layout, "s", None).model)
    except NotTrainable:
        return None


def _columns(predictor: GlovePredictor, readings: np.ndarray) -> dict[str, np.ndarray]:
    return dict(zip(predictor.rotations, predictor.predict(readings).mean.T, strict=True))


def _rmse(worn: SimulatedGlove, angles: dict[str, np.ndarray], truth: np.ndarray) -> float:
    squares = []
    for item in worn.layout.correspondences:
        if item.simulated is None and item.kind != "MSMR":
            middle = np.full(len(truth), np.mean(ACTIVE_RANGE_DEG[item.rotation]))
            true = truth[:, worn.rotations.index(item.rotation)]
            squares.append(np.mean((angles.get(item.rotation, middle) - true) ** 2))
    return float(np.sqrt(np.mean(squares)))
