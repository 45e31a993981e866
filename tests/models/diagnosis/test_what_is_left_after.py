"""After an effect was added: what its unknown start leaves, and what a healthy glove slips by, is no more."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from glovecal_models.diagnosis.actions import Action
from glovecal_models.diagnosis.diagnose import diagnose
from glovecal_models.diagnosis.diagnosis import Diagnosis
from glovecal_models.diagnosis.known_effect import KnownEffect
from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS
from glovecal_models.diagnosis.residual_association import ResidualAssociation
from glovecal_models.diagnosis.text import diagnosis_sentences, residual_sentence
from glovecal_models.effects.base.assessment import HeldOutRmse
from glovecal_models.effects.catalogue import effect
from glovecal_models.layout import Layout
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_models.takes.take import Take

SENSORS = ("I_MCP", "I_PIP")
LAYOUT = Layout.from_columns("two", SENSORS, SENSORS)
CREEP = KnownEffect(effect("creep"), SENSORS, (np.array([0.75, 3.0, 12.0]),) * 2)
STICKS = KnownEffect(effect("hysteresis"), SENSORS, (np.array([8.0]),) * 2)
PULL = KnownEffect(effect("cross_coupling"), ("I_MCP",), (np.zeros(0),))


@pytest.fixture(scope="module")
def healthy() -> tuple[Take, ...]:
    plan = SessionPlan(seed=21, sensors=SENSORS, wearings=3, takes_per_wearing=4, take_s=20.0)
    return record_session(plan, ()).takes


def read_as(takes: Sequence[Take], counts: Sequence[np.ndarray]) -> list[Take]:
    """The takes with so many counts more on I_PIP."""
    more = np.array([0.0, 1.0])
    pairs = zip(takes, counts, strict=True)
    return [replace(take, readings=take.readings + part[:, None] * more) for take, part in pairs]


def from_before(takes: Sequence[Take]) -> list[np.ndarray]:
    """What a glove that creeps over most of a minute keeps of whatever its hand did before each take."""
    starts = np.random.default_rng(4).normal(size=len(takes))
    pairs = zip(takes, starts, strict=True)
    return [4.0 * start * np.exp(-(take.time_s - take.time_s[0]) / 45.0) for take, start in pairs]


def left_of(takes: Sequence[Take], *known: KnownEffect) -> Diagnosis:
    return diagnose(takes, LAYOUT, known=known, effects=[], signatures=False)


def test_what_the_unknown_start_of_a_memory_leaves_is_the_memorys(healthy):
    takes = read_as(healthy, from_before(healthy))
    assert left_of(takes).residual.is_significant, "without creep nothing explains it"
    found = left_of(takes, CREEP).residual
    assert not found.is_significant
    assert found.obstacle is None
    sentence = residual_sentence(found)
    assert sentence.startswith("What is left within takes after creep ")
    assert "Offsets of whole takes are not judged: creep remembers longer than these takes last" in sentence


def test_what_goes_on_within_takes_is_told_beside_a_memory(healthy):
    random = np.random.default_rng(5)
    pulls = [4.0 * wander(random, take) for take in healthy]
    found = left_of(read_as(healthy, pulls), CREEP).residual
    assert found.is_significant
    assert residual_sentence(found).startswith(
        "No known effect explains what is left within takes after creep"
    )


def wander(random: np.random.Generator, take: Take) -> np.ndarray:
    """Standard deviation 1, forgotten in 2 s."""
    keep = np.exp(-np.median(np.diff(take.time_s)) / 2.0)
    return np.sqrt(1 - keep**2) * lfilter([1], [1, -keep], random.normal(size=len(take.time_s) + 999))[999:]


def test_effects_that_forget_at_once_leave_all_to_be_judged(healthy):
    takes = read_as(healthy, from_before(healthy))
    found = left_of(takes, PULL).residual
    assert found.is_significant
    assert residual_sentence(found).startswith("No known effect explains what is left after cross_coupling: ")


def test_it_is_not_said_that_nothing_explains_what_an_effect_pays_on(healthy):
    found = left_of(read_as(healthy, from_before(healthy)), PULL).residual
    wearing = ResidualAssociation("I_PIP", "wearing", "the wearing", 2.0, 0.001)
    pays = Action(wearing, "donning_shift", rmse_deg=HeldOutRmse(3.0, 2.0, 3.1))
    assert residual_sentence(found, actions=[pays]).startswith(
        "On I_PIP donning_shift explains a part of what is left after cross_coupling: "
    )
    for no_help in (
        replace(pays, rmse_deg=HeldOutRmse(3.0, 2.9, 2.8)),
        replace(pays, is_of_known=True),
    ):
        assert residual_sentence(found, actions=[no_help]) == residual_sentence(found)


def warmed(takes: Sequence[Take], counts: float) -> list[Take]:
    """I_PIP reads so many counts more for a standard deviation of the recorded temperature."""
    columns = [take.context["temperature_c"] for take in takes]
    every = np.concatenate(columns)
    return read_as(takes, [counts * (part - every.mean()) / every.std() for part in columns])


@pytest.mark.parametrize(("counts", "is_named"), [(0.9, False), (6.0, True)])
def test_beside_an_effect_what_a_healthy_glove_slips_by_gets_no_name(healthy, counts, is_named):
    """A column that goes along with the slip of cloth, and one that measures a cause."""
    takes = warmed(healthy, counts)
    limits = replace(DIAGNOSIS_LIMITS, healthy_deg=1.0)
    found = diagnose(
        takes, LAYOUT, known=[PULL], effects=[effect("temperature")], signatures=False, limits=limits
    )
    assert [item.effect for item in found.naming.ranked] == ["temperature"] * is_named
    alone = diagnose(takes, LAYOUT, effects=[effect("temperature")], signatures=False)
    assert alone.naming.ranked, "a first effect may be as small"
    if not is_named:
        assert "temperature is not named: the slow error of I_PIP is" in " ".join(diagnosis_sentences(found))


@pytest.mark.parametrize("healthy_deg", [0.52, 1.0])
def test_beside_an_effect_a_slip_as_of_a_healthy_glove_is_not_found(healthy, healthy_deg):
    """I_PIP's error walks the same way in each wearing, a slow error of 0.8 degrees."""
    since = [number % 3 - 1.0 + (take.time_s - take.time_s[0]) / 60.0 for number, take in enumerate(healthy)]
    takes = read_as(healthy, [1.3 * part for part in since])
    limits = replace(DIAGNOSIS_LIMITS, healthy_deg=healthy_deg)
    alone, beside = (
        diagnose(takes, LAYOUT, known=known, effects=[], judge_residual=False, limits=limits)
        for known in ([], [PULL])
    )
    assert [item.effect for item in alone.findings] == ["garment_slip"], "a first effect may be as small"
    assert [item.effect for item in beside.findings] == ["garment_slip"] * (healthy_deg < 0.8)


