"""Pages: title, summary, contents, valid HTML, axes; from documents of today and of an earlier service."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from html import unescape
from html.parser import HTMLParser
from typing import Any

import pytest
from matplotlib.figure import Figure

from glovecal_models.calibration.answer import Trained
from glovecal_models.effect_block import effect_block
from glovecal_models.effects.base.effect import CorrectionEffect, kind_of
from glovecal_models.effects.catalogue import catalogue
from glovecal_models.improvement.answer import EffectAdded, EffectRemoved
from glovecal_models.improvement.fall.answer import FallStep, FloorBand, fall_chart
from glovecal_models.presentation.document import Chart
from glovecal_models.presentation.drawing import MODEL, svg
from glovecal_models.presentation.html import counted_once, part_html
from glovecal_service.questions.diagnose import DIAGNOSE
from glovecal_service.questions.improve import IMPROVE
from glovecal_service.report.html import page_of

MODEL_ID = "da3a26b60b009b5f723ad22934052eafaf153ce82b8234bd8d25d79c31c7f073"
TITLE = "pia, version 2 of 22 November 2026"
VOID = {"meta", "br", "path", "use", "rect", "circle", "image", "link"}


class Strict(HTMLParser):
    """Elements are closed in their order, ids are there once, links point at one, nothing is from outside."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.links: list[str] = []
        self.count: dict[str, int] = {}

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.count[tag] = self.count.get(tag, 0) + 1
        names = [name for name, _ in attrs]
        assert len(names) == len(set(names)), f"{tag} has an attribute twice"
        for name, value in attrs:
            if name == "id":
                self.ids.append(value or "")
            if name in ("src", "href", "xlink:href"):
                self.links.append(value or "")
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.open.pop() == tag


def strict(page: str) -> Strict:
    parser = Strict()
    parser.feed(page)
    parser.close()
    assert parser.open == []
    assert len(parser.ids) == len(set(parser.ids))
    assert all(link.startswith(("#", "data:")) for link in parser.links)
    assert {link[1:] for link in parser.links if link.startswith("#")} <= set(parser.ids)
    assert "script" not in parser.count
    assert page.startswith("<!doctype html>")
    assert "default-src &#39;none&#39;" in page or "default-src 'none'" in page
    return parser


def candidate(effect: str, after: float, *, passes: bool) -> dict[str, Any]:
    return {
        "effect": effect, "where": ["I_MCP"] if passes else [],
        "rmse_before_deg": 3.6, "rmse_after_deg": after,
        "rmse_control_deg": 3.5, "saved_share": {"I_MCP": 0.8, "I_PIP": 0.1},
        "control_saved_share": {"I_MCP": 0.1, "I_PIP": 0.0}, "p_value": None, "passes": passes,
    }  # fmt: skip


@pytest.fixture
def diagnosis() -> dict[str, Any]:
    first = sorted(
        name
        for name, item in catalogue().items()
        if isinstance(item, CorrectionEffect) and item.shape.parameters
    )[0]
    parameter = catalogue()[first].shape.parameters[0]
    return {
        "model": MODEL_ID, "title": TITLE, "subject": "pia", "sentences": [],
        "takes": [{"id": "b8fc5a4a2e5a", "name": "w1-t1"}],
        "rotations": {"I_MCP": {"rmse_deg": 3.4, "noise_floor_deg": 0.6}},
        "named": {
            "effect": first, "where": ["I_MCP"], "kind": "correction", "verdict": "named",
            "confidence_set": [first], "sentence": "It is.",
            "parameters": {"I_MCP": {f"{parameter.name}_{parameter.unit}": 1.25}},
        },
        "candidates": [candidate(first, 1.2, passes=True), candidate("no_such_effect", 3.7, passes=False)],
        "not_identifiable": [{"effect": "palm <b>", "why": "no sensor"}],
        "findings": [
            {"effect": "sensor_fault", "kind": "stuck", "where": ["A"],
             "sentence": f"Take w1-t{number}: sensor A stands still for {number}.5 s."}
            for number in (1, 2)
        ],
        "reference_problems": [],
        "hold_drift": None,
        "unexplained_residual": {
            "is_significant": True, "sentence": "A slow error (over 1 s) is unexplained.",
            "not_identifiable": None,
            "associations": [
                {"phrase": "c.strap_n", "rotation": "I_MCP", "size_deg": 0.7, "p_value": 0.01, "column": "x"}
            ],
        },
        "next_take": {
            "motion": "fast", "what": "Swing.", "seconds": 25, "separates": ["a", "b"], "take_name": "fast",
        },
    }  # fmt: skip


