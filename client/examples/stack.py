#!/usr/bin/env python3
"""Stack blocks on a desk: fingers from the glove grasp, physics does the rest, in the browser.

    python client/examples/stack.py --glove right        any glove that publishes poses
    python client/examples/stack.py --simulated          none at hand: a simulated hand builds a pyramid
    python client/examples/stack.py --simulated --strip stack.svg    four moments as a picture (26 s)

Poses have no place: the mouse moves the hand over the desk, the wheel up and down (or arrow keys, Page up and
Page down). Needs glovecal-client, glovecal-models and MuJoCo (pip install mujoco; it needs no GPU).
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from blocks.building_hand import ABOVE_MM, START_MM, BuildingHand
from blocks.desk import Desk, Scene, pinch_mm
from blocks.picture import desk_drawing
from stream.drawing import Drawing
from stream.hand_stream import Hand, HandStream, add_glove_options, glove_of
from stream.live_page import LivePage
from stream.simulated_hand import simulated_glove

from glovecal_client import open_client

MM_PER_PIXEL, MM_PER_WHEEL, MM_PER_KEY = 0.5, 0.1, 5.0
REACH_MM = np.array([[-230.0, 230.0], [-230.0, 150.0], [8.0, 250.0]])
KEYS = {
    "ArrowLeft": (-1, 0, 0), "ArrowRight": (1, 0, 0), "ArrowUp": (0, 1, 0), "ArrowDown": (0, -1, 0),
    "PageUp": (0, 0, 1), "PageDown": (0, 0, -1),
}  # fmt: skip
HELP = "Mouse over the desk: the hand moves. Wheel: up and down. Pinch a block between thumb and fingers."
SHOWN_S = (1.9, 10.8, 19.6)


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    add_glove_options(parser)
    parser.add_argument("--port", type=int, default=0, help="of the page, on this machine (a free one)")
    parser.add_argument("--strip", type=Path, help="with --simulated: write a picture (SVG) and end")
    options = parser.parse_args(arguments)
    if options.strip and not options.simulated:
        parser.error("--strip needs --simulated: it shows the pyramid being built")
    glove, builder = glove_of(options), None
    with ExitStack() as running:
        endpoint = glove.endpoint
        if options.simulated:
            builder = BuildingHand()
            endpoint = running.enter_context(simulated_glove(glove.site, glove.name, builder.script, 0.0))
        session = running.enter_context(open_client([endpoint]))
        hands = running.enter_context(HandStream(session, glove.site, glove.name))
        if options.strip and builder is not None:
            write_strip(hands, builder, options.strip)
            return
        page = running.enter_context(LivePage("Stack blocks", HELP, options.port))
        print(f"{page.address} shows the desk; Ctrl-C ends.")
        show(hands, page, builder)


class MovedPinch:
    """Where the middle of the pinch is, as mouse and keys move it; mm, in the desk's frame."""

    def __init__(self) -> None:
        self.pinch_mm = np.array([0.0, -60.0, ABOVE_MM])

    def take(self, item: dict[str, Any]) -> None:
        """Moves by one input of the page; what is no number or no key moves nothing."""
        x, y = _number(item.get("dx")), _number(item.get("dy"))
        if item.get("kind") == "move":
            self.pinch_mm += MM_PER_PIXEL * np.array([x, -y, 0.0])
        elif item.get("kind") == "wheel":
            self.pinch_mm -= MM_PER_WHEEL * np.array([0.0, 0.0, y])
        elif item.get("kind") == "key":
            self.pinch_mm += MM_PER_KEY * np.array(KEYS.get(str(item.get("key")), (0, 0, 0)))
        self.pinch_mm = np.clip(self.pinch_mm, REACH_MM[:, 0], REACH_MM[:, 1])


def _number(value: Any) -> float:
    return float(value) if isinstance(value, (int, float)) and abs(value) < 1e4 else 0.0


def show(hands: Iterable[Hand | None], page: LivePage, builder: BuildingHand | None) -> None:
    desk, moved, before_s = Desk(START_MM), MovedPinch(), None
    for hand in hands:
        for item in page.inputs():
            moved.take(item)
        if hand is None:
            page.show(desk_drawing(desk.scene, "no poses from the glove"))
            continue
        place = moved.pinch_mm - pinch_mm(hand.angles_deg)
        if builder is not None:
            place = builder.hand_mm(hand.seconds, hand.angles_deg)
        desk.advance(hand.seconds - (hand.seconds if before_s is None else before_s), place, hand.angles_deg)
        before_s = hand.seconds
        page.show(desk_drawing(desk.scene, "simulated hand" if hand.simulated else ""))


def write_strip(hands: Iterable[Hand | None], builder: BuildingHand, file: Path) -> None:
    desk, before_s, scenes = Desk(START_MM), 0.0, list[Scene]()
    moments = [*SHOWN_S, builder.lasts_s]
    for hand in hands:
        if hand is None:
            continue
        place = builder.hand_mm(hand.seconds, hand.angles_deg)
        desk.advance(hand.seconds - before_s, place, hand.angles_deg)
        before_s = hand.seconds
        if hand.seconds >= moments[len(scenes)]:
            scenes.append(desk.scene)
            if len(scenes) == len(moments):
                break
    drawing = Drawing(1100, 660)
    for place, (scene, at) in enumerate(zip(scenes, moments, strict=True)):
        words = f"{at:.0f} s (simulated hand, MuJoCo)"
        drawing.add(desk_drawing(scene, words, 550, 330), 550 * (place % 2), 330 * (place // 2))
    file.write_text(drawing.svg(), encoding="utf-8")
    print(f"The pyramid of six: {file}")


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        print()
