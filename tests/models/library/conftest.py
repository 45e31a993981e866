"""A small simulated session with sensors that stick, and what the library makes of it; made once."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from threadpoolctl import threadpool_limits

import glovecal

SAMPLES = 300


@pytest.fixture(scope="session")
def session() -> glovecal.Session:
    return glovecal.simulate("hysteresis", on=["I_PIP"], sensors=["I_MCP", "I_PIP"], seed=5)


@pytest.fixture(scope="session")
def takes(session: glovecal.Session) -> glovecal.Takes:
    return session.takes


@pytest.fixture(scope="session")
def model(takes: glovecal.Takes) -> glovecal.CalibrationModel:
    return glovecal.train(takes, subject="anna", samples=SAMPLES)


@pytest.fixture(scope="session")
def diagnosis(model: glovecal.CalibrationModel, takes: glovecal.Takes) -> glovecal.Diagnosis:
    return glovecal.diagnose(model, takes)


@pytest.fixture(scope="session")
def addition(
    model: glovecal.CalibrationModel, takes: glovecal.Takes, diagnosis: glovecal.Diagnosis
) -> glovecal.Addition:
    assert diagnosis.effect is not None
    return glovecal.add_effect(model, takes, diagnosis.effect, rotations=diagnosis.rotations, samples=SAMPLES)


@pytest.fixture(scope="session")
def improvement(takes: glovecal.Takes) -> glovecal.Improvement:
    return glovecal.improve(takes, subject="anna", samples=SAMPLES, max_steps=1)


@pytest.fixture
def one_thread() -> Iterator[None]:
    """The inner functions as the library calls them: two threads add up in another order."""
    with threadpool_limits(limits=1):
        yield


@pytest.fixture
def drawn() -> Iterator[None]:
    """Pictures without a screen, closed afterwards."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    yield
    pyplot.close("all")
