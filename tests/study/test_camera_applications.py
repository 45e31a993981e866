"""What the study of the examples counts, with errors that are known."""

from __future__ import annotations

import numpy as np
import pytest
from camera_applications import RATE_HZ, applications, moments_of, needed, with_errors
from worn_glove import ROTATIONS


def test_a_hand_without_errors_attains_all_and_a_lost_one_little():
    for application in applications():
        assert with_errors(application, 0.0, stays=True, seed=1) == 1.0, application.name
    spelling, walking, _ = applications()
    assert with_errors(spelling, 40.0, stays=True, seed=1) < 0.5
    assert with_errors(walking, 40.0, stays=True, seed=1) < 1.0


def test_moments_before_the_camera_are_the_scripts():
    walking = applications()[1]
    angles, turns, wrists = moments_of(walking, 3)
    bent = angles[:, ROTATIONS.index("I_MCP")]
    times = np.arange(len(angles)) / RATE_HZ
    assert bent == pytest.approx([walking.script(time)["I_MCP"] for time in times])
    palm = turns @ np.array([0.0, 0.0, -1.0])
    assert (palm[:, 2] < np.cos(np.radians(40.0)) * -1.0).all()  # towards the camera
    middle = wrists + turns @ np.array([85.0, 0.0, 0.0])
    assert middle == pytest.approx(np.tile([0.0, 0.0, 450.0], (len(middle), 1)))


def test_the_table_has_a_row_for_each_size_of_error_and_each_kind():
    rows = needed((1.0,), 1).splitlines()[2:]
    assert [row.split("|")[1].strip() for row in rows] == ["1 degrees, of 0.5 s", "1 degrees, that stay"]
    assert all("100 %" in row for row in rows)
