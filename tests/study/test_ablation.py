"""What a rule is worth: the same as a diagnosis without it from the start, and counted in verdicts."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from ablation import round_of_gloves
from ablation_answer import AFTER, OFF, ablation
from ablation_page import ablation_page
from blind_glove import BlindGlove
from diagnosis_answer import verdict
from intervals import clopper_pearson

from glovecal_models.diagnosis.diagnose import asked, concluded
from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS
from glovecal_models.diagnosis.rules import RULES, states
from glovecal_models.diagnosis.state import Choices, State
from glovecal_models.limit import with_limits
from glovecal_models.simulation.causes.form import Cause

SLIPS = BlindGlove(
    "ablation", "garment_slip", 1, 2.6, seed=4, causes=(Cause("garment_slip", strength_deg=2.0),),
    rate_hz=30.0, joints=("I_MCP", "I_PIP"), take_s=20.0,
)  # fmt: skip


@pytest.fixture(scope="module")
def found() -> Any:
    takes = SLIPS.takes
    return takes, ablation(takes, SLIPS.layout, Choices())


def test_a_rule_left_out_of_what_follows_its_evidence_is_one_left_out_from_the_start(found: Any) -> None:
    takes, whole = found
    fired = [name for name in whole.without if name not in OFF]
    assert fired
    for name in fired:
        begun = asked(takes, SLIPS.layout, Choices(without=frozenset({name})))
        *_, ended = states(begun)
        direct = concluded(ended)
        assert verdict(whole.without[name]) == verdict(direct)
        assert whole.without[name].residual == direct.residual


def test_limits_that_are_switched_off_are_limits() -> None:
    for values in OFF.values():
        assert with_limits(DIAGNOSIS_LIMITS, values) != DIAGNOSIS_LIMITS
    assert set(AFTER) <= set(State.__dataclass_fields__)


def told(first: str, *others: str, alarm: bool = False) -> dict[str, Any]:
    return {"first": first, "confidence_set": [first, *others] if first != "nothing" else [], "alarm": alarm}


def test_the_page_counts_what_a_rule_puts_right_and_what_it_spoils() -> None:
    glove = BlindGlove("ablation", "creep", 1, 1.3, 1, causes=(Cause("creep"),))
    helped = {"with": told("creep"), "fired": ["rank", "lookalikes"], "without": {"lookalikes": told("lag")}}
    hurt = {"with": told("lag"), "fired": ["lookalikes"], "without": {"lookalikes": told("creep", "lag")}}
    second = {"with": told("nothing"), "fired": ["any_form"], "without": {"any_form": told("humidity")}}
    rows = [
        (glove, {"right": ["creep"], "alone": helped, "known": ["creep"], "beside": second}),
        (replace(glove, set_aside=True), {"right": ["creep"], "alone": hurt}),
    ]
    page = ablation_page(rows, [], "a" * 64)
    lookalikes = next(line for line in page.splitlines() if line.startswith("| `lookalikes`"))
    assert "| 1, 1, 0 | +1 -1 | +1 -1 | +1 -1 | +1 -0 |" in lookalikes
    assert "+100.0 % (-95.0 to +100.0 %) | -100.0 % (-100.0 to +95.0 %) |" in lookalikes
    any_form = next(line for line in page.splitlines() if line.startswith("| `any_form`"))
    assert "| 1, 0, 0 | +1 -0 |" in any_form
    for rule in RULES:
        assert f"- `{rule.name}`: " in page


def test_exact_intervals() -> None:
    assert clopper_pearson(0, 10) == pytest.approx((0.0, 0.3085), abs=1e-4)
    assert clopper_pearson(10, 10) == pytest.approx((0.6915, 1.0), abs=1e-4)
    assert clopper_pearson(0, 0) == (0.0, 1.0)


def test_a_round_has_something_of_everything() -> None:
    gloves = round_of_gloves(0)
    assert {glove.set_aside for glove in gloves} == {False, True}
    assert {"none", "lag", "garment_slip"} <= {glove.truth for glove in gloves}
    assert any("+" in glove.truth for glove in gloves)
    assert any(glove.truth.startswith("unknown:") for glove in gloves)
    several = [glove.key for number in range(3) for glove in round_of_gloves(number)]
    assert len(set(several)) == len(several)
