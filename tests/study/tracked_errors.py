"""``python3 do.py study camera-errors``: the tracker's errors on hands that are not the model's.

Label images are rendered, of moving hands with other bones and radii, and spoilt as a classifier spoils them;
each frame is tracked by one camera and by two, 60 degrees apart. From the errors come the constants of
``simulation/simulated_camera.py``: how large they are and are stated, how they lean, how long they last.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from simulated_camera import ERRORS, towards_prior

from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.hand_state import FINGER_ROTATIONS, HandState
from glovecal_models.colour_glove.photograph import hand_motion
from glovecal_models.colour_glove.pose.error_learning import ShapeSpread, other_hand, prepared_tracker, spoilt
from glovecal_models.colour_glove.pose.hand_shape_fit import HandShape, fitted_hand_shape
from glovecal_models.colour_glove.pose.hand_tracker import HandTracker
from glovecal_models.colour_glove.pose.window_view import PrintedHand
from glovecal_models.colour_glove.rasterise import rasterise
from glovecal_models.colour_glove.skin import HandSkin, posed
from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG
from glovecal_models.worker_processes import pin_blas_to_one_thread

RATE_HZ, SECONDS = 30.0, 10.0
FIRST_SEED = 7000
"""Hands and motions of smaller seeds are those that the stated deviations are learned from."""
ASIDE_DEG, AROUND_MM = 60.0, 470.0
"""The second camera looks at the same place from the side."""
ENTRIES, CLIPS = 20_000, 36
SHAPE_PICTURES = 30
PLATEAU_S = (1.5, 3.0)
"""Lags at which what is left of the correlation stays as long as the hand does."""


@dataclass(frozen=True, eq=False)
class TrackedHand:
    """One hand's frames (F, 20): degrees, and whether each is accepted."""

    frames: np.ndarray
    """(F,) numbers."""
    truth: np.ndarray
    error: np.ndarray
    sd: np.ndarray
    accepted: np.ndarray


def cameras(count: int) -> tuple[Camera, ...]:
    angle = np.radians(-ASIDE_DEG)
    turn = np.array(
        [[np.cos(angle), 0.0, np.sin(angle)], [0.0, 1.0, 0.0], [-np.sin(angle), 0.0, np.cos(angle)]]
    )
    around = np.array([0.0, 0.0, AROUND_MM])
    rows = tuple(tuple(map(float, row)) for row in turn)
    aside = Camera(rotation=rows, translation_mm=tuple(map(float, around - turn @ around)))  # type: ignore[arg-type]
    return (Camera(), aside)[:count]


def fitted(first: HandTracker, number: int) -> HandShape:
    """From 30 pictures that show it in other poses than those it is judged by."""
    hand, rng = other_hand(first.hand.skin, FIRST_SEED + number), np.random.default_rng([number, 5])
    states = hand_motion(hand, 2.0 * SHAPE_PICTURES, 0.5, seed=FIRST_SEED + 500 + number)
    return fitted_hand_shape(first, [_seen(first, hand, state, rng) for state in states[:SHAPE_PICTURES]])


def tracked(
    first: HandTracker, number: int, seconds: float = SECONDS, *, model: HandSkin | None = None
) -> TrackedHand:
    """A hand of its own, followed from frame to frame at stage dense; ``model``: taken for it, without one
    the hand assumed."""
    hand = other_hand(first.hand.skin, FIRST_SEED + number)
    rng = np.random.default_rng([FIRST_SEED + number, 4])
    taken = first.hand if model is None else PrintedHand(model, first.hand.pattern)
    tracker = HandTracker(taken, first.lookup, first.cameras, first.errors, stage="dense")
    rows = []
    for frame, state in enumerate(hand_motion(hand, seconds, RATE_HZ, seed=FIRST_SEED + number)):
        pose = tracker.track(_seen(first, hand, state, rng), frame / RATE_HZ)
        if pose is not None:
            error = pose.state.angles_deg - state.angles_deg
            rows.append((frame, state.angles_deg, error, pose.standard_deviation[:20], pose.accepted))
    return TrackedHand(*(np.array(column) for column in zip(*rows, strict=True)))


def _seen(first: HandTracker, hand: HandSkin, state: HandState, rng: np.random.Generator) -> list[np.ndarray]:
    placed = posed(hand, state)
    return [
        spoilt(rasterise(placed, hand.triangles, camera).painted(first.hand.pattern.colour), rng)
        for camera in first.cameras
    ]


