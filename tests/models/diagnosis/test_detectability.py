"""Laws of trials with effects put into one's own session; the session is simulated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glovecal_models.diagnosis.detectability.answer import (
    Control,
    EffectDetectability,
    Outcome,
    SizeTried,
    Trial,
)
from glovecal_models.diagnosis.detectability.confusability import confusability
from glovecal_models.diagnosis.detectability.detection import Detection, trial
from glovecal_models.diagnosis.detectability.injection import injected, injected_takes, why_not_injected
from glovecal_models.diagnosis.detectability.surrogate_session import SurrogateSession
from glovecal_models.diagnosis.model_on_takes import ModelOnTakes
from glovecal_models.diagnosis.problem import DiagnosisProblem
from glovecal_models.diagnosis.resampled import SMOOTHING
from glovecal_models.effects.catalogue import catalogue, declared_effect, effect
from glovecal_models.errors import BadInput
from glovecal_models.layout import Layout
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan

SENSORS = ("I_MCP", "I_PIP")
LAYOUT = Layout.from_columns("two", SENSORS, SENSORS)
PLAN = SessionPlan(seed=7, sensors=SENSORS, wearings=3, takes_per_wearing=3, take_s=15.0)


@pytest.fixture(scope="module")
def session() -> SurrogateSession:
    return SurrogateSession.of(ModelOnTakes(record_session(PLAN).takes, LAYOUT))


def errors(session: SurrogateSession, takes, smoothing: int = 1) -> list[float]:
    """RMS of what the static map leaves on every measured row, degrees."""
    design = DiagnosisProblem.of(takes, LAYOUT, False, ()).design(smoothing, 1)
    left = [
        np.concatenate([unit.target - products.fitted(unit.base) for unit in products.units])
        for products in design.products
    ]
    return [float(np.sqrt(np.mean(part**2))) for part in left]


def test_without_noise_and_effect_readings_are_perfect(session):
    assert max(errors(session, session.takes({}), SMOOTHING)) < 0.05
    assert min(errors(session, session.on.takes, SMOOTHING)) > 0.25


def test_with_its_own_noise_the_session_is_the_recorded_one(session):
    same = session.takes({}, session.residual)
    for take, recorded in zip(same, session.on.takes, strict=True):
        np.testing.assert_allclose(take.readings, recorded.readings, atol=1e-9)


def test_noise_of_other_moments_is_as_large(session):
    takes = injected_takes(session, None, np.random.default_rng(3))
    assert errors(session, takes) == pytest.approx(errors(session, session.on.takes), rel=0.1)
    other = injected_takes(session, None, np.random.default_rng(4))
    assert not np.array_equal(takes[0].readings, other[0].readings)


@pytest.mark.parametrize(
    "name", ["hysteresis", "creep", "lag", "temperature", "cross_coupling", "clock_offset"]
)
def test_an_effect_is_put_in_at_the_size_asked_for(session, name):
    takes = session.takes(
        *(item.added, None, item.delays_s)
        if (item := injected(session, effect(name), ["I_PIP"], 2.0, np.random.default_rng(5)))
        else ({},)
    )
    assert errors(session, takes)[1] == pytest.approx(2.0, rel=0.25)
    if name != "clock_offset":
        assert errors(session, takes, SMOOTHING)[0] < 0.05


def test_a_large_effect_is_named_and_nothing_is_not(session):
    found = trial(session, effect("hysteresis"), ["I_PIP"], 4.0)
    assert found == Trial("named", ("hysteresis",))
    assert trial(session, effect("hysteresis"), ["I_PIP"], 4.0) == found, "the same seed, the same trial"
    nothing = trial(session, None, (), 0.0)
    assert nothing is not None
    assert nothing.named == ()


def test_an_effect_hidden_in_the_residuals_is_not_carried_along():
    """A hysteresis of 3 degrees in the recording: the trial with nothing put in does not find it."""
    takes = record_session(PLAN, [Cause("hysteresis", strength_deg=3.0)]).takes
    nothing = trial(SurrogateSession.of(ModelOnTakes(takes, LAYOUT)), None, (), 0.0)
    assert nothing is not None
    assert nothing.named == ()


def test_an_effect_of_ones_own_is_put_in_and_found(session):
    own = declared_effect("name = bent_hinge; columns = own * own; unit = deg")
    assert why_not_injected(session, own) is None
    assert injected(session, own, ["I_PIP"], 1.0, np.random.default_rng(0)) is None, "the static map has it"
    own = declared_effect("name = ripple; columns = sin(10 * own); unit = deg")
    with_own = replace(session, on=replace(session.on, own=(own,)))
    found = trial(with_own, own, SENSORS, 4.0)
    assert found is not None
    assert found.outcome == "named", found.named


def test_what_cannot_be_put_in_says_why(session):
    why = {name: why_not_injected(session, item) for name, item in catalogue().items()}
    assert why["hysteresis"] is None
    assert why["clock_offset"] is None
    assert "signature" in str(why["saturation"])
    assert why["contact_pressure"] == "no context column c.contact_n was recorded"
    assert "absence" in str(why["no_effect"])
    [found] = Detection(session.on, ["saturation"], trials=1).answered().effects
    assert found.sizes == ()
    assert "cannot be tried" in found.sentence
    shared = Layout.from_columns("shared", SENSORS, ("BEND", "SPREAD"))
    renamed = [replace(take, rotations=("BEND", "SPREAD")) for take in session.on.takes]
    without = SurrogateSession.of(ModelOnTakes(tuple(renamed), shared))
    assert why_not_injected(without, effect("hysteresis")) == "no rotation has a working sensor of its own"
    [found] = Detection(without.on, ["hysteresis"], trials=1).answered().effects
    assert found.sizes == ()
    with pytest.raises(BadInput, match="no rotation 'R_PIP' in this layout"):
        Detection(session.on, ["hysteresis"], [("R_PIP",)]).require()
    with pytest.raises(BadInput, match="too many"):
        Detection(session.on, sizes_deg=range(1, 50), trials=50).require()


def test_alike_effects_are_listed_and_an_effect_is_most_like_itself(session):
    found = confusability(session.problem, [effect("creep"), effect("creep")])
    assert found.pairs == () or found.pairs[0].correlation == pytest.approx(1.0)
    found = confusability(session.problem)
    pair = found.pairs[0]
    assert set(pair.effects) == {"clock_offset", "glove_latency"}
    assert pair.correlation == pytest.approx(1.0)
    assert pair.is_confused
    assert pair.next_take is not None
    assert all(0 <= pair.correlation <= 1 + 1e-9 for pair in found.pairs)
    assert found.condition["I_PIP"] is None
    assert 1 < (found.condition_of_others["I_PIP"] or 0) < 1e6
    assert "clock_offset and glove_latency" in found.sentences[0]


def tried(size_deg: float, *outcomes: Outcome) -> SizeTried:
    return SizeTried.of(size_deg, [Trial(item, ("creep",)) for item in outcomes], "hysteresis")


def test_sizes_are_interpolated_over_monotone_shares():
    found = EffectDetectability(
        "hysteresis",
        ("I_PIP",),
        (
            tried(1.0, "not_found", "not_found"),
            tried(2.0, "named", "not_found"),
            tried(4.0, "named", "named"),
        ),
    )
    assert found.size_deg(0.5, "named") == pytest.approx(2.0)
    assert found.size_deg(0.75, "named") == pytest.approx(2.0 * 2**0.5)
    assert found.sentence == (
        "hysteresis on I_PIP: 4 degrees would have been named (2 of 2 trials), 1 degree would not"
        " (0 of 2 trials)."
    )
    wavy = EffectDetectability("lag", (), (tried(1.0, "named"), tried(2.0, "not_found"), tried(4.0, "named")))
    assert wavy.size_deg(0.5, "named") == 1.0
    assert wavy.size_deg(0.8, "named") == pytest.approx(2.0 * 2**0.6)
    assert EffectDetectability("lag", (), (tried(1.0, "mistaken"),)).size_deg(0.5, "named") is None
    control = Control.of([Trial("mistaken", ("creep", "lag")), Trial("not_found", ())])
    assert control.named == {"creep": 1}
