"""The camera study's table, from answers that are known."""

from __future__ import annotations

from typing import Any

import pytest
from camera_study import EFFECTS, table, tasks


def answer(part: str, **facts: Any) -> dict[str, Any]:
    return {"part": part, "alarm_camera": False, **facts}


def test_the_table_sets_what_was_measured_beside_what_is_demanded():
    hidden = [
        answer("hidden", effect=effect, true=effect, camera=effect if number else None)
        for effect in EFFECTS
        for number in range(2)
    ]
    clean = [answer("clean", true=None, camera=None), answer("clean", true="creep", camera="lag")]
    clocks = [answer("clock", motion="fast", error_s=error, sd_s=0.002) for error in (0.001, 0.003)]
    fitted = {"glove": "steady", "method": "lmc_gpr", "true": 1.0, "camera": 1.2, "ratio": 1.2}
    text = table([*hidden, *clean, *clocks, answer("calibration", **fitted)])
    assert "bias 2.0 ms, SD 1.4 ms (stated: 2.0 ms)" in text
    assert "1.20 degrees by the camera, 1.00 by true angles: 1.20 x" in text
    assert "floors 50 % (3 of 6; 19 to 81 %); by a true reference at 1.3 100 % (6 of 6" in text
    assert "by the camera 1 of 2 (and 0 unexplained residuals); by a true reference 1" in text


@pytest.mark.slow
def test_a_few_gloves_are_asked_and_told():
    done = [task() for task in list(tasks(1, 1, 1))[:6]]
    assert [item["part"] for item in done] == ["clean", *["hidden"] * 3, "clock", "clock"]
    assert table(done).count("| 5 ms each |") == 0  # one glove has no standard deviation
    assert "clean gloves: an effect is named" in table(done)
