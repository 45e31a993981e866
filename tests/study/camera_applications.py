"""``python3 do.py study camera-applications``: spelling, walking and stacking by a camera's poses.

Worn hands of another program (``worn_glove``) spell, walk with two fingers and set blocks in a row, as the
scripts of ``client/examples`` do, before the cameras of ``study camera-errors``: the palm towards them,
turning slowly by up to 15 degrees. What the tracker makes of the pictures drives the examples, as a glove
does, in the hand's fitted shape: one camera followed live, two followed both ways, as recordings are. Beside
it what errors of a known size leave of each: how well a hand has to be measured.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from blocks.building_hand import PYRAMID_MM, START_MM, BuildingHand
from blocks.desk import Desk
from scipy.spatial.transform import Rotation
from spelling.alphabet import LETTERS, SAME_SHAPE
from spelling.speller import Speller
from spelling.spelling_hand import HELD_S, WAY_S, spelling_hand
from stream.hand_stream import Hand, complete_hand
from stream.simulated_hand import CorrelatedErrors, Script
from tracked_hands import ORDER, Moments, Study, afresh, fitted_tracker, worn_hand
from walking.figure import Figure
from walking.walking_fingers import lasts_s, walking_fingers
from worn_glove import ROTATIONS

from glovecal_models.colour_glove.database import ENTRIES
from glovecal_models.colour_glove.hand_state import FINGER_ROTATIONS, PoseEstimate
from glovecal_models.colour_glove.pose.both_ways import followed_both_ways
from glovecal_models.worker_processes import pin_blas_to_one_thread, work_off

FIRST_SEED, HANDS = 9310, 2
RATE_HZ = 10.0
"""A third of a webcam's: pictures are drawn for minutes."""
STEPS = 10
ROW = 3
"""Blocks of the pyramid's lowest row: what is on top of them tells nothing more of a hand."""
TURNS_DEG, TURN_S = 15.0, (5.0, 7.0, 9.0)
"""How far the palm turns from facing the camera, about each axis, and how long there and back takes."""
AWAY_MM, CENTRE_MM = 450.0, (85.0, 0.0, 0.0)
"""The hand's middle, from the camera and from the wrist."""
STANDS_MM = 4.0
"""From its place: a block that is where it belongs."""
ERRORS_DEG = (1.0, 2.0, 3.0, 5.0, 8.0)
TRIALS = 6
_FACING = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""Fingers upwards in the picture, the palm towards the camera."""
_TEXT = "".join(letter for letter in LETTERS if letter not in "".join(SAME_SHAPE))
"""Letters of a shape of their own: a camera does not measure the wrist, which tells others apart."""


@dataclass(frozen=True, eq=False)
class Application:
    """One of ``client/examples``, with the script of a hand that uses it."""

    name: str
    script: Script
    seconds: float
    attained: Callable[[Sequence[Hand]], float]
    """Of a whole run: the share of what was to be done, 0 to 1."""


def applications() -> tuple[Application, ...]:
    spelling, spelling_s = spelling_hand(_TEXT)
    builder = BuildingHand()
    row_s = builder.lasts_s * ROW / len(PYRAMID_MM)
    return (
        Application("spelling", spelling, spelling_s, letters_read),
        Application("walking", walking_fingers(STEPS), lasts_s(STEPS), steps_counted),
        Application("stacking", builder.script, row_s, partial(blocks_placed, builder)),
    )


def letters_read(hands: Sequence[Hand]) -> float:
    """Letters that came out while they were shown."""
    speller, right = Speller(), set[int]()
    for hand in hands:
        place = int((hand.seconds - 0.3) // (WAY_S + HELD_S))
        if speller.follow(hand) == _TEXT[min(max(place, 0), len(_TEXT) - 1)]:
            right.add(place)
    return len(right) / len(_TEXT)


def steps_counted(hands: Sequence[Hand]) -> float:
    """Steps too many are as wrong as steps too few."""
    figure = Figure()
    for hand in hands:
        figure.follow(hand)
    return max(0.0, 1.0 - abs(figure.steps - STEPS) / STEPS)


def blocks_placed(builder: BuildingHand, hands: Sequence[Hand]) -> float:
    """Whoever builds sees the hand as it is drawn, and brings its pinch to the block."""
    desk, before_s = Desk(START_MM), 0.0
    for hand in hands:
        place = builder.hand_mm(hand.seconds, hand.angles_deg)
        desk.advance(hand.seconds - before_s, place, hand.angles_deg)
        before_s = hand.seconds
    away = np.linalg.norm(desk.scene.blocks_mm[:ROW] - PYRAMID_MM[:ROW], axis=1)
    return float((away < STANDS_MM).mean())


def moments_of(application: Application, seed: int) -> Moments:
    """Before the first camera, ``RATE_HZ`` times a second."""
    times = np.arange(0.0, application.seconds, 1.0 / RATE_HZ)
    scripted = [application.script(time) for time in times]
    angles = np.array([[moment[name] for name in ROTATIONS] for moment in scripted])
    phase = np.random.default_rng([seed, 61]).uniform(0.0, 2.0 * np.pi, 3)
    swing = TURNS_DEG * np.sin(2.0 * np.pi * times[:, None] / np.array(TURN_S) + phase)
    turns = Rotation.from_euler("xyz", swing, degrees=True).as_matrix() @ _FACING
    return angles, turns, np.array([0.0, 0.0, AWAY_MM]) - turns @ np.array(CENTRE_MM)


@dataclass(frozen=True)
class Driven:
    """One application by one hand before the cameras."""

    attained: float
    rms_deg: float
    """Of the errors of all angles."""


def driven(studies: tuple[Study, Study], number: int) -> dict[str, tuple[Driven, Driven]]:
    """By application: by one camera, and by both. ``studies``: with one camera, and with two."""
    one, both = studies
    live = fitted_tracker(one, worn_hand(one, number))[0]
    hand = worn_hand(both, number)
    recorded = fitted_tracker(both, hand)[0]
    found = {}
    for application in applications():
        moments = moments_of(application, hand.seed)
        seen = [
            ([both.colours.labels(room.picture(*moment, index)[0]) for room in hand.rooms], index / RATE_HZ)
            for index, moment in enumerate(zip(*moments, strict=True))
        ]
        follower, forwards, backwards = afresh(live), afresh(recorded), afresh(recorded)
        by_one = [follower.track(labels[:1], seconds) for labels, seconds in seen]
        by_both = list(followed_both_ways(forwards, backwards, seen))
        truth = moments[0][:, ORDER]
        found[application.name] = _driven(application, by_one, truth), _driven(application, by_both, truth)
    return found


def _driven(application: Application, poses: Sequence[PoseEstimate | None], truth: np.ndarray) -> Driven:
    shown = [(index, pose) for index, pose in enumerate(poses) if pose is not None]
    errors = [pose.state.angles_deg - truth[index] for index, pose in shown]
    attained = application.attained([_hand(index / RATE_HZ, pose) for index, pose in shown])
    return Driven(attained, float(np.sqrt(np.mean(np.square(errors)))))


def _hand(seconds: float, pose: PoseEstimate) -> Hand:
    """As ``HandStream`` makes it of a pose on the network."""
    angles, deviations = pose.state.angles_deg.tolist(), pose.standard_deviation.tolist()
    named = dict(zip(FINGER_ROTATIONS, angles, strict=True))
    return complete_hand(seconds, named, dict(zip(FINGER_ROTATIONS, deviations, strict=False)), True)


def with_errors(application: Application, sd_deg: float, *, stays: bool, seed: int) -> float:
    """What is attained with errors of this standard deviation in all angles: the same all the time, each
    angle's its own (``stays``), or as the examples' simulated hand errs (0.5 s, joints correlated by 0.3)."""
    chance = CorrelatedErrors(sd_deg, len(FINGER_ROTATIONS), seed)
    same = sd_deg * np.random.default_rng([seed, 62]).standard_normal(len(FINGER_ROTATIONS))
    hands = []
    for time in np.arange(0.0, application.seconds, 1.0 / RATE_HZ).tolist():
        script, off = application.script(time), same if stays else chance.next(1.0 / RATE_HZ)
        named = {name: script[name] + error for name, error in zip(FINGER_ROTATIONS, off, strict=True)}
        hands.append(complete_hand(time, named, dict.fromkeys(named, max(sd_deg, 0.5)), True))
    return application.attained(hands)


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="do.py study camera-applications", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("--hands", type=int, default=HANDS, help=f"before the cameras (default {HANDS})")
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED, help="of the first hand")
    parser.add_argument("--folder", type=Path, default=Path(".study"), help="for database and table")
    parser.add_argument("--smoke", action="store_true", help="errors of two sizes, no camera")
    options = parser.parse_args(arguments)
    pin_blas_to_one_thread()
    if options.smoke:
        print(needed((1.0, 12.0), 1))
        return 0
    database = options.folder / "colour-glove"
    database.mkdir(parents=True, exist_ok=True)
    text = f"{by_camera(database, options.hands, options.first_seed)}\n\n{needed(ERRORS_DEG, TRIALS)}\n"
    print(text)
    (options.folder / "camera-applications.md").write_text(text, encoding="utf-8")
    return 0


def by_camera(folder: Path, hands: int, first_seed: int, entries: int = ENTRIES) -> str:
    """In Markdown: a row for each hand and number of cameras."""
    names = [each.name for each in applications()]
    one, two = (Study(folder, count, 0.0, entries, True, first_seed) for count in (1, 2))
    studies = one, two
    for study in studies:
        _ = study.tracker, study.colours  # made once, not in each process
    runs: dict[int, dict[str, tuple[Driven, Driven]]] = {}
    work_off(partial(driven, studies), range(hands), os.cpu_count() or 1, runs.__setitem__, "tracking")
    lines = [f"| | {' | '.join(names)} |", "|---" * (1 + len(names)) + "|"]
    for place, cameras in enumerate(("one camera", "two cameras")):
        for number, run in sorted(runs.items()):
            each = [run[name][place] for name in names]
            cells = [f"{100 * one.attained:.0f} % (RMS {one.rms_deg:.1f} degrees)" for one in each]
            lines.append(f"| {cameras}, hand {first_seed + number} | {' | '.join(cells)} |")
    return "\n".join(lines)


def needed(errors_deg: Sequence[float], trials: int) -> str:
    """In Markdown: what errors of these sizes leave, mean of ``trials``."""
    those = applications()
    lines = [f"| errors | {' | '.join(each.name for each in those)} |", "|---" * (1 + len(those)) + "|"]
    for stays, name in ((False, "of 0.5 s"), (True, "that stay")):
        for sd_deg in errors_deg:
            means = [
                np.mean([with_errors(each, sd_deg, stays=stays, seed=seed) for seed in range(trials)])
                for each in those
            ]
            cells = " | ".join(f"{100 * mean:.0f} %" for mean in means)
            lines.append(f"| {sd_deg:g} degrees, {name} | {cells} |")
    return "\n".join(lines)


if __name__ == "__main__":
    import camera_applications  # by this name worker processes find its work

    sys.exit(camera_applications.main(sys.argv[1:]))
