"""A tracker for one hand and its cameras, from what is kept in a folder; the first time it is built there."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.codes.pca import pca_code
from glovecal_models.colour_glove.database import ENTRIES, DatabaseSettings, pose_database
from glovecal_models.colour_glove.lookup import PoseLookup
from glovecal_models.colour_glove.pattern import Pattern, printed_pattern
from glovecal_models.colour_glove.pose.error_learning import CLIPS, PEOPLE, ShapeSpread, learned_errors
from glovecal_models.colour_glove.pose.hand_tracker import HandTracker
from glovecal_models.colour_glove.pose.window_view import PrintedHand
from glovecal_models.colour_glove.pose_set import PAPER_COUNT, generated_poses
from glovecal_models.colour_glove.skin import HandSkin, hand_skin
from glovecal_models.progress import Cancel, Report, part


def prepared_tracker(
    folder: Path,
    cameras: Sequence[Camera] = (Camera(),),
    *,
    skin: HandSkin | None = None,
    pattern: Pattern | None = None,
    spread: ShapeSpread = PEOPLE,
    entries: int = ENTRIES,
    clips: int = CLIPS,
    stage: str = "dense",
    follows: bool = True,
    workers: int | None = None,
    report: Report | None = None,
    cancelled: Cancel | None = None,
) -> HandTracker:
    """``skin``: the hand to be seen; without one the assumed right hand. ``pattern``: what its glove shows;
    without one what ``glovecal camera sheets`` prints. ``spread``: how far the hand may be from ``skin``.

    The database takes about half a minute on two cores, what is learned of its errors a minute; afterwards
    both are read. Raises BadInput, Cancelled.
    """
    skin = hand_skin() if skin is None else skin
    pattern = printed_pattern() if pattern is None else pattern
    database = pose_database(
        skin, pattern, generated_poses(PAPER_COUNT), folder, DatabaseSettings(entries=entries),
        workers=workers, report=part(report, 0.0, 0.3), cancelled=cancelled,
    )  # fmt: skip
    hand, lookup = PrintedHand(skin, pattern), PoseLookup(database, pca_code(database.transforms))
    errors = learned_errors(
        hand,
        lookup,
        cameras,
        spread=spread,
        clips=clips,
        workers=workers,
        report=part(report, 0.3, 1.0),
        cancelled=cancelled,
    )
    return HandTracker(hand, lookup, cameras, errors, stage=stage, follows=follows)
