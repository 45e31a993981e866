"""The Live page with a glove on real zenoh: the hand moves, and its state is told."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Iterator
from typing import Any

import httpx
import numpy as np
import pytest
import zenoh
from effect_models import CREEP, FAULT, HYSTERESIS, model_with
from playwright.sync_api import Locator, Page, expect
from realtime_support import LAYOUT, eventually, store_model
from studio_support import Open, moving, serious

from glovecal_client.session import open_client
from glovecal_models.calibration.artifact import dump
from glovecal_models.effects.base.dynamics import LONGEST_GAP_S
from glovecal_models.hand.forward_kinematics import forward_kinematics
from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG, FINGERS, HAND_ROTATIONS
from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_service.settings import Settings
from glovecal_service.store import Store

pytestmark = pytest.mark.needs_chromium
SWING_COUNTS = 120.0


@pytest.fixture(scope="module")
def session(settings: Settings, address: str) -> Iterator[zenoh.Session]:
    with open_client((settings.zenoh,), wait_s=60.0) as session:
        yield session


@pytest.fixture(scope="module")
def remembering(settings: Settings, address: str) -> str:
    """The id of a model of subject bela with a memory, whose sensors are watched for faults."""
    with Store.open(settings) as store:
        store.subjects.create("bela")
        record = store.models.add(
            dump(model_with(HYSTERESIS, CREEP, FAULT)),
            subject="bela", layout=LAYOUT.name, method="linear", parent=None, facts={},
        )  # fmt: skip
        store.models.activate(record.id)
        return record.id


def view_of(card: Locator, expression: str) -> Any:
    """What an expression of ``view``, the card's hand, is now."""
    id = card.locator(".hand-view").get_attribute("id")
    assert id is not None
    return card.page.evaluate(f"id => {{ const view = getElement(id); return {expression}; }}", int(id[1:]))


def in_state(card: Locator, word: str) -> None:
    expect(card.locator(".state-word").first).to_have_text(word)


def _settles(card: Locator, terms: Locator) -> bool:
    """Whether a transient is told before all is well again."""
    word = card.locator(".state-word").first
    expect(word).to_have_text(re.compile("settling|ok"))
    while word.inner_text() == "settling":
        if "Transient: " in terms.inner_text():
            return True
        card.page.wait_for_timeout(50)
    return False


def number_in(text: str) -> float:
    return float(text.replace("\u2212", "-").removesuffix("°"))


def drawn(page: Page) -> dict[str, int]:
    return page.evaluate("getElement(document.querySelector('.hand-view').id.slice(1)).drawn()")


def test_the_hand_moves_and_says_how_the_glove_is(
    opened: Open, session: zenoh.Session, settings: Settings
) -> None:
    with moving(session, settings, "bending", "anna"):
        page = opened("live").page
        card = page.get_by_role("region", name="Glove bending")
        expect(card.locator(".state-word")).to_have_text("ok")
        canvas = card.locator(".hand-view canvas")
        first = canvas.screenshot()
        before = drawn(page)["updates"]
        eventually(lambda: drawn(page)["updates"] > before, "the hand is updated")
        eventually(lambda: canvas.screenshot() != first, "the hand moves")
        expect(card.locator(".angle")).to_have_count(3)
        expect(card.locator(".angle-value").first).to_contain_text("±")
        card.locator(".angle").first.press("Enter")
        expect(card.locator(".angle").first).to_have_attribute("aria-pressed", "true")
    expect(card.locator(".state-word")).to_have_text("lost")


def test_a_glove_without_a_model_is_told_so(opened: Open, session: zenoh.Session, settings: Settings) -> None:
    with moving(session, settings, "unknown-hand", None):
        card = opened("live").page.get_by_role("region", name="Glove unknown-hand")
        expect(card.locator(".state-word")).to_have_text("uncalibrated")
        expect(card.get_by_role("link", name="Calibrate this hand")).to_be_visible()


def test_the_page_and_python_agree_where_every_joint_is(
    opened: Open, session: zenoh.Session, settings: Settings
) -> None:
    """Random hands within the ranges of the joints; 1e-3 mm, as the page's numbers are double precision."""
    skeleton = hand_skeleton(hand="right")
    generator = np.random.default_rng(7)
    limits = np.array([ACTIVE_RANGE_DEG[name] for name in HAND_ROTATIONS])
    angles = generator.uniform(limits[:, 0], limits[:, 1], (5, len(HAND_ROTATIONS)))
    right = forward_kinematics(skeleton, angles)
    with moving(session, settings, "usual-hand", None):
        page = opened("live").page
        page.get_by_role("region", name="Glove usual-hand").locator("canvas").first.wait_for()
        element = (
            page.get_by_role("region", name="Glove usual-hand").locator(".hand-view").get_attribute("id")
        )
        assert element is not None
        for number, hand in enumerate(angles):
            given = dict(zip(HAND_ROTATIONS, hand.tolist(), strict=True))
            places = page.evaluate(
                """([id, angles]) => {
                    const view = getElement(id);
                    view.show(angles);
                    return view.places();
                }""",
                [int(element[1:]), given],
            )
            joints = np.array([places["joints"][joint.name] for joint in skeleton.joints])
            tips = np.array([places["tips"][FINGERS[tip.finger]] for tip in skeleton.tips])
            np.testing.assert_allclose(joints, right.joints_mm[number], atol=1e-3)
            np.testing.assert_allclose(tips, right.tips_mm[number], atol=1e-3)


