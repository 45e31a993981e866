# pyright: reportAttributeAccessIssue=false
"""``glovecal subject robot``: a subject's hand as a file that MuJoCo reads."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import mujoco
from cli_running import glovecal as run_glovecal


def test_the_command_line_writes_it_and_says_what_it_cannot(tmp_path: Path) -> None:
    glovecal = partial(run_glovecal, {"GLOVECAL_DATA": str(tmp_path / "data")})
    glovecal("subject", "add", "anna", "--hand", "left")
    for name in ("anna.urdf", "anna.xml"):
        assert "Wrote" in glovecal("subject", "robot", "anna", tmp_path / name, "--palm", "arching").out
        model = mujoco.MjModel.from_xml_path(str(tmp_path / name))
        assert model.joint("PALM_ARCH").id >= 0
    assert "left_hand" in (tmp_path / "anna.urdf").read_text()
    refused = glovecal("subject", "robot", "anna", tmp_path / "anna.sdf")
    assert refused.code == 2
    assert "must end in .urdf (for ROS) or .xml (for MuJoCo)" in refused.said
