"""The Live page with a glove on real zenoh: the hand moves, and its state is told."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest
import zenoh
from playwright.sync_api import Page, expect
from realtime_support import WireGlove
from studio_support import Open

from glovecal_client.session import open_client
from glovecal_models.hand.forward_kinematics import forward_kinematics
from glovecal_models.hand.rotations import FINGERS, HAND_ROTATIONS
from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_models.hand_ranges import ACTIVE_RANGE_DEG
from glovecal_service.settings import Settings

pytestmark = pytest.mark.needs_chromium
STREAMING = {"state": "streaming", "sentence": "", "rate_hz": 60.0}


@pytest.fixture(scope="module")
def session(settings: Settings, address: str) -> Iterator[zenoh.Session]:
    with open_client((settings.zenoh,), wait_s=60.0) as session:
        yield session


@contextmanager
def moving(session: zenoh.Session, settings: Settings, name: str, subject: str | None) -> Iterator[WireGlove]:
    """A glove that bends and stretches, 60 frames a second, and says once a second that it streams."""
    glove = WireGlove(session, settings, name, subject=subject)
    stopped = threading.Event()

    def send() -> None:
        at = 0
        while not stopped.wait(1 / 60):
            if at % 30 == 0:
                glove.say_meta()
                session.put(glove.keys.status, json.dumps(STREAMING))
            bend = 140.0 + 60.0 * np.sin(at / 20.0)
            glove.send((bend, bend, bend))
            at += 1

    thread = threading.Thread(target=send)
    thread.start()
    try:
        yield glove
    finally:
        stopped.set()
        thread.join()


def drawn(page: Page) -> dict[str, int]:
    return page.evaluate("getElement(document.querySelector('.hand-view').id.slice(1)).drawn()")


def test_the_hand_moves_and_says_how_the_glove_is(
    opened: Open, session: zenoh.Session, settings: Settings
) -> None:
    with moving(session, settings, "bending", "anna"):
        page = opened("live").page
        card = page.get_by_role("region", name="Glove bending")
        expect(card.locator(".state-word")).to_have_text("ok", timeout=60_000)
        canvas = card.locator(".hand-view canvas")
        first = canvas.screenshot()
        before = drawn(page)["updates"]
        page.wait_for_timeout(1500)
        assert canvas.screenshot() != first
        assert drawn(page)["updates"] > before
        expect(card.locator(".angle")).to_have_count(3)
        expect(card.locator(".angle-value").first).to_contain_text("±")
        card.locator(".angle").first.press("Enter")
        expect(card.locator(".angle").first).to_have_attribute("aria-pressed", "true")
    expect(card.locator(".state-word")).to_have_text("lost", timeout=30_000)


def test_a_glove_without_a_model_is_told_so(opened: Open, session: zenoh.Session, settings: Settings) -> None:
    with moving(session, settings, "unknown-hand", None):
        card = opened("live").page.get_by_role("region", name="Glove unknown-hand")
        expect(card.locator(".state-word")).to_have_text("uncalibrated", timeout=60_000)
        expect(card.get_by_text("No calibrated pose")).to_be_visible()


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
            expect(card.locator(".state-word")).to_have_text("ok", timeout=60_000)
            seen.page.reload()
        time.sleep(0.5)
        assert seen.complaints == []