def test_it_goes_on_after_the_page_was_reloaded(
    opened: Open, session: zenoh.Session, settings: Settings
) -> None:
    with moving(session, settings, "bending", "anna"):
        seen = opened("live")
        for _ in range(2):
            card = seen.page.get_by_role("region", name="Glove bending")
            expect(card.locator(".state-word")).to_have_text("ok")
            seen.page.reload()
        time.sleep(0.5)
        assert seen.complaints == []


def test_a_glove_goes_through_all_its_states_and_its_angle_is_explained(
    opened: Open, session: zenoh.Session, settings: Settings, remembering: str
) -> None:
    """Settling, ok, faulty sensor, stale, lost; by keyboard alone."""
    acts: set[str] = set()
    with moving(session, settings, "explained", "bela", acts):
        seen = opened("live")
        page, card = seen.page, seen.page.get_by_role("region", name="Glove explained")
        in_state(card, "ok")
        angle = card.locator(".angle", has_text="I_MCP")
        angle.press("Enter")
        terms = card.get_by_role("region", name="Terms of an angle of glove explained")
        rows = terms.locator("tbody tr")
        expect(rows.last).to_contain_text("served angle")
        names = rows.locator("th").all_inner_texts()
        assert names == ["base", "hysteresis", "creep", "measurement noise", "served angle"]
        expect(card.locator(".hand-view-tag")).to_contain_text("I_MCP")
        texts = page.evaluate(  # of one frame
            "[...document.querySelectorAll('.live-terms-table tbody td:nth-child(3)')].map(e => e.innerText)"
        )
        *parts, served = [number_in(text) for text in texts if text]
        assert abs(sum(parts) - served) < 0.02, "each is rounded to 0.01"
        assert f"model {remembering[:12]}" in terms.inner_text()
        before = terms.locator("table").get_attribute("data-sequence")
        expect(terms.locator("table")).not_to_have_attribute("data-sequence", before or "")

        acts.add("dropped")
        in_state(card, "faulty sensor")
        expect(terms).to_contain_text("Held: a sensor that it is read from fails")
        acts.remove("dropped")
        for _ in range(5):  # a page whose connection is lost for a moment does not see it settle
            acts.add("silent")
            in_state(card, "stale")
            expect(terms).to_contain_text("No frame of glove explained arrives")
            time.sleep(LONGEST_GAP_S)  # after shorter gaps what is remembered still holds
            acts.remove("silent")
            if _settles(card, terms):
                break
        else:
            pytest.fail("five times no transient was seen")
        assert serious(page) == []
        terms.get_by_role("button", name="Close").press("Enter")
        expect(terms).to_have_count(0)
        expect(angle).to_have_attribute("aria-pressed", "false")
    in_state(card, "lost")
    assert seen.complaints == []


def test_a_click_on_a_joint_chooses_it(opened: Open, session: zenoh.Session, settings: Settings) -> None:
    with moving(session, settings, "clicked", "anna"):
        card = opened("live").page.get_by_role("region", name="Glove clicked")
        in_state(card, "ok")
        place = view_of(card, "view.stage.seenAt(view.hand.balls.get('I_MCP')[0])")
        card.locator(".hand-view canvas").click(position={"x": place["x"], "y": place["y"]})
        expect(card.locator('.angle[aria-pressed="true"]')).to_contain_text("I_MCP")
        expect(card.locator(".live-terms-sum")).to_be_visible()


