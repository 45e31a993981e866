"""The blind study in short: strong effects get their names, healthy gloves none, and the marking is fair."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import pytest
from blind_glove import BlindGlove
from confusion_picture import draw_confusion
from diagnosis_answer import NOTHING, diagnosis_answer
from finished_gloves import FinishedGloves
from glove_choices import clean, pair, with_cause
from intervals import bootstrap, wilson
from naming_figures import clean_figures, names_figures
from study_figure import StudyFigure, table
from study_parts import LARGE_SIZE, PARTS, StudyChoices
from walk_figures import alarm_figures, pairs_figures

from glovecal_models.simulation.causes.catalogue import forms

STRONG = ("hysteresis", "creep", "lag", "clock_offset", "warmup_drift", "cross_coupling")


def strong(effect: str) -> BlindGlove:
    glove = with_cause("short", effect, LARGE_SIZE, 0)
    assert glove is not None
    return glove


@pytest.mark.parametrize("effect", STRONG)
def test_a_strong_effect_is_named_first(effect):
    answer = diagnosis_answer(strong(effect))
    assert answer["first"] == effect, answer["evidence"]
    assert effect in answer["confidence_set"]


@pytest.mark.parametrize("linear", [False, True])
def test_nothing_but_its_own_curve_is_named_on_a_healthy_glove(linear):
    answer = diagnosis_answer(clean(0, linear=linear))
    assert answer["first"] in (NOTHING, "nonlinearity") if linear else answer["first"] == NOTHING


def test_gloves_are_unlike_and_the_same_in_every_run():
    gloves = [glove for number in range(12) if (glove := with_cause("names", "hysteresis", 1.3, number))]
    assert gloves == [with_cause("names", "hysteresis", 1.3, number) for number in range(12)]
    assert len({glove.seed for glove in gloves}) == 12
    assert {glove.bits for glove in gloves} == {8, 12}
    assert {glove.nuisance for glove in gloves} == {"white", "drift", "posture"}
    assert {len(glove.causes[0].channels or ()) for glove in gloves} == {0, 1}
    assert {glove.causes[0].form for glove in gloves} == {
        "bouc_wen",
        "single_play",
        "several_plays",
        "relays",
    }


def test_set_aside_forms_are_used_only_when_asked_for():
    for aside in (False, True):
        choices = StudyChoices(gloves=2, set_aside=aside)
        gloves = [
            *PARTS["names"].gloves(choices),
            *(pair(number, 1.3, set_aside=aside) for number in range(3)),
        ]
        used = {(cause.name, cause.form) for glove in gloves for cause in glove.causes}
        assert {form.set_aside for name, chosen in used for form in forms(name) if form.name == chosen} == {
            aside
        }


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


def test_intervals_are_those_of_the_books():
    assert wilson(0, 60) == pytest.approx((0.0, 0.0602), abs=1e-3)
    assert wilson(19, 20) == pytest.approx((0.764, 0.991), abs=1e-3)
    low, high = bootstrap([1.0, 2.0, 3.0, 4.0] * 25)
    assert 2.2 < low < 2.5 < high < 2.8
    assert all(math.isnan(value) for value in bootstrap([]))


def test_figures_count_what_was_named_and_say_what_is_demanded(tmp_path):
    lag, healthy = with_cause("names", "lag", 1.3, 0), clean(0, linear=False)
    assert lag is not None
    named = {"first": "lag", "right": ["lag"], "confidence_set": ["lag"]}
    wrong = named | {"first": "creep"}
    figures = names_figures([(lag, named), (lag, wrong)])
    assert (figures[0].count, figures[0].gloves, figures[0].is_met) == (1, 2, False)
    silent = {"first": NOTHING, "right": [], "confidence_set": []}
    assert clean_figures([(healthy, silent)])[0].is_met
    assert not clean_figures([(healthy, silent), (healthy, wrong | {"right": []})])[0].is_met
    assert "50.0 % (1 of 2)" in table(figures)
    walked = {
        "added": ["lag", "creep"],
        "verdicts": ["named", "named"],
        "unexplained_residual": False,
        "rmse_deg": [2.0, 1.0],
    }
    both = with_cause("pairs", "lag", 1.3, 1)
    assert both is not None
    two = (replace(both, truth="creep+lag"), {"right": ["creep", "lag"], "walk": walked, "twin_deg": 0.8})
    found = {figure.name: figure for figure in pairs_figures([two])}
    assert found["two effects: exactly these"].is_met
    assert found["two effects: last error / clean twin"].value == pytest.approx(1.25)
    unknown_cause = (replace(both, truth="unknown:tilt"), {"right": [], "walk": walked})
    assert [figure.is_met for figure in alarm_figures([unknown_cause])[:2]] == [False, False]
    assert "nan" not in json.dumps(StudyFigure.share("none", []).to_document()).lower()
    draw_confusion([(lag, named), (lag, wrong), (healthy, silent)], "Drawn", tmp_path / "drawn.png")
    assert (tmp_path / "drawn.png").stat().st_size > 5000
