"""The fall of the error over a model's versions has the line that the newest effect's control would reach."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from effect_models import added, model_with
from loop_by_hand import moving_frames
from realtime_support import LAYOUT

from glovecal_models.comparison.compare import compare
from glovecal_models.improvement.fall.lineage import lineage_fall
from glovecal_models.presentation.drawing import svg
from glovecal_models.takes.take import Take


def test_the_controls_line_is_drawn_at_its_share_of_the_error_before() -> None:
    frames = moving_frames(300)
    readings = np.array([frame.readings for frame in frames], dtype=np.float64)
    time_s = np.arange(300) / 100.0
    reference = 0.5 * readings + 2.0
    take = Take("t", "w", LAYOUT.sensors, time_s, readings, LAYOUT.sensors, time_s, reference)
    base = model_with()
    evidence = {"rmse_before_deg": 2.0, "rmse_control_deg": 1.5, "rmse_after_deg": 0.5}
    child = model_with(replace(added("hysteresis", (5.0,), (0.1,)), evidence=evidence))
    before = compare(base, [take]).overall
    chart = lineage_fall([base, child], {}, [take], before)
    assert f"(control of the last effect: {0.75 * before.rmse_deg:.2f})" in chart.sentence
    assert "control in the effect" in svg(chart)
    plain = model_with(added("hysteresis", (5.0,), (0.1,)))
    assert "control" not in lineage_fall([base, plain], {}, [take], before).sentence
