"""Refinement by hand on the Live page: a slider makes a version that is served; undo takes it back."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import httpx
import numpy as np
import pytest
import zenoh
from effect_models import model_with
from playwright.sync_api import Locator, expect
from realtime_support import LAYOUT
from studio_support import Open, moving, serious

from glovecal_client.clock import computer_id
from glovecal_client.pictures.recording import VideoRecording
from glovecal_client.pictures.source import RenderedPictures
from glovecal_client.rest import RestClient
from glovecal_client.session import open_client
from glovecal_models.calibration.artifact import dump
from glovecal_models.takes.take import Take
from glovecal_service.cli.glove.beside import attach_video
from glovecal_service.settings import Settings
from glovecal_service.store import Store

pytestmark = pytest.mark.needs_chromium


@pytest.fixture(scope="module")
def session(settings: Settings, address: str) -> Iterator[zenoh.Session]:
    with open_client((settings.zenoh,), wait_s=60.0) as session:
        yield session


@pytest.fixture(scope="module")
def line(settings: Settings, address: str) -> str:
    """The id of a model of lines, of subject refined-by-hand."""
    with Store.open(settings) as store:
        store.subjects.create("refined-by-hand")
        record = store.models.add(
            dump(model_with()), subject="refined-by-hand", layout=LAYOUT.name, method="linear", parent=None,
            facts={"held_out_rmse_deg": 1.0},
        )  # fmt: skip
        store.models.activate(record.id)
        return record.id


def refine_by_hand(card: Locator) -> None:
    """Opens what is folded; a click that a busy page lost is made again."""
    slider = card.get_by_role("slider", name="Offset, degrees")
    for _ in range(5):
        card.get_by_text("Refine by hand").click()
        with suppress(AssertionError):
            expect(slider).to_be_visible(timeout=20_000)
            return
    expect(slider).to_be_visible()


def turn_to(card: Locator, offset_deg: str) -> None:
    """One step of the slider. A key that came before a busy browser was ready is pressed again; one that the
    slider took is not, however long the version takes to be made."""
    slider = card.get_by_role("slider", name="Offset, degrees")
    before = slider.get_attribute("aria-valuenow") or ""
    for _ in range(20):
        slider.locator('[tabindex="0"]').press("ArrowRight")
        with suppress(AssertionError):
            expect(slider).not_to_have_attribute("aria-valuenow", before, timeout=5_000)
            break
    expect(card.locator(".refine-value").last).to_have_text(offset_deg)


def active(address: str) -> str:
    models = httpx.get(f"{address}/v1/models", params={"subject": "refined-by-hand"}).json()
    return next(each["id"] for each in models if each["active"])


def test_a_slider_makes_a_version_and_undo_takes_it_back(
    opened: Open, session: zenoh.Session, settings: Settings, address: str, line: str
) -> None:
    with moving(session, settings, "refined", "refined-by-hand"):
        seen = opened("live")
        page, card = seen.page, seen.page.get_by_role("region", name="Glove refined")
        expect(card.locator(".state-word").first).to_have_text("ok")
        refine_by_hand(card)
        turn_to(card, "0.5")
        expect(card.locator(".refine-said")).to_contain_text("+0.5 degrees")
        child = active(address)
        assert child != line
        found = httpx.get(f"{address}/v1/models/{child}").json()
        assert found["parent"] == line
        assert found["held_out_rmse_deg"] is None
        assert "Its error was not measured." in found["facts"]["sentences"][0]
        expect(card.locator(".refine-value").last).to_have_text("0.5")
        assert serious(page) == []
        turn_to(card, "1")
        expect(card.locator(".refine-said")).to_contain_text("+1 degrees")
        second = httpx.get(f"{address}/v1/models/{active(address)}").json()
        assert second["parent"] == child
        assert "+0.5 degrees" in second["facts"]["sentences"][0], "what is new beside the first"
        card.get_by_role("button", name="Undo").click()
        expect(card.locator(".refine-value").last).to_have_text("0.5")
        assert active(address) == child
        card.get_by_role("button", name="Undo").click()
        expect(card.locator(".refine-value").last).to_have_text("0")
        expect(card.locator(".refine-said")).to_contain_text("Taken back")
        assert active(address) == line
        assert seen.complaints == []


def test_the_takes_video_beside_the_sliders(
    opened: Open, session: zenoh.Session, settings: Settings, address: str, line: str, tmp_path: Path
) -> None:
    film = tmp_path / "fist.mkv"
    with VideoRecording(RenderedPictures(), film) as video:
        time.sleep(1.2)
    video.describe()
    time_s = np.arange(time.monotonic() - 3.0, time.monotonic(), 1 / 60)
    bend = np.column_stack([140 + 60 * np.sin(3 * time_s)] * len(LAYOUT.sensors))
    with Store.open(settings) as store:
        take = store.takes.add(
            Take("fist", "w", LAYOUT.sensors, time_s, bend), subject="refined-by-hand", layout=LAYOUT.name,
            source="recording", accounting={"computer": computer_id()},
        ).id  # fmt: skip
    with RestClient(address) as client:
        attach_video(client, film, [take])
    with moving(session, settings, "refined", "refined-by-hand"):
        seen = opened("live")
        page, card = seen.page, seen.page.get_by_role("region", name="Glove refined")
        expect(card.locator(".state-word").first).to_have_text("ok")
        refine_by_hand(card)
        card.get_by_label("Beside the video of take").click()
        page.get_by_role("option", name="fist").click()
        picture = card.locator(".video-picture")
        expect(picture).to_be_visible()
        page.wait_for_function("document.querySelector('.video-picture').naturalWidth > 0")
        for _ in range(4):
            card.get_by_role("button", name="One picture on").click()
        expect(picture).to_have_attribute("src", f"/v1/videos/{take}/pictures/4")
        hand = card.get_by_label("Calibrated hand at the moment of the picture")
        before = hand.screenshot()
        for value in ("0.5", "1", "1.5"):
            turn_to(card, value)
            expect(card.locator(".refine-said")).to_contain_text(f"+{value} degrees")
        expect(picture).to_have_attribute("src", f"/v1/videos/{take}/pictures/4")
        page.wait_for_timeout(500)
        assert hand.screenshot() != before, "the hand beside the picture follows the slider"
        assert serious(page) == []
        assert seen.complaints == []


def test_what_is_no_line_is_refused(address: str, line: str) -> None:
    for rotations, said in (
        ({"NOSE": {"scale": 1.1}}, "no rotation 'NOSE'"),
        ({}, "rotations"),
        ({"I_MCP": {"scale": 0.0}}, "scale"),
        ({"I_MCP": {"scale": 1.1, "gain": 2}}, "gain"),
    ):
        answer = httpx.post(f"{address}/v1/models/{line}/refine", json={"rotations": rotations})
        assert answer.status_code in (400, 422)
        assert said in answer.text
