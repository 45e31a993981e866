"""How long a job will still take: from its own speed so far, told in the job and on a terminal."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent / "cli"))

from cli_running import (  # pyright: ignore[reportMissingImports]
    COMMAND,
    environment,
    glovecal,
)
from terminal_process import on_terminal  # pyright: ignore[reportMissingImports]

from glovecal_models.takes.take import Take
from glovecal_models.takes.write_table import write_takes
from glovecal_service.jobs.time_left import TimeLeft
from glovecal_service.settings import Settings
from glovecal_service.store import Store


def test_time_left_is_that_of_the_speed_since_the_first_task_began() -> None:
    now = [100.0]
    left = TimeLeft(0.2, lambda: now[0])
    now[0] += 0.5
    assert left.seconds(0.5) is None, "half a second tells no speed"
    now[0] += 3.5
    assert left.seconds(0.21) is None, "one per cent tells no speed"
    assert left.seconds(0.4) == pytest.approx(12.0)
    now[0] += 8.0
    assert left.seconds(0.8) == pytest.approx(4.0)
    assert left.seconds(1.0) == 0.0


@pytest.fixture(scope="module")
def settings(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """A subject whose twelve takes err alike for many frames in a row: weights have to be tried."""
    folder = tmp_path_factory.mktemp("time-left")
    generator = np.random.default_rng(5)
    takes = [_walk(number, generator) for number in range(12)]
    [path] = write_takes(takes, folder / "walks.csv")
    given = {"GLOVECAL_DATA": str(folder / "data")}
    assert glovecal(given, "subject", "add", "walker").code == 0
    assert glovecal(given, "take", "import", path, "--subject", "walker").code == 0
    return given


def _walk(number: int, generator: np.random.Generator) -> Take:
    phase = np.linspace(0, 2 * np.pi, 120) + generator.uniform(0, 6)
    motion = np.column_stack([np.sin(phase), np.cos(phase), np.sin(2 * phase)])
    motion += 0.3 * np.cumsum(generator.normal(size=(120, 3)), axis=0) / np.sqrt(120)
    angle = 15 * motion[:, 0] + 2 * motion[:, 1] ** 2 + 4 * np.sin(phase / 2 + generator.uniform(0, 6))
    return Take(
        name=f"walk-{number:02}",
        wearing="one",
        sensors=("A", "B", "C"),
        time_s=np.arange(120) / 100,
        readings=np.round(500 + 40 * motion, 1),
        rotations=("ANKLE",),
        reference_time_s=np.arange(120) / 100,
        reference=(angle + generator.normal(0, 0.3, 120))[:, None],
        simulated=True,
    )


def test_a_terminal_and_the_job_tell_what_is_decided_and_how_long_it_takes(settings) -> None:
    shown = _on_a_terminal(settings, "train", "--subject", "walker", "--folds", "0")
    assert re.search(r"choosing sample weights: \d+ of at most \d+", shown), shown
    assert re.search(r"about \d+ s left", shown), shown
    [job] = glovecal(settings, "job", "list", "--json").json
    with Store.open(Settings(data=Path(settings["GLOVECAL_DATA"]))) as store:
        events = store.jobs.events(job["id"])
    assert any("choosing sample weights: " in event.sentence for event in events)
    left = [event.detail["seconds_left"] for event in events if "seconds_left" in event.detail]
    assert left
    assert min(left) < left[0]


def _on_a_terminal(settings: dict[str, str], *arguments: str) -> str:
    """All that is written to a terminal."""
    with on_terminal([*COMMAND, *arguments], environment(settings) | {"TERM": "xterm"}) as process:
        assert process.end(deadline_s=500.0) == 0, process.said
    return process.said
