"""A whole guided sampling with a simulated person and a clock of its own: minutes pass in a second."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.skeleton import Skeleton
from glovecal_models.sampling.engine import Sampling, begin_sampling
from glovecal_models.sampling.protocol import Protocol, Step
from glovecal_models.sampling.state import OVER, Choose, GloveReading, SamplingState
from glovecal_models.sampling.verdict import TouchCheck
from glovecal_models.simulation.simulated_glove import SimulatedGlove
from glovecal_models.simulation.simulated_hand import DRIVEN, ROTATIONS
from glovecal_models.simulation.touching import AskedHand, RealTouches
from glovecal_models.takes.take import Take

RECORDING = "whole"
LONGEST_S = 900.0
AT_ONCE_S = 0.05
Disturb = Callable[[SamplingState, GloveReading], GloveReading | None]
"""What a fault makes of a frame; None: it never arrives."""


@dataclass(frozen=True)
class AskedSession:
    state: SamplingState
    take: Take
    """All frames, as the recorder would have kept them."""
    truth: np.ndarray
    """Shape (N, R), degrees, in the order of the layout's rotations."""


def asked_session(
    protocol: Protocol,
    glove: SimulatedGlove,
    *,
    seed: int = 0,
    rate_hz: float = 60.0,
    disturb: Disturb | None = None,
    touch_check: TouchCheck | None = None,
    choose: Choose | None = None,
    does: Callable[[Step], Step] = lambda step: step,
    patience: int = 3,
    skeleton: Skeleton | None = None,
    at_once_s: float = AT_ONCE_S,
) -> AskedSession:
    """Run the protocol on its timer. A step that is bad ``patience`` times is left out. Raises BadInput when
    it does not come to an end. ``does``: what the person does who is asked for a step. ``skeleton``: the
    person's hand, where tips shall really touch. ``at_once_s``: how often the person listens;
    0.2 s is a quick person's reaction, and costs half the time."""
    state = begin_sampling(protocol, glove.sensors, trigger="timer", counts=glove.layout.counts)
    sampling = Sampling(state, touch_check=touch_check, choose=choose)
    sampling.recording = RECORDING
    touches = None if skeleton is None else RealTouches(glove.hand, skeleton)
    hand, random = AskedHand(seed, touches), np.random.default_rng([seed, 43, glove.wearing])
    order = [ROTATIONS.index(rotation) for rotation in glove.rotations]
    truths, frames = [], []
    chunk = max(1, round(at_once_s * rate_hz))
    for first in range(0, round(LONGEST_S * rate_hz), chunk):
        time_s = np.arange(first, first + chunk) / rate_hz
        hand.ask(does(state.now()) if state.step else None, float(time_s[0]))
        truth = glove.hand.complete(dict(zip(DRIVEN, hand.driven(time_s).T, strict=True)))[:, order]
        for number, at_s, values in zip(
            range(first, first + chunk), time_s.tolist(), glove.readings(truth, random), strict=True
        ):
            reading: GloveReading | None = GloveReading(at_s, number, "run", values)
            reading = reading if disturb is None else disturb(state, reading)
            if reading is not None:
                sampling.frame(at_s, reading)
                frames.append(reading)
                truths.append(truth[number - first])
            sampling.tick(at_s)
        tries = [attempt for attempt in state.attempts if attempt.step == state.step]
        if state.phase == "judged" and len(tries) >= patience and not tries[-1].counts:
            sampling.event(float(time_s[-1]), "skip")
        if state.phase in OVER:
            return AskedSession(state, _take(glove, frames), np.array(truths))
    raise BadInput(f"protocol {protocol.name} did not end in {LONGEST_S:g} s; it stands at {state.step}")


def _take(glove: SimulatedGlove, frames: list[GloveReading]) -> Take:
    return Take(
        name=RECORDING,
        wearing=f"wearing-{glove.wearing}",
        sensors=glove.sensors,
        time_s=np.array([frame.time_s for frame in frames]),
        readings=np.array([frame.values for frame in frames], float),
        simulated=True,
    )