def diagnosis_page(found: dict[str, Any]) -> str:
    return page_of(DIAGNOSE.read(json.loads(json.dumps(found))).presentation())


@pytest.fixture
def improvement() -> dict[str, Any]:
    return {
        "steps": [
            {"model": MODEL_ID, "added": None, "rmse_deg": 3.6, "per_rotation": {"I_MCP": 3.6},
             "control_rmse_deg": None},
            {"model": MODEL_ID, "rmse_deg": 1.4, "per_rotation": {"I_MCP": 1.4}, "control_rmse_deg": 3.4,
             "added": {"effect": "no_such_effect", "where": ["I_MCP"], "verdict": "named",
                       "confidence_set": ["no_such_effect"], "parameters": {"offset_s": -0.07}}},
        ],
        "baselines": {"raw": 4.2}, "noise_floor_deg": {"I_MCP": 0.6},
        "noise_floor_interval_deg": {"I_MCP": [0.5, 0.7]}, "stopped": "nothing_named", "undone": [],
        "hold_drift": None, "unexplained_residual": None, "next_take": None, "sentences": ["One.", "Two."],
        "method": "linear", "subject": "pia", "title": TITLE,
    }  # fmt: skip


def improvement_page(found: dict[str, Any]) -> str:
    return page_of(IMPROVE.read(found).presentation())


def test_a_diagnosis_has_a_title_a_summary_and_contents(diagnosis: dict[str, Any]) -> None:
    page = diagnosis_page(diagnosis)
    parser = strict(page)
    assert "<h1>Missing effects in pia, version 2 of 22 November 2026 (1 take)</h1>" in page
    head = page[: page.index("<nav")]
    assert [re.sub("<.*?>", "", item) for item in re.findall(r"<dt>.*?</dt>", head)] == [
        "Verdict", "Size", "Place", "Next",
    ]  # fmt: skip
    assert "explains 89 % of the squared error of these sensors on held-out takes (control: 5 %)" in head
    assert "<code>glovecal add-effect da3a26b60b00" in head
    assert MODEL_ID[:12] not in page[page.index("<h1>") : page.index("</h1>")]
    assert MODEL_ID in page[page.index('id="details"') :]
    assert "contents" in page.lower()
    assert sum(link.startswith("#") and link[1:] in parser.ids for link in parser.links) >= 6
    assert "(2 times, this is the first)" in page
    assert "palm &lt;b&gt;" in page


def test_the_named_effect_is_explained_with_picture_and_parameters(diagnosis: dict[str, Any]) -> None:
    page = diagnosis_page(diagnosis)
    known = catalogue()[diagnosis["named"]["effect"]]
    part = page[page.index('<h2 id="the-effect">') : page.index('<h2 id="what-was-tried">')]
    assert "Schematic, not to scale" in part
    assert "<svg" in part
    assert "1.25" in part
    assert f"{known.shape.parameters[0].name.replace('_', ' ')}, {known.shape.parameters[0].unit}" in part


