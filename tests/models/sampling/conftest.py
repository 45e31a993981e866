"""A glove of two sensors whose every frame a test decides, on a clock that a test turns."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from glovecal_models.sampling.engine import Sampling, begin_sampling
from glovecal_models.sampling.protocol import Protocol, Step
from glovecal_models.sampling.state import GloveReading, SamplingState

RATE_HZ = 50
STILL = (100.0, 50.0)


class Bench:
    """``sampling`` and the clock that drives it."""

    def __init__(self, sampling: Sampling) -> None:
        self.sampling = sampling
        self.now_s = sampling.state.since_s
        self.sequence = 0

    @property
    def state(self) -> SamplingState:
        return self.sampling.state

    def pass_time(
        self,
        seconds: float,
        hand: Callable[[float], tuple[float, float]] | None = lambda at_s: STILL,
        **frame,
    ) -> str:
        """Frames of ``hand`` (None: no frames) for so long; the phase at the end."""
        for _ in range(round(seconds * RATE_HZ)):
            self.now_s += 1 / RATE_HZ
            self.sequence += 1
            if hand is not None:
                self.send(hand(self.now_s), **frame)
            self.sampling.tick(self.now_s)
        return self.state.phase

    def send(self, values: tuple[float, ...], **frame) -> None:
        own = {"time_s": 1000 + self.now_s, "sequence": self.sequence, "run": "r"} | frame
        self.sampling.frame(self.now_s, GloveReading(values=np.array(values), **own))

    def event(self, name: str, **more) -> str:
        self.sampling.event(self.now_s, name, **more)
        return self.state.phase


def moving(at_s: float) -> tuple[float, float]:
    """Both sensors through most of 200 readings, slower than a hand can."""
    return (100 + 90 * np.sin(4 * at_s), 100 + 90 * np.cos(3 * at_s))


def pose(name: str) -> Step:
    return Step(name, "fk_independent", "hold", f"Do {name}.", 1.0, "poses", pose=name, angles={"I_MCP": 5.0})


STEPS = (
    Step("loosen", "range", "move", "Move.", 3.0, "loosen"),
    pose("flat"),
    pose("fist"),
    pose("spread"),
)


@pytest.fixture
def bench() -> Callable[..., Bench]:
    def make(steps: tuple[Step, ...] = STEPS, **options) -> Bench:
        protocol = Protocol("test", steps)
        return Bench(Sampling(begin_sampling(protocol, ("I_MCP", "I_PIP"), counts=(0, 255), **options)))

    return make


@pytest.fixture
def ready(bench: Callable[..., Bench]) -> Bench:
    """After the first step, which shows the sensors' range; the pose ``flat`` is asked for."""
    made = bench()
    made.event("go")
    assert made.pass_time(5.2, moving) == "judged"
    assert made.pass_time(0.7) == "waiting"
    return made
