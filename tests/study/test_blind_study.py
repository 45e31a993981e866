"""The blind study in short: strong effects get their names, healthy gloves none, and the marking is fair."""

from __future__ import annotations

from dataclasses import replace
from itertools import count

import pytest
from blind_glove import BlindGlove
from diagnosis_answer import NOTHING, diagnosis_answer
from finished_gloves import FinishedGloves
from further_forms import every_form
from glove_choices import clean, pair, with_cause
from study_parts import LARGE_SIZE, PARTS, StudyChoices

STRONG = ("hysteresis", "creep", "lag", "clock_offset", "warmup_drift", "cross_coupling")


def strong(effect: str) -> BlindGlove:
    """The first in a form that a session may draw by itself."""
    usual = {form.name for form in every_form(effect) if not form.set_aside and not form.only_by_name}
    made = (with_cause("short", effect, LARGE_SIZE, number) for number in count())
    return next(glove for glove in made if glove is not None and glove.causes[0].form in usual)


def short(glove: BlindGlove) -> BlindGlove:
    """Three quarters as long and at most 30 frames a second: strong effects need no more."""
    return replace(glove, take_s=30.0, rate_hz=min(glove.rate_hz, 30.0))


@pytest.mark.parametrize("effect", STRONG)
def test_a_strong_effect_is_named_first(effect):
    answer = diagnosis_answer(short(strong(effect)))
    assert answer["first"] == effect, answer["ranked"]
    assert effect in answer["confidence_set"]


@pytest.mark.parametrize("linear", [False, True])
def test_nothing_but_its_own_curve_is_named_on_a_healthy_glove(linear):
    answer = diagnosis_answer(short(clean(0, linear=linear)))
    assert answer["first"] in (NOTHING, "nonlinearity") if linear else answer["first"] == NOTHING


def test_set_aside_forms_are_used_only_when_asked_for():
    for aside in (False, True):
        choices = StudyChoices(gloves=2, set_aside=aside)
        gloves = [
            *PARTS["names"].gloves(choices),
            *(pair(number, 1.3, set_aside=aside) for number in range(3)),
        ]
        used = {(cause.name, cause.form) for glove in gloves for cause in glove.causes}
        assert {
            form.set_aside for name, chosen in used for form in every_form(name) if form.name == chosen
        } == {aside}


def test_finished_gloves_are_not_asked_again_unless_the_programs_change(tmp_path):
    glove = strong("lag")
    FinishedGloves(tmp_path, "names", "a" * 64).keep(glove.key, {"first": "lag"})
    again = FinishedGloves(tmp_path, "names", "a" * 64)
    assert again.get(glove.key) == {"first": "lag"}
    assert again.get(strong("creep").key) is None
    assert FinishedGloves(tmp_path, "names", "b" * 64).get(glove.key) is None
    with again.path.open("a") as file:
        file.write('{"glove": {"part"')  # stopped while writing
    assert FinishedGloves(tmp_path, "names", "a" * 64).get(glove.key) == {"first": "lag"}
