"""Steps in which a widget holds one rotation and the rest moves: FK-cross-couple sampling.

Wang & Neff 2013, section 5.1.2: the gap between two fingers at 0, 10, 20 and 30 degrees. The paper does so
for every coupled rotation of its Table 1; thumb and wrist go further, so their widgets do.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from glovecal_models.layout import Layout
from glovecal_models.sampling.protocol import Step

MOVE_S = 4.0
WIDEST_DEG = 120.0
WidgetAngles = Mapping[str, Sequence[float]]
WIDGET_DEG: Mapping[str, tuple[float, ...]] = {
    "IM_ABD": (0.0, 10.0, 20.0, 30.0),
    "MR_ABD": (0.0, 10.0, 20.0, 30.0),
    "RP_ABD": (0.0, 10.0, 20.0, 30.0),
    "TI_ABD": (0.0, 20.0, 40.0, 60.0),
    "T_TMC": (0.0, 30.0, 60.0),
    "T_MCP": (0.0, 25.0, 50.0),
    "T_IP": (0.0, 35.0, 70.0),
    "W_FLEX": (-50.0, -15.0, 20.0, 60.0),
    "W_ABD": (-25.0, -5.0, 15.0),
}
"""Degrees of the widgets by the rotation they hold."""

_WHERE = {
    "IM_ABD": "between index and middle finger; bend both fingers freely",
    "MR_ABD": "between middle and ring finger; bend both fingers freely",
    "RP_ABD": "between ring and little finger; bend both fingers freely",
    "TI_ABD": "between thumb and index finger; bend and turn the thumb freely",
    "T_TMC": "under the thumb's base; spread and bend the thumb freely",
    "T_MCP": "on the thumb's middle joint; turn, spread and bend the rest of it",
    "T_IP": "on the thumb's last joint; turn, spread and bend the rest of it",
    "W_FLEX": "under the wrist; move the hand from side to side",
    "W_ABD": "beside the wrist; bend the wrist up and down",
}


def widget_steps(layout: Layout, angles: WidgetAngles | None = None) -> list[Step]:
    """For each rotation that the layout reads from several sensors, one step a widget.

    ``angles`` by rotation go before ``WIDGET_DEG``: the widgets that a user really has.
    """
    chosen = {**WIDGET_DEG, **(angles or {})}
    steps: list[Step] = []
    for correspondence in layout.correspondences:
        rotation = correspondence.rotation
        if correspondence.kind == "MS1R" and rotation in chosen:
            others = tuple(sensor for sensor in correspondence.sensors if sensor != rotation)
            steps += [widget_step(rotation, float(angle), others) for angle in chosen[rotation]]
    return steps


def widget_step(rotation: str, angle_deg: float, moves: tuple[str, ...]) -> Step:
    widget = f"the {angle_deg:g} degree widget"
    where = _WHERE.get(rotation, f"so that it holds {rotation}; move the rest freely")
    return Step(
        name=f"{rotation}{angle_deg:+g}",
        kind="fk_cross_couple",
        motion="move",
        ask=f"Put {widget} {where}.",
        seconds=MOVE_S,
        part=rotation,
        angles={rotation: angle_deg},
        moves=moves,
        needs=widget,
    )
