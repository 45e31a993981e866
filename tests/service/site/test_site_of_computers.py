"""A site set up as the page says, each computer in a network namespace of its own, and a network that is cut.

The namespaces are made by the test and have no way out; the computers' names are known by their hosts files.
Two minutes: ``python3 do.py test -m slow tests/service/site/test_site_of_computers.py``.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from site_computers import Computers
from site_support import eventually

from glovecal_service.settings import Settings
from glovecal_service.store import Store

PAGE = Path(__file__).resolve().parents[3] / "docs" / "keys.md"
ADDRESSES = {"service": "192.168.1.20", "capture-3": "192.168.1.33", "capture-4": "192.168.1.34",
             "viewer-1": "192.168.1.41"}  # fmt: skip
NAMES = {"lab.example": ADDRESSES["service"]}
CUT_S = 9.0
"""Longer than what the systems' buffers between capture and service hold."""


@pytest.fixture(scope="module")
def computers(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Computers]:
    with ExitStack() as undo:
        found = Computers(tmp_path_factory.mktemp("computers"), ADDRESSES, NAMES)
        try:
            found.build(undo)
        except (OSError, subprocess.CalledProcessError) as error:
            pytest.skip(f"no network namespaces can be made here (root on Linux, iproute2): {error}")
        yield found


def blocks() -> list[list[str]]:
    """The commands of the page, by fenced block of its section."""
    page = PAGE.read_text(encoding="utf-8")
    section = page.partition("## A site of several computers")[2].partition("\n## ")[0]
    return [block.splitlines() for block in re.findall(r"```\n(.*?)\n```", section, re.DOTALL)]


def stop(process: subprocess.Popen[str]) -> None:
    process.terminate()
    process.communicate(timeout=120)


@pytest.mark.slow
def test_a_site_is_set_up_by_its_page_and_survives_a_cut(computers: Computers) -> None:
    began = time.monotonic()
    of_the_service, of_the_others = blocks()
    second = "glovecal site add capture-4 --as capture --glove other"
    *before, serve = [*of_the_service[:2], second, *of_the_service[2:]]
    said = {line: computers.run("service", line) for line in before}
    key = re.search(r"glk_\S+", said["glovecal key add lena --role admin"])
    assert key is not None
    for member in ("capture-3", "capture-4", "viewer-1"):
        shutil.copy2(computers.folder("service") / f"{member}.glovecal", computers.folder(member))
    capture, watch = of_the_others
    capture = capture.replace("lucidglove:/dev/ttyUSB0", "simulated")
    other = capture.replace("capture-3", "capture-4").replace("--glove right", "--glove other")
    with ExitStack() as running:
        for computer, line in (("service", serve), ("capture-3", capture), ("capture-4", other)):
            running.callback(stop, computers.start(computer, f"exec env {line}"))
        for line in (watch, watch.replace("watch right", "watch other")):
            eventually(lambda line=line: hears(computers, line), f"poses: {line}")
        print(f"set up and watched in {time.monotonic() - began:.0f} s")
        lena = {"GLOVECAL_URL": "https://lab.example:8600", "GLOVECAL_KEY": key[0],
                "GLOVECAL_SITE_FILE": "viewer-1.glovecal"}  # fmt: skip
        computers.run("viewer-1", "glovecal subject add anna", **lena)
        seconds = CUT_S + 6.0
        recording = computers.start(
            "viewer-1", f"glovecal record right cut --subject anna --seconds {seconds} --pre-roll 0", **lena
        )
        store = running.enter_context(
            Store.open(Settings(data=computers.folder("service") / "glovecal-data"))
        )
        eventually(lambda: facts(store).get("recorded"), "frames are recorded")
        computers.plug("capture-3", False)
        time.sleep(CUT_S)
        computers.plug("capture-3", True)
        said, complained = recording.communicate(timeout=300)
        assert recording.returncode == 0, said + complained
        found = eventually(lambda: settled(store), "the account is settled")
    assert found["missing"] == []
    assert found["recorded"] == found["sent"] > 120 * CUT_S


def hears(computers: Computers, watch: str) -> bool:
    """Whether poses come within three seconds."""
    process = computers.start("viewer-1", f"{watch} --seconds 3 --json")
    lines = process.communicate(timeout=120)[0].splitlines()
    return process.returncode == 0 and len([line for line in lines if "sequence" in json.loads(line)]) > 30


def facts(store: Store) -> dict:
    """Of the newest recording; {} before there is one."""
    recordings = store.recordings.list()
    return recordings[-1].facts | {"state": recordings[-1].state} if recordings else {}


def settled(store: Store) -> dict | None:
    found = facts(store)
    return found if found["state"] in ("done", "failed") else None