def test_another_model_is_chosen_elsewhere_and_served_from_one_frame_on(
    opened: Open, session: zenoh.Session, settings: Settings, address: str, model: str
) -> None:
    """No frame of the page has the angles of one model and the name of the other."""
    with Store.open(settings) as store:
        other = store_model(store, "anna", degrees_per_count=0.25, activate=False)
    slopes = {model: 0.5, other: 0.25}
    with moving(session, settings, "switched", "anna"):
        page = opened("live").page
        card = page.get_by_role("region", name="Glove switched")
        in_state(card, "ok")
        expect(card.locator(".angles-model")).to_contain_text(model[:12])
        page.evaluate(
            """() => { window.heard = []; window.addEventListener("glovecal-frame", ({ detail }) => {
                if (detail.feed.endsWith("/switched") && detail.rotations)
                    heard.push([detail.names.model, detail.angles[0], detail.angles[1]]);
            }); }"""
        )
        swings = """([model, least]) => {
            const own = heard.filter(([name]) => name === model).map(([, angle]) => angle);
            return own.length && Math.max(...own) - Math.min(...own) >= least;
        }"""
        page.wait_for_function(swings, arg=[model, 0.7 * SWING_COUNTS * slopes[model]])
        try:
            httpx.post(f"{address}/v1/models/{other}/activate").raise_for_status()
            expect(card.locator(".angles-model")).to_contain_text(other[:12])
            expect(card.locator(".glove-models")).to_contain_text(other[:12])
            page.wait_for_function(swings, arg=[other, 0.7 * SWING_COUNTS * slopes[other]])
            card.locator(".glove-models input").press("ArrowDown")
            page.get_by_role("option").filter(has_text=model[:12]).click()
            expect(card.locator(".angles-model")).to_contain_text(model[:12])
        finally:
            httpx.post(f"{address}/v1/models/{model}/activate").raise_for_status()
        heard = page.evaluate("heard")
    order = [name for at, (name, *_) in enumerate(heard) if at == 0 or name != heard[at - 1][0]]
    assert order == [model, other, model]
    for id, slope in slopes.items():
        angles = [angle for name, angle, _ in heard if name == id]
        assert max(angles) - min(angles) <= 1.01 * SWING_COUNTS * slope


def test_both_hands_are_side_by_side_and_mirrored_and_one_below_the_other_on_a_phone(
    opened: Open, session: zenoh.Session, settings: Settings
) -> None:
    with (
        moving(session, settings, "both-right", "dora", hand="right"),
        moving(session, settings, "both-left", "dora", hand="left"),
    ):
        page = opened("live").page
        left, right = (page.get_by_role("region", name=f"Glove both-{hand}") for hand in ("left", "right"))
        expect(left).to_contain_text("dora, left hand")
        expect(right).to_contain_text("dora, right hand")
        where = [card.bounding_box() for card in (left, right)]
        assert where[0] is not None
        assert where[1] is not None
        if where[0]["y"] == where[1]["y"]:  # gloves of other tests may stand between
            assert where[0]["x"] < where[1]["x"]
        else:
            assert where[0]["y"] < where[1]["y"]
        assert where[0]["width"] < 640
        bent = json.dumps({"I_MCP": 40.0, "T_TMC": 30.0, "W_ABD": 10.0, "IM_ABD": 12.0})
        places = []
        for card in (left, right):
            view_of(card, f"view.show({bent})")
            places.append(view_of(card, "view.places()")["tips"])
            view_of(card, "view.look('side')")
            places.append(view_of(card, "view.stage.camera.position.toArray()"))
        mirror = np.array([1.0, -1.0, 1.0])
        for finger, tip in places[0].items():
            np.testing.assert_allclose(np.array(tip) * mirror, places[2][finger], atol=1e-6)
        np.testing.assert_allclose(np.array(places[1]) * mirror, places[3], atol=1e-6)
        page.set_viewport_size({"width": 390, "height": 844})
        page.wait_for_timeout(300)
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        where = [card.bounding_box() for card in (left, right)]
        assert where[0] is not None
        assert where[1] is not None
        assert where[0]["x"] == where[1]["x"]


def test_an_uncalibrated_glove_shows_its_raw_hand_linear_in_each_sensor(
    opened: Open, session: zenoh.Session, settings: Settings
) -> None:
    low, high = ACTIVE_RANGE_DEG["I_PIP"]
    with moving(session, settings, "raw-hand", None):
        card = opened("live").page.get_by_role("region", name="Glove raw-hand")
        in_state(card, "uncalibrated")
        expect(card.locator(".glove-sentence")).to_contain_text("wears glove raw-hand")
        expect(card.get_by_role("link", name="Calibrate this hand")).to_be_visible()
        switch = card.get_by_role("button", name="Raw")
        expect(switch).to_have_attribute("aria-pressed", "true")
        expect(card.get_by_text("is no calibration")).to_be_visible()
        expect(card.get_by_text("No calibrated pose")).not_to_be_visible()
        moved = "(([least, greatest]) => greatest > least)(view.spans.get('I_PIP') ?? [0, 0])"
        eventually(lambda: view_of(card, moved), "the sensor moves")
        view_of(card, "view.socket.close()")
        raw = view_of(card, "[view.spans.get('I_PIP'), view.readings.I_PIP, view.uncalibrated()]")
        (least, greatest), reading, angles = raw
        assert angles["I_PIP"] == pytest.approx(low + (high - low) * (reading - least) / (greatest - least))
        assert "W_FLEX" not in angles
        assert view_of(card, "view.placesOfRaw()") is not None
        switch.press("Enter")
        eventually(lambda: view_of(card, "view.placesOfRaw() === null"), "it is hidden again")
