"""The Session part of Capture with two emulated CyberGlove III: warm-up, cards and clocks."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import httpx
import pytest
from playwright.sync_api import expect
from realtime_support import eventually, part_of_service
from studio_support import Open, serious

from glovecal_service.demo.processes import DemoPlace, running_capture
from glovecal_service.emulators.cyberglove3 import EmulatedCyberGlove3
from glovecal_service.emulators.hand import MovingHand
from glovecal_service.emulators.ports import Emulation
from glovecal_service.emulators.pseudo_terminal import PseudoTerminal
from glovecal_service.serve import recorder
from glovecal_service.settings import Settings

pytestmark = [
    pytest.mark.needs_chromium,
    pytest.mark.skipif(sys.platform == "win32", reason="pseudo-terminals are a POSIX thing"),
]
GLOVES = ("cg3-left", "cg3-right")


@pytest.fixture(scope="module")
def gloves(
    settings: Settings, address: str, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[dict[str, EmulatedCyberGlove3]]:
    made = {}
    with ExitStack() as running:
        running.enter_context(part_of_service(recorder, settings))
        for seed, name in enumerate(GLOVES):
            folder = tmp_path_factory.mktemp(name)
            made[name] = EmulatedCyberGlove3(MovingHand(seed))
            port = PseudoTerminal(folder / f"emulated-{name}")
            running.enter_context(Emulation(made[name], port))
            place = DemoPlace(folder, settings.zenoh, settings.port)
            running.enter_context(
                running_capture(
                    place, glove=name, subject=name, wearing="w1", options={"clock": "glove"},
                    device=f"cyberglove3:{port.name}",
                )
            )  # fmt: skip
        eventually(lambda: set(GLOVES) <= streaming(address), "both stream")
        eventually(lambda: set(GLOVES) <= stored(address), "both are stored")
        yield made


def streaming(address: str) -> set[str]:
    found = httpx.get(f"{address}/v1/live-gloves")
    return {each["glove"] for each in found.json()} if found.is_success else set()


def stored(address: str) -> set[str]:
    """Those whose frames came, once real time has had time to say so."""
    return {each["name"] for each in httpx.get(f"{address}/v1/gloves").json()["seen"]}


def test_warm_up_clocks_and_cards_of_both_gloves(
    opened: Open, gloves: dict[str, EmulatedCyberGlove3], address: str
) -> None:
    page = opened("capture?mode=session").page
    for name in GLOVES:
        expect(page.get_by_text(re.compile(rf"{name}: not warm yet, 20 of 20 minutes"))).to_be_visible()
    page.get_by_role("button", name="Set clocks").click()
    expect(page.get_by_text(re.compile(r"The clock of cg3-\w+ is .* ms ahead of that of"))).to_be_visible()
    page.get_by_role("button", name="Start on all").click()
    row = page.get_by_role("row", name=GLOVES[0])
    expect(row).to_contain_text("TAKE1.DAT")
    page.get_by_role("button", name="Stop", exact=True).click()
    expect(row).to_contain_text("7.4")  # V: the status that comes with the end
    for glove in gloves.values():
        assert len(glove.card["TAKE1.DAT"]) > 1000
    assert serious(page) == []
    if folder := os.environ.get("GLOVECAL_PICTURES"):
        page.screenshot(path=Path(folder) / "session.png", full_page=True)