def test_an_improvement_tells_each_step_once(improvement: dict[str, Any]) -> None:
    page = improvement_page(json.loads(json.dumps(improvement)))
    strict(page)
    assert "<h1>Improvement of pia, version 2 of 22 November 2026</h1>" in page
    assert "held-out error reduced from 3.60 to 1.40 degrees; noise floor 0.60" in page
    steps = page[page.index('<h2 id="how-the-error-falls">') : page.index('<h2 id="effects-added">')]
    assert steps.count("<tr>") == 3


def test_what_made_a_model_has_a_page_too() -> None:
    added = EffectAdded(
        "hysteresis", ["I_PIP"], True, "It falls.", {"I_PIP": 2.0}, {"I_PIP": 1.0}, {"I_PIP": {"a_deg": 1.5}},
        model=MODEL_ID, parent="ab" * 32, title=TITLE,
    )  # fmt: skip
    page = page_of(added.presentation())
    strict(page)
    assert "<h1>Adding hysteresis to pia, version 2 of 22 November 2026</h1>" in page
    assert "Not active; glovecal model activate da3a26b60b00 makes it so." in page
    undone = page_of(replace(added, model=None, added=False).presentation())
    assert "Model abababababab stays as it is; nothing was stored." in undone
    removed = EffectRemoved("hysteresis", 1.0, 2.0, parent=MODEL_ID, title=TITLE)
    strict(page_of(removed.presentation()))
    assert removed.sentence == (
        "Without hysteresis the error on takes left out goes from 1.00 to 2.00 degrees."
    )
    trained = Trained(
        MODEL_ID, 3.0, None, {"I_PIP": 3.0, "I_DIP": None}, ["2 takes <b>."], [], [], True, "pia", "linear",
        "takes",
    )  # fmt: skip
    page = page_of(trained.presentation())
    strict(page)
    assert "Model da3a26b60b00 (linear) for pia, held-out error 3.00 degrees. Active." in page
    assert "2 takes &lt;b&gt;." in page


def test_a_page_of_nothing_found_is_a_page() -> None:
    empty = {"rotations": {}, "candidates": [], "not_identifiable": [], "sentences": [], "takes": []}
    nothing = {"named": None, "unexplained_residual": None, "next_take": None}
    page = diagnosis_page({"model": MODEL_ID, **empty, **nothing})
    strict(page)
    assert "No known effect beats its control significantly." in page


@pytest.mark.parametrize("name", sorted(catalogue()))
def test_every_effect_is_explained_and_drawn(name: str) -> None:
    card = part_html(effect_block(name))
    assert catalogue()[name].about.explanation[:20] in unescape(card)
    assert ("<svg" in card) == (kind_of(catalogue()[name]) != "nothing")


def curve(name: str, unit: str) -> dict[str, Any]:
    at = [float(place) for place in range(12)]
    return {
        "input": name, "unit": unit, "at": at, "mean_deg": [0.3 * x - 1 for x in at],
        "low_deg": [0.2 * x - 2 for x in at], "high_deg": [0.4 * x for x in at], "slope_deg_per_unit": 0.3,
    }  # fmt: skip


def test_a_learned_form_is_a_picture_for_each_rotation_and_input(improvement: dict[str, Any]) -> None:
    added = improvement["steps"][1]["added"]
    inputs = [curve("M_MCP", "SD"), curve("own", "deg"), curve("humidity_pct", "")]
    lanes = {f"R{place}": {"lowest_deg": -2.0, "highest_deg": place, "inputs": inputs} for place in range(10)}
    added["curves"] = lanes
    page = improvement_page(improvement)
    strict(page)
    card = page[page.index('<h2 id="effects-added">') : page.index('<h2 id="each-rotation">')]
    assert card.count("<svg") == 8 * 3
    assert "2 other rotations, to which less is added, are not shown" in card
    for label in ("adds to R9, degrees", "M_MCP, SD of training", "angle of R9, degrees", ">humidity_pct<"):
        assert label in card
    assert "R9 over M_MCP: +0.3 degrees per SD on average" in card
    assert "R9: -2.00 to +9.00" in card
    sizes = [float(size) for size in re.findall(r"font(?:-size)?: ([\d.]+)px", card)]
    assert sizes
    assert min(sizes) >= 9
    assert max(float(width) for width in re.findall(r'<svg[^>]* width="([\d.]+)pt"', card)) < 230


