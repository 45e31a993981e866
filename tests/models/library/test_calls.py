"""Long calls: progress, cancelling, Ctrl-C, and the threads of BLAS."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import glovecal
from glovecal._calls import library_call

LONG = """
import glovecal
if __name__ == "__main__":
    takes = glovecal.simulate(seed=1).takes
    print("begins", flush=True)
    {call}
"""
SAID = "progress=lambda text, share: print(text, flush=True)"


def blas_threads() -> set[int]:
    return {item["num_threads"] for item in threadpool_info() if item["user_api"] == "blas"}


def living_in_session(session: int) -> list[int]:
    """Processes of a session that are no zombies."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, _, of_session = stat.read_text().rpartition(")")[2].split()[:4]
        except OSError:
            continue  # it ended meanwhile
        if int(of_session) == session and state != "Z":
            found.append(int(stat.parent.name))
    return found


def test_progress_is_told_in_order(takes):
    told: list[tuple[str, float]] = []
    glovecal.train(takes, method="linear", progress=lambda text, share: told.append((text, share)))
    shares = [share for _, share in told]
    assert shares == sorted(shares)
    assert told[-1] == ("done", 1.0)
    assert any("I_PIP" in text for text, _ in told)


def test_the_line_rewrites_itself_and_ends(takes, capsys):
    glovecal.train(takes, method="linear", progress=True)
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("\r")
    assert said.err.endswith("\n")
    assert said.err.count("\n") == 1
    assert "100 % done" in said.err


def test_without_progress_nothing_is_said(takes, capsys):
    glovecal.train(takes, method="linear")
    assert capsys.readouterr() == ("", "")


def test_blas_has_one_thread_during_a_call_only(takes):
    during: list[set[int]] = []
    with threadpool_limits(limits=2, user_api="blas"):
        glovecal.train(takes, method="linear", progress=lambda text, share: during.append(blas_threads()))
        assert all(item == {1} for item in during)
        assert blas_threads() == {2}
        with pytest.raises(RuntimeError, match="stop"), library_call(True):
            raise RuntimeError("stop")
        assert blas_threads() == {2}


def test_a_call_is_cancelled(model, takes):
    for call in (
        lambda: glovecal.train(takes, cancelled=lambda: True),
        lambda: glovecal.diagnose(model, takes, cancelled=lambda: True),
        lambda: glovecal.add_effect(model, takes, "lag", cancelled=lambda: True),
        lambda: glovecal.improve(takes, cancelled=lambda: True),
    ):
        with pytest.raises(glovecal.Cancelled):
            call()


@pytest.mark.parametrize(
    "call", [f"glovecal.improve(takes, {SAID})", f"glovecal.train(takes, workers=2, {SAID})"]
)
def test_ctrl_c_ends_it_and_leaves_nothing_behind(call: str, tmp_path: Path):
    script = tmp_path / "script.py"
    script.write_text(LONG.format(call=call), encoding="utf-8")
    process = subprocess.Popen(
        [sys.executable, str(script)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
    )  # fmt: skip
    assert process.stdout is not None
    assert process.stdout.readline() == "begins\n"
    assert process.stdout.readline()
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=120)
    assert process.returncode == -signal.SIGINT
    assert "KeyboardInterrupt" in said
    deadline = time.monotonic() + 60.0
    while alive := living_in_session(process.pid):
        assert time.monotonic() < deadline, alive
        time.sleep(0.05)


def test_workers_give_the_same_model_to_the_byte(model, takes):
    told: list[float] = []
    ours = glovecal.train(
        takes, subject="anna", samples=300, workers=2, progress=lambda text, share: told.append(share)
    )
    assert ours.id == model.id
    assert told == sorted(told)
    with pytest.raises(glovecal.Cancelled):
        glovecal.train(takes, workers=2, cancelled=lambda: True)


def test_a_script_uses_workers_without_a_guard(tmp_path: Path):
    script = tmp_path / "script.py"
    script.write_text(
        LONG.format(call="print(glovecal.train(takes, workers=2, samples=50).subject)")
        .replace('if __name__ == "__main__"', "if True")
        .replace("seed=1", "seed=1, wearings=1, takes_per_wearing=2, take_s=5")
    )
    run = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=120)
    assert (run.returncode, run.stdout, run.stderr) == (0, "begins\nunnamed\n", "")
