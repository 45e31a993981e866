#!/usr/bin/env python3
"""Finger spelling: text from a glove, by the nearest letter of the American manual alphabet.

    python client/examples/spell.py --glove right              text in the terminal, any glove
    python client/examples/spell.py --page                     and the hand in the browser
    python client/examples/spell.py --simulated --say "HELLO"  none at hand: a simulated hand spells
    python client/examples/spell.py --confusion                which letters are taken for which (simulated)
    python client/examples/spell.py --pictures FOLDER          alphabet and confusion tables as SVG

24 static letters; J and Z are motions and are left out. Needs glovecal-client and glovecal-models.
"""

from __future__ import annotations

import argparse
from contextlib import ExitStack
from pathlib import Path

from spelling.alphabet import LETTERS, LETTERS_DEG
from spelling.confusion import picture, sentences, simulated_confusion, table
from spelling.speller import Speller
from spelling.spelling_hand import spelling_hand
from stream.drawing import Drawing
from stream.hand_drawing import PALM_VIEW, hand_drawing
from stream.hand_stream import Hand, HandStream, add_glove_options, glove_of
from stream.live_page import LivePage
from stream.simulated_hand import simulated_glove

from glovecal_client import open_client
from glovecal_models.hand.skeleton import hand_skeleton

SOURCES = {"data-glove": (5.0, None), "camera": (8.0, 20.0)}
"""Error of a joint in degrees, and of one that a camera does not see."""
HELP = "Hold each letter for a moment; relax the hand between words."


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    add_glove_options(parser)
    parser.add_argument("--say", default="HELLO WORLD", help="what the simulated hand spells")
    parser.add_argument("--sd", type=float, default=2.0, help="error of the simulated hand, degrees (2)")
    parser.add_argument("--page", action="store_true", help="show the hand in the browser")
    parser.add_argument("--port", type=int, default=0, help="of the page, on this machine (a free one)")
    parser.add_argument("--confusion", action="store_true", help="print the simulated confusion tables")
    parser.add_argument("--pictures", type=Path, help="write alphabet and confusion tables (SVG) there")
    options = parser.parse_args(arguments)
    if options.confusion:
        for seen, hidden in SOURCES.values():
            for wrist in (True, False):
                confusion = simulated_confusion(seen, hidden, wrist=wrist)
                print(sentences(confusion), table(confusion), sep="\n", end="\n\n")
    elif options.pictures:
        write_pictures(options.pictures)
    else:
        spell(options)


def spell(options: argparse.Namespace) -> None:
    glove, end_s = glove_of(options), float("inf")
    with ExitStack() as running:
        endpoint = glove.endpoint
        if options.simulated:
            script, end_s = spelling_hand(options.say)
            hand = simulated_glove(glove.site, glove.name, script, options.sd)
            endpoint = running.enter_context(hand)
        session = running.enter_context(open_client([endpoint]))
        hands = running.enter_context(HandStream(session, glove.site, glove.name))
        page = None
        if options.page:
            page = running.enter_context(LivePage("Finger spelling", HELP, options.port))
            print(f"{page.address} shows the hand; Ctrl-C ends.")
        speller = Speller()
        for hand in hands:
            if hand is not None:
                print(speller.follow(hand), end="", flush=True)
                if page is not None:
                    page.show(spelled_drawing(speller, hand))
                if hand.seconds > end_s:
                    print()
                    return


def spelled_drawing(speller: Speller, hand: Hand) -> Drawing:
    drawing = Drawing(800, 400)
    drawing.add(hand_drawing(hand_skeleton(), hand.angles_deg, PALM_VIEW, 380), 10, 10)
    nearest = speller.nearest
    if nearest is not None:
        drawing.text((430, 150), nearest.letter or "no letter", 80 if nearest.letter else 36)
        drawing.text((430, 190), f"distance {nearest.distance:.1f} sd, next {nearest.second}", 16, "#5a6773")
    drawing.text((430, 260), speller.text[-24:], 28)
    if hand.simulated:
        drawing.text((430, 385), "simulated hand", 14, "#5a6773")
    return drawing


def write_pictures(folder: Path) -> None:
    for name, (seen, hidden) in SOURCES.items():
        drawing = picture(simulated_confusion(seen, hidden))
        (folder / f"spelling-confusion-{name}.svg").write_text(drawing.svg(), encoding="utf-8")
    (folder / "spelling-alphabet.svg").write_text(alphabet_drawing().svg(), encoding="utf-8")


def alphabet_drawing(columns: int = 8, size: float = 125) -> Drawing:
    """Every letter's hand, its palm to the reader, as the table of angles has it."""
    rows = -(-len(LETTERS) // columns)
    drawing = Drawing(columns * size, rows * (size + 18))
    for place, letter in enumerate(LETTERS):
        x, y = (place % columns) * size, (place // columns) * (size + 18)
        hand = hand_drawing(hand_skeleton(), LETTERS_DEG[place], PALM_VIEW, size)
        drawing.add(hand, x, y + 14)
        drawing.text((x + 10, y + 20), letter, 18)
    return drawing


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        print()