def table(hands: Sequence[TrackedHand]) -> str:
    """In Markdown: over all, and by the kind of joint."""
    truth, error, sd, accepted = (
        np.concatenate([getattr(hand, part) for hand in hands])
        for part in ("truth", "error", "sd", "accepted")
    )
    score, lean = error / sd, towards_prior(truth)
    at, correlation = correlations(hands)
    plateau = float(correlation[(at >= PLATEAU_S[0]) & (at <= PLATEAU_S[1])].mean())
    rest = (correlation[at < PLATEAU_S[0]] - plateau) / (1.0 - plateau)
    lasts = float((2.0 * rest.sum() - 1.0) / RATE_HZ)
    lines = [
        f"{len(error)} frames of {len(hands)} hands: mean absolute error {np.abs(error).mean():.1f} degrees. "
        f"Accepted: {100 * accepted.mean():.0f} %, RMS {_rms(error[accepted]):.1f} degrees, error over "
        f"stated deviation {_rms(score[accepted]):.2f} (of all {_rms(score):.2f}), "
        f"{_covered(score[accepted]):.0f} % within the 95 % interval.",
        f"Errors last {lasts:.2f} s; {100 * plateau:.0f} % of their variance stays as long as the hand "
        f"does; lean to the prior {_lean(score, lean):.2f} of the deviation.",
        "",
        "| joint | accepted | RMS error, degrees | median stated SD, degrees | error over stated | lean | "
        "mean error at little, middle, deep flexion, degrees |",
        "|---|---|---|---|---|---|---|",
    ]
    for kind in ERRORS:
        columns = [number for number, name in enumerate(FINGER_ROTATIONS) if name.rpartition("_")[2] == kind]
        e, s, a = error[:, columns], sd[:, columns], accepted[:, columns]
        bent = np.column_stack([_bent(FINGER_ROTATIONS[number], truth[:, number]) for number in columns])
        thirds = ", ".join(
            f"{e[(bent >= low) & (bent <= low + 1 / 3)].mean():+.1f}" for low in (0.0, 1 / 3, 2 / 3)
        )
        lines.append(
            f"| {kind} | {100 * a.mean():.0f} % | {_rms(e):.1f} | {np.median(s):.1f} | {_rms(e / s):.2f} | "
            f"{_lean(score[:, columns], lean[:, columns]):.2f} | {thirds} |"
        )
    return "\n".join(lines)


def correlations(hands: Sequence[TrackedHand]) -> tuple[np.ndarray, np.ndarray]:
    """Lags in seconds, and the correlation of errors over stated deviations at each; no mean is taken off."""
    lags = np.arange(round(PLATEAU_S[1] * RATE_HZ) + 1)
    products, counts = np.zeros((2, len(lags)))
    for hand in hands:
        score = np.full((int(hand.frames.max()) + 1, hand.error.shape[1]), np.nan)
        score[hand.frames] = hand.error / hand.sd
        for lag in lags[: len(score)]:
            both = score[: len(score) - lag] * score[lag:]
            products[lag] += np.nansum(both)
            counts[lag] += np.isfinite(both).sum()
    return lags / RATE_HZ, products / np.maximum(counts, 1) / (products[0] / max(counts[0], 1))


def _percent(spread: ShapeSpread) -> str:
    return f"{100 * spread.bones:.1f} % of bones and {100 * spread.overall:.1f} % of the size"


def _lean(score: np.ndarray, lean: np.ndarray) -> float:
    """Regression on the way to the prior, of errors scaled to variance 1."""
    return float(np.mean((score * lean).mean(axis=0) / np.sqrt((score**2).mean(axis=0))))


def _bent(name: str, angle: np.ndarray) -> np.ndarray:
    low, high = ACTIVE_RANGE_DEG[name]
    return np.clip((angle - low) / (high - low), 0.0, 1.0)


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else float("nan")


def _covered(score: np.ndarray) -> float:
    return 100.0 * float((np.abs(score) < 1.96).mean()) if score.size else float("nan")


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="do.py study camera-errors", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("--hands", type=int, default=16, help="each for 10 s (default 16)")
    parser.add_argument("--folder", type=Path, default=Path(".study"), help="for database and table")
    parser.add_argument(
        "--shapes", action="store_true", help="each hand's shape is fitted to 30 other pictures of it first"
    )
    parser.add_argument("--smoke", action="store_true", help="two hands for 2 s, a small database")
    options = parser.parse_args(arguments)
    pin_blas_to_one_thread()
    if options.smoke:
        with tempfile.TemporaryDirectory() as folder:
            print(report(Path(folder), 2, 2.0, entries=300, clips=3))
        return 0
    database = options.folder / "colour-glove"
    database.mkdir(parents=True, exist_ok=True)
    text = report(database, options.hands, SECONDS, entries=ENTRIES, clips=CLIPS, fits_shape=options.shapes)
    print(text)
    name = "camera-errors-shapes.md" if options.shapes else "camera-errors.md"
    (options.folder / name).write_text(text, encoding="utf-8")
    return 0


def report(
    database: Path, hands: int, seconds: float, *, entries: int, clips: int, fits_shape: bool = False
) -> str:
    text = "# The tracker's errors: rendered label images, hands that are not the model's\n"
    for count, name in ((1, "One camera"), (2, "Two cameras")):
        first = prepared_tracker(database, cameras(count), entries=entries, clips=clips)
        models: list[HandSkin | None] = [None] * hands
        if fits_shape:
            shapes = [fitted(first, number) for number in range(hands)]
            models = [shape.skin for shape in shapes]
            left = [sd**2 for shape in shapes for sd in shape.bones_sd.values()]
            size = np.sqrt(np.mean([shape.size_sd**2 for shape in shapes]))
            spread = ShapeSpread.after_fit(float(size), [float(np.sqrt(np.mean(left)))])
            first = prepared_tracker(database, cameras(count), spread=spread, entries=entries, clips=clips)
            text += f"\n{name}: the fit leaves {_percent(spread)} open.\n"
        found = [tracked(first, number, seconds, model=model) for number, model in enumerate(models)]
        text += f"\n## {name}\n\n{table(found)}\n"
    return text


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
