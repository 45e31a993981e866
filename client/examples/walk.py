#!/usr/bin/env python3
"""Walk with two fingers: index and middle finger drive a figure's legs, in the browser.

    python client/examples/walk.py --glove right          any glove that publishes poses
    python client/examples/walk.py --simulated            none at hand: simulated fingers
    python client/examples/walk.py --simulated --strip walk.svg    ten steps as a picture, without a browser

Hold the hand as on a desk, both fingertips down, and keep still for the first second: that is upright. Needs
glovecal-client (the poses) and glovecal-models (the hand's kinematics).
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path

from stream.hand_stream import Hand, HandStream, add_glove_options, glove_of
from stream.live_page import LivePage
from stream.simulated_hand import simulated_glove
from walking.figure import Figure, Leg
from walking.picture import figure_drawing, strip
from walking.walking_fingers import lasts_s, walking_fingers

from glovecal_client import open_client

STRIP_STEPS, STRIP_EVERY_S = 10, 0.45
HELP = "Index and middle finger are the legs. Stand still on both for the first second, then walk."


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    add_glove_options(parser)
    parser.add_argument("--port", type=int, default=0, help="of the page, on this machine (a free one)")
    parser.add_argument("--strip", type=Path, help="write a picture of the first seconds (SVG) and end")
    parser.add_argument("--sd", type=float, default=2.0, help="error of the simulated hand, degrees (2)")
    options = parser.parse_args(arguments)
    glove = glove_of(options)
    with ExitStack() as running:
        endpoint = glove.endpoint
        if options.simulated:
            steps = STRIP_STEPS if options.strip else 10_000
            hand = simulated_glove(glove.site, glove.name, walking_fingers(steps), options.sd)
            endpoint = running.enter_context(hand)
        session = running.enter_context(open_client([endpoint]))
        hands = running.enter_context(HandStream(session, glove.site, glove.name))
        if options.strip:
            write_strip(hands, options.strip, lasts_s(STRIP_STEPS))
            return
        page = running.enter_context(LivePage("Walk with two fingers", HELP, options.port))
        print(f"{page.address} shows the figure; Ctrl-C ends.")
        show(hands, page)


def show(hands: Iterable[Hand | None], page: LivePage) -> None:
    figure, legs = Figure(), None
    for hand in hands:
        if hand is not None:
            legs = figure.follow(hand)
        if legs is not None:
            state = "stand still" if figure.standing else f"{figure.steps} steps"
            state = "no poses from the glove" if hand is None else state
            walked = f"{figure.hip_mm[0] / 1000:.1f} m"
            words = f"{state}, {walked}" + (" (simulated hand)" if hand and hand.simulated else "")
            page.show(figure_drawing(legs, words=words))


def write_strip(hands: Iterable[Hand | None], file: Path, seconds: float) -> None:
    figure, moments, simulated = Figure(), list[tuple[float, tuple[Leg, Leg]]](), False
    for hand in hands:
        if hand is None:
            continue
        moments.append((hand.seconds, figure.follow(hand)))
        simulated = hand.simulated
        if hand.seconds - moments[0][0] >= seconds:
            break
    shown, next_s = list[tuple[Leg, Leg]](), moments[0][0]
    for at, legs in moments:
        if at >= next_s:
            shown.append(legs)
            next_s = at + STRIP_EVERY_S
    whose = "simulated hand" if simulated else "a hand"
    title = f"{figure.steps} steps of two fingers ({whose}), a figure every {STRIP_EVERY_S:g} s; "
    title += "dot: foot planted"
    file.write_text(strip(shown, title).svg(), encoding="utf-8")
    print(f"{figure.steps} steps, {figure.hip_mm[0] / 1000:.2f} m: {file}")


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        print()
