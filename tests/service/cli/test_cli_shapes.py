"""Takes of a session's hand shapes are calibrated from: they have no angles, but names that tell some."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from cli_running import Run

from glovecal_models.simulation.protocol import segments
from glovecal_models.simulation.simulated_glove import SimulatedGlove, simulate_take
from glovecal_models.takes.session_drift import SHAPES
from glovecal_models.takes.take import Take
from glovecal_models.takes.write_table import write_takes

POSES = {"flat": "flat", "spread": "spread", "fist": "fist"}


def held(pose: str, name: str) -> Take:
    """Two seconds in which a simulated hand holds a pose."""
    glove = SimulatedGlove(1, "cyberglove18")
    take = simulate_take(glove, segments("key_poses", 1), rate_hz=60, name=name).take
    assert take.poses is not None
    rows = np.flatnonzero([one == pose for one in take.poses])[:120]
    return Take(name, "w", take.sensors, take.time_s[rows] - take.time_s[rows[0]], take.readings[rows])


def test_a_template_is_trained_from_the_shapes_of_a_session(run: Run, tmp_path) -> None:
    takes = [held(pose, f"start-{shape}") for shape, pose in POSES.items()]
    assert set(POSES) < set(SHAPES)
    write_takes([replace(take, simulated=True) for take in takes], tmp_path / "shapes.csv")
    layout = ("--layout", "cyberglove18")
    assert run("take", "import", tmp_path / "shapes.csv", "-s", "anna", *layout).code == 0
    other = run("train", "-s", "anna")
    assert other.code == 1
    assert "From its hand shapes: glovecal train --subject anna --method template" in other.said
    trained = run("train", "-s", "anna", "--method", "template")
    assert trained.code == 0, trained.said
    assert "3 hand shapes tell scale and offset of" in trained.said
    assert "(template) for anna" in trained.out
