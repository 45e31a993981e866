"""The shell completes verbs and options, once its script is installed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from glovecal_service.cli.completion import PLACES, Shell


@pytest.mark.parametrize(("typed", "found"), [("glovecal diag", "diagnose"), ("glovecal take lo", "look")])
def test_bash_completes_a_verb(run: Any, tmp_path: Path, typed: str, found: str) -> None:
    script = tmp_path / "glovecal.bash"
    script.write_text(run("completion", "bash").out)
    words, program = typed.split(), Path(sys.executable).with_name("glovecal")
    ask = (
        f"source {script}; COMP_WORDS=({typed}); COMP_CWORD={len(words) - 1}; "
        f'_glovecal_completion {program}; printf "%s\\n" "${{COMPREPLY[@]}}"'
    )
    bash = subprocess.run(["bash", "-c", ask], capture_output=True, text=True, timeout=120, check=True)
    assert bash.stdout.split() == [found]


@pytest.mark.parametrize("shell", PLACES)
def test_it_is_written_where_the_shell_looks(
    run: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, shell: Shell
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("SHELL", f"/usr/bin/{shell}")
    done = run("completion", "--install")
    assert done.code == 0, done.err
    assert "_GLOVECAL_COMPLETE" in (tmp_path / PLACES[shell]).read_text()


def test_an_unknown_shell_is_asked_for(run: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SHELL", "/bin/false")
    refused = run("completion")
    assert refused.code == 1
    assert "name one of them" in refused.err


def test_help_has_a_short_name_everywhere(run: Any) -> None:
    for verb in ((), ("train",), ("take",), ("take", "import")):
        short = run(*verb, "-h")
        assert "Usage: glovecal" in short.out, short
        assert short == run(*verb, "--help")
