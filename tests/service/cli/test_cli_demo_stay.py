"""Who stays in the demo, and what they find: asked on a terminal only; Ctrl-C leaves nothing."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import httpx
import pytest
from cli_running import COMMAND, environment
from realtime_support import eventually
from terminal_process import CTRL_C, on_terminal

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="wants a POSIX terminal")
ASK = """
import os
from glovecal_service.demo.staying import wants_to_stay
for number in range(4):
    print(number, end=": ")
    print(number, "stays:", wants_to_stay(as_json=False))
print("for json:", wants_to_stay(as_json=True))
os.environ["CI"] = "true"
print("in ci:", wants_to_stay(as_json=False))
"""
QUESTION = "Stay, and walk through"


def with_browser(folder: Path) -> tuple[dict[str, str], Path]:
    """An environment whose display and browser are a script that notes the address it is given."""
    noted = folder / "opened"
    browser = folder / "browser"
    browser.write_text(f'#!/bin/sh\necho "$1" > {noted}.new && mv {noted}.new {noted}\n')
    browser.chmod(0o700)
    mine = environment({"DISPLAY": ":77", "BROWSER": f"{browser} %s", "TMPDIR": str(folder)})
    return {name: value for name, value in mine.items() if name != "CI"}, noted


def test_a_terminal_is_asked_and_nobody_for_json_or_in_ci() -> None:
    mine = {name: value for name, value in os.environ.items() if name != "CI"}
    with on_terminal([sys.executable, "-c", ASK], mine) as asked:
        for number, (typed, stays) in enumerate(
            {"\n": True, "yes\n": True, "n\n": False, "\x04": False}.items()
        ):
            asked.wait_for(f"{number}: {QUESTION}")
            asked.type(typed)
            asked.wait_for(f"{number} stays: {stays}")
        assert asked.end() == 0
    assert asked.said.count(QUESTION) == 4
    assert "for json: False\n" in asked.said
    assert "in ci: False\n" in asked.said


def test_without_a_terminal_nobody_is_asked() -> None:
    done = subprocess.run(
        [sys.executable, "-c", ASK], stdin=subprocess.DEVNULL, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert QUESTION not in done.stdout
    assert "True" not in done.stdout


def test_the_page_opens_the_glove_moves_and_ctrl_c_leaves_nothing(tmp_path: Path) -> None:
    mine, noted = with_browser(tmp_path)
    work = tmp_path / "work"
    work.mkdir()
    process = Path(__file__).parent / "demo_stay_process.py"
    with on_terminal([sys.executable, str(process), str(work)], mine) as demo:
        demo.wait_for("Ctrl-C here stops it")
        address = eventually(
            lambda: noted.read_text().strip() if noted.exists() else "", "the browser is opened"
        )
        url, _, model = address.partition("/studio/compare?models=")
        assert address in demo.said
        assert httpx.get(address, timeout=60.0).is_success
        (active,) = httpx.get(f"{url}/v1/models").json()
        assert active["active"]
        assert active["id"].startswith(model)

        def moves() -> bool:
            seen = httpx.get(f"{url}/v1/gloves").json()["seen"]
            return any(glove["subject"] == "pia" for glove in seen)

        eventually(moves, "its glove streams")
        demo.type(CTRL_C)
        assert demo.end() == 0, demo.said
        assert "Stopping." in demo.said
        assert "all ended" in demo.said
        assert "Traceback" not in demo.said
    with pytest.raises(httpx.TransportError):
        httpx.get(url)


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_the_whole_demo_stays_with_who_says_so(tmp_path: Path) -> None:
    mine, noted = with_browser(tmp_path)
    command = [*COMMAND, "demo", "--effect", "cross_coupling", "--seed", "3"]
    with on_terminal(command, mine) as demo:
        demo.wait_for(QUESTION, deadline_s=1000)
        demo.type("\n")
        demo.wait_for("Ctrl-C here stops it")
        address = eventually(
            lambda: noted.read_text().strip() if noted.exists() else "", "the browser is opened"
        )
        url = re.sub(r"/studio/.*", "", address)
        models = httpx.get(f"{url}/v1/models").json()
        # the version with the effect is there, and the one without it is served: adding it is theirs
        assert [
            each["effects"] for each in models if each["active"] and each["subject"] == "demo-hidden"
        ] == [[]]
        assert any(each["effects"] == ["cross_coupling"] for each in models), json.dumps(models)
        demo.type(CTRL_C)
        assert demo.end() == 0, demo.said
    assert [entry.name for entry in tmp_path.iterdir() if entry.name.startswith("glovecal")] == []