def test_takes_that_a_sagging_supply_moves_apart_contradict_no_reference():
    plan = SessionPlan(seed=6, sensors=SENSORS, wearings=3, takes_per_wearing=3, take_s=12.0)
    cause = Cause("supply_sag", strength_deg=9.0, form="gain_power")
    takes = record_session(plan, (cause,)).takes
    untold = diagnose(takes, LAYOUT, effects=[], signatures=False, judge_residual=False)
    assert any("contradict each other" in problem for problem in untold.reference_problems)
    found = diagnose(takes, LAYOUT, effects=[effect("supply_sag")], signatures=False, judge_residual=False)
    assert found.naming.ranked
    assert found.reference_problems == ()


@pytest.mark.parametrize(("counts", "beside", "is_told"), [
    (1.35, (), True), (1.35, (PULL,), True), (1.35, (STICKS,), False), (1.5, (STICKS,), True),
])  # fmt: skip
def test_beside_an_effect_an_error_of_a_healthy_gloves_floors_is_not_called_unexplained(
    healthy, counts, beside, is_told
):
    """Takes read a little apart: as slips and the miss of a form do together. Another joint's effect misses
    nothing here."""
    apart = counts * np.random.default_rng(7).permutation(np.linspace(-1.5, 1.5, len(healthy)))
    takes = read_as(healthy, [np.full(len(take.time_s), at) for take, at in zip(healthy, apart, strict=True)])
    found = left_of(takes, *beside).residual
    assert found.is_significant == is_told
    assert found.obstacle is None


@pytest.mark.parametrize("delayed", [(), (Cause("clock_offset", strength_deg=1.5, form="constant"),)])
def test_what_is_left_of_a_hysteresis_of_another_form_is_no_delay(delayed):
    """Plays miss a part of Bouc's and Wen's; a delay beside it saves more than that part."""
    plan = SessionPlan(seed=4, sensors=SENSORS, wearings=2, takes_per_wearing=3, take_s=20.0)
    sticks = Cause("hysteresis", strength_deg=4.0, form="bouc_wen")
    takes = record_session(plan, (sticks, *delayed)).takes
    delays = [effect("clock_offset"), effect("lag")]
    found = diagnose(
        takes, LAYOUT, known=[STICKS], effects=delays, signatures=False, judge_residual=False
    )  # fmt: skip
    assert [item.effect for item in found.naming.ranked[:1]] == [item.name for item in delayed]
