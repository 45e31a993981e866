"""The subscribers in C++ and Rust, compiled and run: they show what the WebSocket bridge sends."""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from bridge_support import FIST, Stage, running_bridge

from glovecal_client.wire.pose import RotationFlag

EXAMPLES = Path(__file__).resolve().parents[3] / "client" / "examples"


@pytest.fixture(scope="module", params=["subscribe.cpp", "subscribe.rs"])
def program(request: pytest.FixtureRequest, compiled: Callable[[Path], Path]) -> Path:
    return compiled(EXAMPLES / request.param)


@contextmanager
def subscribed(program: Path, host: str, port: int) -> Iterator[subprocess.Popen[str]]:
    address = [host, str(port)] if program.name.endswith("cpp") else [f"{host}:{port}"]
    command = [str(program), *address, "right"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


def shown(process: subprocess.Popen[str], text: str) -> list[str]:
    """The words of the next line with ``text`` in it."""
    assert process.stdout is not None
    for line in process.stdout:
        if text in line:
            return line.split()
    assert process.stderr is not None
    raise AssertionError(f"it ended before {text!r} came: {process.stderr.read()}")


def test_a_pose_is_shown_with_names_deviations_and_what_not_to_use(program: Path, stage: Stage) -> None:
    marks = {"R_PIP": int(RotationFlag.FAULTY_SENSOR), "M_PIP": int(RotationFlag.TOO_UNCERTAIN)}
    stage.show(right={"angles": FIST, "rotation_flags": marks})
    with (
        running_bridge(stage, "websocket", "--port", 0) as bridge,
        subscribed(program, *bridge.place()) as process,
    ):
        sequence, *words = shown(process, "I_PIP 95.00")
        assert sequence.isdigit()
        names, values = words[0::2], words[1::2]
        assert tuple(names) == stage.right.rotations
        expected = {name: f"{FIST.get(name, 0.0):.2f}+-1.00{'!' if name in marks else ''}" for name in names}
        assert dict(zip(names, values, strict=True)) == expected
        stage.show(right={"angles": {"I_PIP": 12.5}})
        assert "I_PIP 12.50+-1.00" in " ".join(shown(process, "I_PIP 12.50"))
        stage.show(right=None)
        assert "stale" in shown(process, "stale")
        stage.right.model = None
        stage.show(right={})
        assert "uncalibrated" in shown(process, "uncalibrated")


def test_without_a_bridge_it_says_so(program: Path) -> None:
    with subscribed(program, "127.0.0.1", 9) as process:
        assert process.wait(60) == 1
        assert process.stderr is not None
        assert process.stderr.read()
