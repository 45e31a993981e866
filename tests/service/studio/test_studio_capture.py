"""The Capture page with a simulated person in a glove, who does what is asked; the mouse is not touched."""

from __future__ import annotations

import contextlib
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import httpx
import pytest
from playwright.sync_api import Page, expect
from realtime_support import eventually, part_of_service
from studio_support import Open, serious

from glovecal_service.demo.processes import DemoPlace, running_capture
from glovecal_service.serve import recorder
from glovecal_service.settings import Settings

pytestmark = pytest.mark.needs_chromium
GLOVE, SUBJECT = "asked-right", "carla"


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the simulated glove writes what a reference system would have measured."""
    return tmp_path_factory.mktemp("reference") / "measured.csv"


@pytest.fixture(scope="module")
def worn(
    settings: Settings, address: str, reference: Path, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[subprocess.Popen[bytes]]:
    """The capture of a glove on a hand that does what the service asks; the recorder runs."""
    httpx.post(f"{address}/v1/subjects", json={"name": SUBJECT}).raise_for_status()
    options = {
        "motion": "asked",
        "service": address,
        "rate_hz": "60",
        "seed": "1",
        "reference": str(reference),
    }
    place = DemoPlace(tmp_path_factory.mktemp("worn"), settings.zenoh, settings.port)
    with ExitStack() as running:
        running.enter_context(part_of_service(recorder, settings))
        glove = running.enter_context(
            running_capture(place, glove=GLOVE, subject=SUBJECT, wearing="w1", options=options)
        )
        eventually(lambda: GLOVE in [each["name"] for each in asked(address, "gloves")["seen"]], "it is seen")
        yield glove


@pytest.fixture(autouse=True)
def nothing_goes_on(worn: subprocess.Popen[bytes], address: str) -> Iterator[None]:
    """What a test that failed left open must not hold up the next."""
    yield
    for view in asked(address, "sampling", only_open=True):
        httpx.post(f"{address}/v1/sampling/{view['id']}/stop", json={})
    for recording in asked(address, "recordings", only_open=True):
        httpx.post(f"{address}/v1/recordings/{recording['id']}/stop", json={})


def asked(address: str, path: str, **query: Any) -> Any:
    return httpx.get(f"{address}/v1/{path}", params=query).raise_for_status().json()


def sampling(address: str) -> dict[str, Any]:
    """The newest. Asked ten times a second at most: the service has a glove to follow."""
    time.sleep(0.1)
    return asked(address, "sampling", glove=GLOVE)[0]


def in_phase(page: Page, *phases: str) -> None:
    page.locator(",".join(f'.board[data-phase="{phase}"]' for phase in phases)).wait_for()


def press(page: Page, key: str, address: str, came_of_it: Callable[[dict[str, Any]], Any]) -> None:
    """Once more where a busy computer lost the glove for a moment, and the key with it."""
    for patience_s in (10.0, 30.0):
        in_phase(page, "waiting", "paused", "bad")
        page.keyboard.press(key)
        with contextlib.suppress(AssertionError):
            eventually(lambda: came_of_it(sampling(address)), key, patience_s)
            return
    raise AssertionError(f"{key}: {sampling(address)}")


SAID_IN_A_MOTION, SAID_IN_A_HOLD = 3, 4
"""Sentences: ready, keep still (of a pose), now move or hold still, the verdict."""


def do_step(page: Page, address: str, key: str, name: str, said: int = SAID_IN_A_HOLD) -> None:
    """A busy computer loses frames, and a step with it: then once more."""
    for _ in range(5):
        view = eventually(lambda: waits_for(sampling(address), name), name)
        in_phase(page, "waiting", "bad")
        page.keyboard.press(key)
        judged = view["say_number"] + said
        eventually(lambda: sampling(address)["say_number"] >= judged, f"{key} begins {name}", 40.0)  # noqa: B023
        if outcomes(address).get(name) == "good":
            return
    raise AssertionError(sampling(address)["steps"])


def waits_for(view: dict[str, Any], name: str) -> dict[str, Any] | None:
    here = view["step"] is not None and view["step"]["name"] == name
    return view if here and view["phase"] in ("waiting", "judged") else None


def outcomes(address: str) -> dict[str, str]:
    return {step["name"]: step["outcome"] for step in sampling(address)["steps"] if step["outcome"]}


def tab_to(page: Page, text: str) -> None:
    for _ in range(40):
        page.keyboard.press("Tab")
        if text in page.evaluate("document.activeElement.closest('label, button')?.innerText ?? ''"):
            return
    raise AssertionError(f"{text} is not reached by Tab")


def heard(page: Page) -> list[str]:
    return page.evaluate("getElement(document.querySelector('.board').id.slice(1)).played()")


def test_a_sampling_by_keyboard_alone_through_a_redo_a_reload_and_another_tab(
    opened: Open, address: str
) -> None:
    seen = opened("capture")
    page = seen.page
    page.get_by_role("button", name="Start sampling").wait_for()
    tab_to(page, "Protocol")
    page.keyboard.press("ArrowDown")
    wanted = page.get_by_role("option", name="Touches only")
    wanted.wait_for()
    while "focusable--focused" not in (wanted.get_attribute("class") or ""):
        page.keyboard.press("ArrowDown")
        page.wait_for_timeout(50)
    page.keyboard.press("Enter")
    wanted.wait_for(state="hidden")
    expect(page.get_by_text("Touches only")).to_be_visible()
    tab_to(page, "Start sampling")
    page.keyboard.press("Enter")
    in_phase(page, "waiting")
    view = sampling(address)
    assert (view["protocol"], view["subject"], view["step"]["name"]) == ("ik_only", SUBJECT, "loosen")
    size = page.locator(".board-ask").evaluate("each => parseFloat(getComputedStyle(each).fontSize)")
    assert size >= 48

    do_step(page, address, "Enter", "loosen", SAID_IN_A_MOTION)
    do_step(page, address, "PageDown", "flat-start")
    assert {"begin", "good"} <= set(heard(page))
    eventually(lambda: sampling(address)["step"]["name"] == "fist-start", "the next step")
    press(page, "r", address, lambda now: now["step"]["name"] == "flat-start")
    do_step(page, address, "Space", "flat-start")

    page.reload()
    in_phase(page, "waiting", "lost")  # lost for a moment, where the computer is busy
    expect(page.locator(".board-ask")).to_have_text("Make a fist.")
    expect(page.locator(".capture-place")).to_contain_text("2 of")
    other = page.context.new_page()
    other.goto(page.url)
    other.get_by_text("2 pages show this sampling").wait_for()
    other.close()
    assert serious(page) == []
    page.set_viewport_size({"width": 390, "height": 844})
    assert page.evaluate("document.documentElement.scrollWidth") <= 390

    page.get_by_role("button", name="Stop").first.press("Enter")
    page.get_by_role("dialog").get_by_role("button", name="Go on sampling").wait_for()
    page.wait_for_timeout(400)
    assert serious(page) == []
    page.keyboard.press("Escape")
    page.get_by_role("dialog").wait_for(state="hidden")
    page.evaluate("document.activeElement.blur()")

    press(page, "p", address, lambda now: now["phase"] == "paused")
    in_phase(page, "paused")
    press(page, "Space", address, lambda now: now["phase"] == "waiting")
    press(page, "u", address, lambda now: now["say"].startswith("Undone."))
    for _ in sampling(address)["steps"]:
        if (now := sampling(address))["phase"] in ("done", "stopped"):
            break
        in_phase(page, "waiting")
        press(page, "s", address, lambda view, before=now: view["say_number"] > before["say_number"])
        page.wait_for_timeout(150)
    page.get_by_role("heading", name="Done").wait_for()
    expect(page.get_by_role("heading", name="What was recorded")).to_be_visible()
    expect(page.get_by_role("group", name="Replay")).to_be_visible()
    assert not sampling(address)["open"]
    assert outcomes(address)["flat-start"] in ("good", "skipped")
    assert seen.complaints == []


def test_a_free_recording_with_its_reference(opened: Open, address: str, reference: Path) -> None:
    """Its name is text, whatever it is."""
    name = "<img src=x onerror=alert(1)>"
    seen = opened("capture?mode=recording")
    page = seen.page
    page.get_by_label("Film it").click()
    page.get_by_role("option", name="Drawn pictures, to try").click()
    page.get_by_label("Name of the take").fill(name)
    page.keyboard.press("Tab")
    page.evaluate("document.activeElement.blur()")
    page.keyboard.press("Space")
    in_phase(page, "recording")
    expect(page.locator(".board-note")).to_contain_text("frames")
    page.keyboard.press("Enter")
    page.get_by_role("heading", name=f"{name}: done").wait_for()
    expect(page.get_by_text("in the service's folder films")).to_be_visible()
    expect(page.get_by_role("group", name="Replay")).to_be_visible()
    expect(page.get_by_text("readings alone")).to_be_visible()
    expect(page.locator(".take-plot canvas")).to_be_visible()
    assert serious(page) == []
    page.get_by_role("region", name="Reference").locator("input[type=file]").set_input_files(reference)
    told = page.get_by_role("region", name="Reference").get_by_role("status")
    expect(told).to_contain_text("measured rotations")
    expect(page.get_by_text("all others rest")).to_be_visible()
    take = next(each for each in asked(address, "takes", subject=SUBJECT) if each["name"] == name)
    assert take["rotations"]
    assert asked(address, f"videos/{take['id']}")["simulated"], "shown beside the take"
    page.get_by_role("button", name="Check its clock").press("Enter")
    expect(told).to_contain_text("clock")
    assert seen.complaints == []


def test_what_a_diagnosis_wants_is_recorded_next(opened: Open, address: str) -> None:
    every = [asked(address, f"jobs/{job['id']}") for job in asked(address, "jobs")]
    jobs = [job for job in every if (job["result"] or {}).get("next_take")]
    wanted = jobs[0]["result"]["next_take"]
    page = opened(f"capture?proposal={jobs[0]['id']}").page
    expect(page.locator(".board-ask")).to_have_text(wanted["what"])
    expect(page.get_by_label("Stop after, s")).to_have_value(str(wanted["seconds"]))
    expect(page.get_by_label("Subject")).to_have_value(jobs[0]["subject"])


def test_a_new_wearing_needs_a_model(opened: Open) -> None:
    page = opened("capture?mode=wearing").page
    page.get_by_role("button", name="Start the check").press("Enter")
    page.get_by_text(f"No model is active for {SUBJECT}").wait_for()


def choose(page: Page, label: str, option: str) -> None:
    page.get_by_label(label).click()
    page.get_by_role("option", name=option).click()


@pytest.mark.slow
def test_the_active_protocol_goes_on_by_a_still_hand(opened: Open, address: str) -> None:
    seen = opened("capture")
    page = seen.page
    page.get_by_role("button", name="Start sampling").wait_for()
    choose(page, "Protocol", "Active")
    choose(page, "A step starts", "By holding the hand still")
    page.get_by_role("button", name="Start sampling").click()
    in_phase(page, "waiting", "ready", "now")
    assert (sampling(address)["protocol"], sampling(address)["trigger"]) == ("active", "still")
    eventually(lambda: list(outcomes(address).values()).count("good") >= 4, "four good steps", 180.0)
    page.get_by_role("button", name="Stop").first.click()
    page.get_by_role("dialog").get_by_role("button", name="Stop").click()
    page.get_by_role("heading", name="Stopped").wait_for()
    assert seen.complaints == []


@pytest.mark.slow
def test_five_hand_shapes_end_with_a_template_that_is_not_live_unasked(opened: Open, address: str) -> None:
    seen = opened("capture")
    page = seen.page
    page.get_by_role("button", name="Start sampling").wait_for()
    choose(page, "Protocol", "Five hand shapes")
    choose(page, "A step starts", "By timer: steps")
    page.get_by_role("button", name="Start sampling").click()
    in_phase(page, "waiting", "ready", "now")
    page.get_by_role("heading", name="Done").wait_for(timeout=600_000)
    page.get_by_role("button", name="Train a template").click()
    page.get_by_text("Trained. Live poses do not come from it.").wait_for(timeout=300_000)
    made = asked(address, "models", subject=SUBJECT)[-1]
    assert (made["method"], made["active"]) == ("template", False)
    page.get_by_role("button", name="Use it live").click()
    page.get_by_text("The trained model is active, and served").wait_for(timeout=300_000)
    assert seen.complaints == []


@pytest.mark.slow
def test_from_a_first_sampling_by_timer_to_a_checked_wearing_by_pedal(opened: Open, address: str) -> None:
    seen = opened("capture")
    page = seen.page
    page.get_by_role("button", name="Start sampling").wait_for()
    choose(page, "Protocol", "Poses and widgets only")
    choose(page, "A step starts", "By timer: steps")
    page.get_by_text("I have widgets").click()
    page.get_by_role("button", name="Start sampling").click()
    in_phase(page, "waiting", "ready", "now")
    page.get_by_role("heading", name="Done").wait_for(timeout=600_000)
    page.get_by_role("checkbox", name="Live poses come from it").click()
    page.get_by_role("button", name="Train a model").click()
    page.get_by_text("Trained, and served: the poses of").wait_for(timeout=300_000)
    assert [each["active"] for each in asked(address, "models", subject=SUBJECT)] == [True]

    page = opened("capture?mode=wearing").page
    page.get_by_label("Name of this wearing").fill("in the afternoon")
    began = time.monotonic()
    page.get_by_role("button", name="Start the check").click()
    in_phase(page, "waiting")
    while (now := sampling(address))["open"]:
        if now["phase"] in ("waiting", "judged"):
            page.keyboard.press("PageDown")
            page.wait_for_timeout(200)
    page.get_by_role("heading", name="Wearing in the afternoon is checked").wait_for()
    print(f"checked {time.monotonic() - began:.0f} s after the button, {now['capture_s']:.0f} s of capture")
    first, *_, last = asked(address, "models", subject=SUBJECT)
    assert (last["parent"], last["facts"]["quick_check"]["takes"]) == (
        first["id"],
        sampling(address)["takes"],
    )
    assert seen.complaints == []


def test_a_lost_glove_is_told(opened: Open, address: str, worn: subprocess.Popen[bytes]) -> None:
    body = {"glove": GLOVE, "subject": SUBJECT, "protocol": "fk_only"}
    id = httpx.post(f"{address}/v1/sampling", json=body).raise_for_status().json()["id"]
    page = opened("capture").page
    in_phase(page, "waiting")
    worn.terminate()
    in_phase(page, "lost")
    expect(page.locator(".board-line")).to_contain_text("Waiting for the glove")
    expect(page.locator(".capture-head .state-word")).to_contain_text("lost")
    httpx.post(f"{address}/v1/sampling/{id}/stop", json={}).raise_for_status()
    page.get_by_role("heading", name="Stopped").wait_for()
