"""A terminal that is closed: a recording goes on, everything else ends in order."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from cli_running import COMMAND, environment
from realtime_support import eventually, free_endpoint
from terminal_process import on_terminal

CAPTURES = {"glovecal-capture": ["glovecal_client.capture.command"], "glovecal": [COMMAND[-1], "capture"]}


@pytest.fixture
def table(tmp_path: Path) -> Path:
    table = tmp_path / "table.csv"
    table.write_text("time_s,s.A\n" + "".join(f"{i / 100},{i}\n" for i in range(200)))
    return table


@pytest.mark.parametrize("module", CAPTURES.values(), ids=CAPTURES)
def test_a_recording_outlives_its_terminal(tmp_path: Path, table: Path, module: list[str]) -> None:
    options = ["--device", f"replay:{table}", "--option", "loop=yes", "--glove", "g1"]
    options += ["--connect", free_endpoint(), "--data", str(tmp_path)]
    with on_terminal([sys.executable, "-m", *module, *options], environment({})) as capture:
        capture.wait_for("without publishing")
        (log,) = (tmp_path / "capture" / "lab" / "g1").glob("*.glvlog")
        capture.hang_up()
        size = log.stat().st_size
        eventually(lambda: log.stat().st_size > size + 10_000, "frames are recorded")
        capture.process.terminate()
        assert capture.end() == 0


def test_what_runs_until_it_is_stopped_ends_with_its_terminal(tmp_path: Path) -> None:
    mine = environment({"TMPDIR": str(tmp_path)})
    with on_terminal([*COMMAND, "emulate", "cyberglove"], mine) as emulate:
        emulate.wait_for("every reading is simulated")
        assert list(tmp_path.iterdir())
        emulate.hang_up()
        assert emulate.end() == 129
    assert not list(tmp_path.iterdir())