def test_associations_have_their_actions_and_claim_no_cause(
    diagnosis: dict[str, Any], improvement: dict[str, Any]
) -> None:
    action = {"rotation": "I_MCP", "column": "sensor M_MCP", "phrase": "sensor M_MCP", "method": None,
              "effect": "column:M_MCP", "rmse_before_deg": 2.5, "rmse_after_deg": 1.1,
              "rmse_control_deg": 2.4, "saves": True, "is_physical": False,
              "is_within_known": False}  # fmt: skip
    nothing = {**action, "effect": None, "saves": False, "rotation": "I_PIP"}
    diagnosis["actions"] = [action, nothing, {**nothing, "method": "lmc_gpr"}]
    page = diagnosis_page(diagnosis)
    strict(page)
    part = page[page.index('<h2 id="what-to-do-about-it">') : page.index('<h2 id="error-of-each-rotation">')]
    assert f"glovecal add-effect {MODEL_ID[:12]} column:M_MCP --rotation I_MCP" in part
    assert "glovecal train --subject pia --method lmc_gpr" in part
    assert "no cause is claimed" in part
    cells = re.findall(r"<td[^>]*>(.*?)</td>", part)
    assert cells[:6] == ["I_MCP", "sensor M_MCP", "column:M_MCP", "2.50", "1.10", "2.40"]
    assert cells[13] == "-"
    improvement["steps"][1]["added"] |= {"verdict": "associated", "associated_with": "sensor M_MCP"}
    page = improvement_page(improvement)
    assert "associated with sensor M_MCP; no cause is claimed" in page


def test_bars_start_at_zero_and_a_fall_over_decades_is_dots(diagnosis: dict[str, Any]) -> None:
    band = FloorBand(0.5, 0.4, 0.6)
    linear, wide, errors = (Figure().add_subplot() for _ in range(3))
    small = fall_chart(
        [FallStep("raw", 4.0, is_scale=True), FallStep("a", 3.0), FallStep("+ b", 1.0, 2.9)], band
    )
    large = fall_chart([FallStep("raw", 40.0), FallStep("a", 1.0)], band)
    *_, bars = (part for part in DIAGNOSE.read(diagnosis).presentation().parts() if isinstance(part, Chart))
    for chart, axes in ((small, linear), (large, wide), (bars, errors)):
        assert chart.draw is not None
        chart.draw(axes)
    assert errors.get_xlabel() == "smoothed error on held-out takes, degrees"
    assert (linear.get_yscale(), linear.get_ylim()[0]) == ("linear", 0.0)
    assert wide.get_yscale() == "log"
    assert not wide.patches[1:]  # the band only, no bar
    assert wide.yaxis.get_major_formatter()(2.0, None) == "2"
    assert errors.get_xlim()[0] == 0.0


def test_pictures_follow_the_page_and_share_no_id() -> None:
    first, second = (
        svg(Chart(lambda axes, n=n: axes.plot([0, n], marker="o", color=MODEL), 3, 2, "")) for n in (1, 2)
    )
    ids = [set(re.findall(r'id="([^"]+)"', picture)) for picture in (first, second)]
    assert ids[0]
    assert not ids[0] & ids[1]
    assert "var(--model, #1d6cab)" in first
    assert "var(--ink, #1a1a1a)" in first
    assert "fill: #ffffff" not in first


def test_warnings_alike_stand_once() -> None:
    said = counted_once(["Take a: 3 gaps.", "Take b: 5 gaps.", "Something else."])
    assert said == ["Take a: 3 gaps. (2 times, this is the first)", "Something else."]
