"""Small multiples of a learned form: what an effect adds to each rotation, over each of its inputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from markupsafe import Markup
from matplotlib.axes import Axes

from glovecal_models.effects.base.learned_form import OWN
from glovecal_service.report.drawing import MODEL, QUIET, svg
from glovecal_service.report.html import figure, multiples, paragraph

MOST_ROTATIONS = 8
WIDTH, HEIGHT = 2.9, 2.1
"""Inches: so small that a narrow screen does not shrink the text."""
UNIT_WORDS = {"deg": "degrees", "SD": "SD of training"}
HOW_TO_READ = (
    "What the effect adds in training, over each of its inputs. Line: mean; band: from the 10 to the 90 % "
    "quantile, wide where it depends on more than this input."
)


def form_pictures(curves: Mapping[str, Mapping[str, Any]]) -> list[Markup]:
    """One picture for each rotation and input, all on one scale of degrees; nothing without curves.

    ``curves``: by rotation, as in the JSON of a model; the rotations to which most is added are shown.
    """
    known = {name: item for name, item in curves.items() if item.get("inputs")}
    if not known:
        return []
    shown = sorted(known, key=lambda name: -_reach(known[name]))[:MOST_ROTATIONS]
    left = len(known) - len(shown)
    more = f" {left} other rotations, to which less is added, are not shown." if left else ""
    each = [(name, curve) for name in shown for curve in known[name]["inputs"]]
    low = min(min(_numbers(curve["low_deg"])) for _, curve in each)
    high = max(max(_numbers(curve["high_deg"])) for _, curve in each)
    room = 0.06 * max(high - low, 1e-3)
    span = (min(low, 0.0) - room, max(high, 0.0) + room)
    ranges = "; ".join(f"{name}: {_range(known[name])}" for name in shown)
    return [
        paragraph(f"{HOW_TO_READ}{more} Lowest and highest, in degrees: {ranges}."),
        multiples([figure(_picture(name, curve, span), _sentence(name, curve)) for name, curve in each]),
    ]


def _picture(rotation: str, curve: Mapping[str, Any], span: tuple[float, float]) -> str:
    def draw(axes: Axes) -> None:
        at = _numbers(curve["at"])
        axes.axhline(0, color=QUIET, linewidth=1)
        low, mean, high = (_numbers(curve[key]) for key in ("low_deg", "mean_deg", "high_deg"))
        axes.fill_between(at, low, high, color=MODEL, alpha=0.25, linewidth=0)
        axes.plot(at, mean, color=MODEL, linewidth=1.6, marker="." if len(at) < 3 else None)
        axes.set(xlabel=_label(rotation, curve), ylabel=f"adds to {rotation}, degrees", ylim=span)

    return svg(draw, WIDTH, HEIGHT)


def _label(rotation: str, curve: Mapping[str, Any]) -> str:
    unit = UNIT_WORDS.get(curve["unit"], curve["unit"])
    name = f"angle of {rotation}" if curve["input"] == OWN else str(curve["input"])
    return f"{name}, {unit}" if unit else name


def _sentence(rotation: str, curve: Mapping[str, Any]) -> str:
    slope = curve["slope_deg_per_unit"]
    name = "its own angle" if curve["input"] == OWN else curve["input"]
    unit = {"deg": "degree"}.get(curve["unit"], curve["unit"]) or "unit"
    mean = "" if slope is None else f": {slope:+.3g} degrees per {unit} on average"
    return f"{rotation} over {name}{mean}"


def _range(item: Mapping[str, Any]) -> str:
    ends = [item["lowest_deg"], item["highest_deg"]]
    return " to ".join("-" if end is None else f"{end:+.2f}" for end in ends)


def _reach(item: Mapping[str, Any]) -> float:
    return max(abs(item["lowest_deg"] or 0.0), abs(item["highest_deg"] or 0.0))


def _numbers(values: Sequence[float | None]) -> list[float]:
    return [0.0 if value is None else value for value in values]
