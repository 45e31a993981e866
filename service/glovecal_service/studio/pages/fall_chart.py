"""Bars of falling errors, the control in the newest effect's place, and the noise floor they fall to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from nicegui import ui

SCALE, MODEL, CONTROL, FLOOR = "#94a3b8", "#2563eb", "#b45309", "#15803d"


@dataclass(frozen=True)
class Bar:
    """A calibration and its held-out error over all rotations, degrees."""

    label: str
    error_deg: float
    control_deg: float | None
    """With the control in the newest effect's place."""
    is_scale: bool
    """A simpler calibration, there for scale."""


def fall_chart(bars: Sequence[Bar], floors_deg: Sequence[float]) -> ui.echart:
    """``floors_deg``: of each rotation; the line is their root mean square."""
    floor = (sum(each**2 for each in floors_deg) / len(floors_deg)) ** 0.5 if floors_deg else None
    controls = [[place, bar.control_deg] for place, bar in enumerate(bars) if bar.control_deg is not None]
    series: list[dict[str, Any]] = [
        {
            "type": "bar",
            "name": "held-out error",
            "data": [
                {
                    "value": round(bar.error_deg, 2),
                    "itemStyle": {"color": SCALE if bar.is_scale else MODEL},
                }
                for bar in bars
            ],
            "label": {"show": True, "position": "top"},
            "barMaxWidth": 80,
        },
        {
            "type": "scatter",
            "name": "control",
            "data": controls,
            "symbol": "rect",
            "symbolSize": [60, 4],
            "itemStyle": {"color": CONTROL},
        },
    ]
    if floor is not None:
        line = {"yAxis": round(floor, 2), "name": "noise floor"}
        series[0]["markLine"] = {
            "symbol": "none", "data": [line], "lineStyle": {"color": FLOOR, "width": 2},
            "label": {"formatter": "noise floor {c}°", "position": "insideEndTop"},
        }  # fmt: skip
    options = {
        "animationDuration": 300,
        "legend": {"data": ["held-out error", "control"]},
        "tooltip": {},
        "grid": {"left": 50, "right": 20, "bottom": 60},
        "xAxis": {"type": "category", "data": [bar.label for bar in bars], "axisLabel": {"interval": 0}},
        "yAxis": {"type": "value", "name": "RMSE, degrees"},
        "series": series,
    }
    return ui.echart(options).classes("fall").props('role="img" aria-label="Error of each version"')
