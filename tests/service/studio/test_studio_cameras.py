"""The page Cameras with a drawn glove before a real chain, in a real browser."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from phone_videos import phone_video
from playwright.sync_api import expect

sys.path.insert(0, str(Path(__file__).parents[1]))
pytest.importorskip("cv2")
pytest.importorskip("numba")

from camera_support import SMALL, camera_process, ready_folder
from dropping import drop
from studio_support import Open, serious

from glovecal_models.colour_glove.hand_state import FINGER_ROTATIONS
from glovecal_service.camera.camera_settings import CameraSettings
from glovecal_service.settings import Settings

pytestmark = pytest.mark.needs_chromium


@pytest.fixture(scope="module")
def drawn(settings: Settings, address: str) -> Iterator[None]:
    """A camera that was started on a command line."""
    ready_folder(settings.data)
    camera = CameraSettings(
        "rendered", "drawn", settings.site, settings.zenoh, keep="nothing", data=settings.data, stage="ik",
        **SMALL,
    )  # fmt: skip
    with camera_process(camera):
        yield


def test_a_picture_its_labels_and_the_model_and_what_each_stage_buys(opened: Open, drawn: None) -> None:
    seen = opened("cameras")
    page = seen.page
    card = page.get_by_role("region", name="Camera drawn", exact=True)
    expect(card.locator(".state-word")).to_have_text("tracking, simulated")
    picture = card.locator(".camera-frame img")
    expect(picture).to_be_visible()
    first = picture.get_attribute("src")
    expect(picture).not_to_have_attribute("src", first or "")
    rows = card.locator(".camera-joints tbody tr")
    expect(rows).to_have_count(len(FINGER_ROTATIONS))
    expect(rows.first).to_contain_text("±")
    decided = card.locator('td[data-accepted="yes"], td[data-accepted="no"]')
    expect(decided).to_have_count(len(FINGER_ROTATIONS))
    figures = card.locator(".camera-stage-table tbody tr", has_text="centroids").locator("td")
    expect(figures.nth(0)).to_contain_text("%")
    expect(figures.nth(2)).to_contain_text("ms")
    card.get_by_role("button", name="blend", exact=True).press("Enter")
    blend = card.locator(".camera-stage-table tbody tr", has_text="averaged").locator("td")
    expect(blend.nth(0)).to_contain_text("%")
    expect(card.get_by_role("button", name="blend", exact=True)).to_have_attribute("aria-pressed", "true")
    labels = card.get_by_role("button", name="Labels")
    with page.expect_response(lambda answer: "layers=picture,model" in answer.url) as told:
        labels.press("Enter")
    assert told.value.headers["content-type"] == "image/jpeg"
    assert serious(page) == []
    page.set_viewport_size({"width": 390, "height": 844})
    page.wait_for_timeout(300)
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    assert seen.complaints == []


def test_it_is_a_glove_on_the_page_live_too(opened: Open, drawn: None) -> None:
    """The real-time process leaves its poses and what they mean alone."""
    card = opened("live").page.get_by_role("region", name="Glove drawn", exact=True)
    expect(card.locator(".state-word").first).to_have_text("ok, simulated")
    expect(card.locator(".angle")).to_have_count(len(FINGER_ROTATIONS))


def test_a_phones_video_that_is_dropped_is_offered_for_tracking(opened: Open, tmp_path: Path) -> None:
    phone_video(tmp_path / "Fist 1.mp4", [np.full((48, 64, 3), 90, np.uint8)] * 6, [33, 50, 33, 50, 33, 50])
    seen = opened("cameras")
    drop(seen.page, [tmp_path / "Fist 1.mp4"])
    expect(seen.page).to_have_url(re.compile("video=fist-1"))
    form = seen.page.get_by_role("region", name="New camera")
    expect(form.get_by_label("Pictures of")).to_have_value(
        re.compile("^Video fist-1: 0 s; the file's own times")
    )
    expect(form.get_by_role("checkbox", name="The pictures are mirrored")).not_to_be_checked()
    assert serious(seen.page) == []
    assert seen.complaints == []


def test_without_a_camera_the_page_says_so(opened: Open) -> None:
    page = opened("cameras").page
    form = page.get_by_role("region", name="New camera")
    form.get_by_label("Pictures of").click()
    page.get_by_role("option", name="Camera 1", exact=True).click()
    form.get_by_label("Name of the glove").fill("missing")
    form.get_by_role("button", name="Start").click()
    card = page.get_by_role("region", name="Camera missing", exact=True)
    expect(card.locator(".state-word")).to_have_text("stopped")
    expect(card).to_contain_text("Camera:1 cannot be opened")
