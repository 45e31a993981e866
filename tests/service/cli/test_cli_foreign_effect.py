"""An effect of somebody else's package, known by an entry point alone: from the catalogue to live poses."""

from __future__ import annotations

import json
import signal
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from cli_running import glovecal, start
from realtime_support import eventually, free_endpoint

from glovecal_models.takes.take import Take
from glovecal_models.takes.write_table import write_takes

ADVICE = "Loosen and tighten the strap while the room stays as warm as it is."
PACKAGE = f'''
"""Strap tension: a tight strap stretches the cloth over the knuckles."""

from glovecal import About, ContextEffect, Motion, Relations, Rival

STRAP = Motion("strap", {ADVICE!r}, 45)


class StrapTension(ContextEffect):
    name = "strap_tension"
    about = About(
        "A tight strap stretches the cloth over the knuckles.",
        source="measured with a spring scale",
        relations=Relations(rivals=(Rival("strap_tension", "temperature", STRAP),)),
    )
    context = ("strap_n",)
'''
SENSORS = ("I_MCP", "I_PIP")
CALIBRATION = ("--method", "linear", "--folds", 0)


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What an installer leaves: the package, and beside it its metadata with the entry point."""
    site = tmp_path_factory.mktemp("site-packages")
    (site / "strap_glove.py").write_text(PACKAGE, encoding="utf-8")
    metadata = site / "strap_glove-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: strap-glove\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text(
        "[glovecal.effects]\nstrap_tension = strap_glove:StrapTension\n"
    )
    return site


def recorded(name: str, seed: int, strap_n: float, temperature_c: float) -> Take:
    """20 s of two simulated joints whose sensors the strap stretches; 0.3 degrees of noise."""
    generator = np.random.default_rng(seed)
    time = np.arange(600) / 30
    phases = generator.uniform(0, 6, (3, 2))
    waves = np.sin(time[:, None, None] * np.array([0.9, 1.7, 2.9])[:, None] + phases).sum(axis=1)
    angles = 45 + 14 * waves
    stretched = angles + 0.8 * (strap_n - 10) + 0.02 * (strap_n - 10) * (angles - 45)
    readings = np.round(10 * (stretched + generator.normal(0, 0.3, angles.shape)))
    context = {"strap_n": np.full(600, strap_n), "temperature_c": np.full(600, temperature_c)}
    return Take(
        name=name, wearing="monday", sensors=SENSORS, time_s=time, readings=readings, rotations=SENSORS,
        reference_time_s=time, reference=angles, context=context, simulated=True,
    )  # fmt: skip


def takes(first: int, straps: Sequence[float], temperatures: Sequence[float]) -> list[Take]:
    pairs = enumerate(zip(straps, temperatures, strict=True), start=first)
    return [recorded(f"take-{number}", number, *pair) for number, pair in pairs]


@pytest.fixture(scope="module")
def live(installed: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, str]]:
    """Settings that reach a running service in whose environment the package is."""
    folder, endpoint = tmp_path_factory.mktemp("foreign"), free_endpoint()
    port = free_endpoint().rpartition(":")[2]
    settings = {"GLOVECAL_DATA": str(folder / "data"), "GLOVECAL_ZENOH": endpoint, "GLOVECAL_PORT": port}
    process = start({**settings, "PYTHONPATH": str(installed)}, "serve")
    try:
        assert process.stdout is not None
        assert process.stdout.readline().startswith("Glovecal is running")
        reach = {"GLOVECAL_URL": f"http://127.0.0.1:{port}", "GLOVECAL_ZENOH": endpoint}
        yield {**reach, "GLOVECAL_DATA": str(folder / "capture")}
    finally:
        process.send_signal(signal.SIGINT)
        _, complaints = process.communicate(timeout=120)
    assert "Traceback" not in complaints


def test_an_effect_of_another_package_is_listed_diagnosed_told_apart_added_served_and_removed(
    live: dict[str, str], tmp_path: Path
) -> None:
    run = partial(glovecal, live)
    assert run("subject", "add", "anna").code == 0
    listed = {item["name"]: item for item in run("effects", "--json").json}
    assert (listed["strap_tension"]["own"], listed["strap_tension"]["package"]) == (True, "strap-glove")
    assert listed["strap_tension"]["can_be_added"]

    straps = np.random.default_rng(5).permutation(np.linspace(4, 16, 10))
    write_takes(takes(1, straps.tolist(), (20 + 0.5 * straps).tolist()), tmp_path / "first.csv")
    imported = run("take", "import", tmp_path / "first.csv", "-s", "anna")
    assert imported.code == 0, imported.err
    model = run("train", "-s", "anna", *CALIBRATION, "--json").json["result"]["model"]

    undecided = run("diagnose", model, "--json").json
    assert undecided["named"]["verdict"] == "ambiguous"
    assert {"strap_tension", "temperature"} <= set(undecided["named"]["confidence_set"])
    assert undecided["next_take"]["what"] == ADVICE

    write_takes(takes(11, straps.tolist(), (20 + 0.5 * straps[::-1]).tolist()), tmp_path / "second.csv")
    assert run("take", "import", tmp_path / "second.csv", "-s", "anna").code == 0
    model = run("train", "-s", "anna", *CALIBRATION, "--json").json["result"]["model"]
    named = run("diagnose", model, "--json").json["named"]
    assert (named["effect"], named["verdict"]) == ("strap_tension", "named")

    added = run("add-effect", model, "strap_tension", "--activate", "--json").json
    assert added["added"]
    assert all(added["after"][name] < 0.3 * before for name, before in added["before"].items())
    assert _live_error_deg(live, added["model"], tmp_path) < 1.0, "4 degrees without the effect"

    removed = run("remove-effect", added["model"], "strap_tension", "--json").json
    assert run("model", "show", removed["model"], "--json").json["effects"] == []


def _live_error_deg(live: dict[str, str], model: str, folder: Path) -> float:
    """RMSE of the live poses of a glove that replays a take whose strap is tighter by 5 N than usual."""
    take = recorded("again", 99, 15.0, 20.0)
    write_takes([take], folder / "again.csv")
    capture = ["capture", "--device", f"replay:{folder / 'again.csv'}", "--glove", "right", "--option"]
    process = start(live, *capture, "loop=yes", "--subject", "anna", "--wearing", "monday")

    def poses() -> list[dict]:
        told = glovecal(live, "watch", "right", "--json", "--seconds", 2).out.splitlines()
        return [pose for pose in map(json.loads, told) if pose["model"] == model]

    try:
        found = eventually(poses, "poses of the model with the effect")
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)
    number = np.array([pose["sequence"] for pose in found])
    angles = np.array([list(pose["degrees"].values()) for pose in found])
    errors = [angles - take.reference[(number + first) % len(take.reference)] for first in range(600)]
    return float(min(np.sqrt(np.mean(error**2)) for error in errors))
