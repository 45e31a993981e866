"""``python3 do.py study camera-errors``: the tracker's errors on hands and in pictures it never saw.

Hands of other people in gloves sewn from the printed sheets (``worn_glove``), in rooms with soft and with
hard light (``lit_glove``), before cameras with other lenses: drawn by nothing that the tracker is made from,
and of other seeds than those that anything was chosen on. Each frame is tracked by one camera and by two, 60
degrees apart, in the shape that was fitted to other moments of the same hand, as ``glovecal camera
estimates`` does. ``--learn`` learns the errors that the tracker states, on its own drawings, and writes the
file that comes with the package.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
import picture_sizes
from error_learning import CLIPS, learned_errors, learned_on_fitted_hands
from lit_glove import HARD, SOFT
from simulated_camera import ERRORS, towards_prior
from tracked_hands import FIRST_SEED, RATE_HZ, SECONDS, Study, TrackedHand, tracked

from glovecal_models.colour_glove.database import ENTRIES, DatabaseSettings, pose_database
from glovecal_models.colour_glove.hand_state import FINGER_ROTATIONS
from glovecal_models.colour_glove.lookup import PoseLookup, pca_code
from glovecal_models.colour_glove.pattern import printed_pattern
from glovecal_models.colour_glove.pose.hand_tracker import SHIPPED, shipped_name
from glovecal_models.colour_glove.pose.window_view import PrintedHand
from glovecal_models.colour_glove.pose_set import PAPER_COUNT, generated_poses
from glovecal_models.colour_glove.skin import hand_skin
from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG
from glovecal_models.worker_processes import pin_blas_to_one_thread, work_off

PLATEAU_S = (1.5, 3.0)
"""Lags at which what is left of the correlation stays as long as the hand does."""
_FARTHER_DEG = 20.0


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
        f"Accepted: {100 * accepted.mean():.0f} %, RMS {_rms(error[accepted]):.1f} degrees, "
        f"{_covered(score[accepted]):.0f} % within the 95 % interval (of all {_covered(score):.0f} %), "
        f"{100 * float((np.abs(error[accepted]) > _FARTHER_DEG).mean()):.1f} % off by over 20 degrees.",
        _by_light(hands),
        f"Errors last {lasts:.2f} s; {100 * plateau:.0f} % of their variance stays as long as the hand "
        f"does; lean to the prior {_lean(score, lean):.2f} of the deviation. {_by_motion(hands)}",
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


def _by_light(hands: Sequence[TrackedHand]) -> str:
    said = []
    for light in (SOFT, HARD):
        those = [hand for hand in hands if hand.light == light]
        if those:
            right, every = np.sum([hand.pixels for hand in those], axis=0)
            error, sd, accepted = (
                np.concatenate([getattr(hand, part) for hand in those])
                for part in ("error", "sd", "accepted")
            )
            said.append(
                f"In {light} light {100 * right / every:.0f} % of the glove's pixels are right, mean "
                f"absolute error {np.abs(error).mean():.1f} degrees, accepted "
                f"{100 * accepted.mean():.0f} %, of these {_covered((error / sd)[accepted]):.0f} % within "
                "the interval."
            )
    bones = [hand.bones for hand in hands if hand.bones is not None]
    if bones:
        off, stated = 100.0 * np.mean(bones, axis=0)
        said.append(f"Lengths of bones are off by {off:.1f} %, RMS; {stated:.1f} % are stated.")
    return " ".join(said)


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


def trailing_s(hand: TrackedHand) -> float:
    """By how much estimates come late: the regression of errors on the true angles' speed, by the stated
    deviations; what stays is taken off. Frames that follow one another only."""
    speed = np.gradient(hand.truth, hand.frames / RATE_HZ, axis=0)
    weight = np.where(np.gradient(hand.frames)[:, None] == 1.0, hand.sd**-2.0, 0.0)
    off = hand.error - hand.error.mean(axis=0)
    return float(-(weight * off * speed).sum() / (weight * speed**2).sum())


def _by_motion(hands: Sequence[TrackedHand]) -> str:
    late_ms = [1e3 * trailing_s(hand) for hand in hands if len(hand.frames) > 1]
    if len(late_ms) < 2:
        return ""
    mean, spread = np.mean(late_ms), np.std(late_ms, ddof=1)
    return f"Estimates come {mean:+.1f} ms late, SD {spread:.1f} ms between hands."


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
    parser.add_argument("--hands", type=int, default=16, help="each for 5 s (default 16)")
    parser.add_argument("--folder", type=Path, default=Path(".study"), help="for database and table")
    parser.add_argument("--unfitted", action="store_true", help="no hand's shape is fitted first")
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED, help="of the first hand")
    parser.add_argument("--learn", action="store_true", help="write what the tracker states of its errors")
    parser.add_argument(
        "--sizes", action="store_true", help="two hands (from seed 9300) by sensors of 640 to 3840 pixels"
    )
    parser.add_argument("--smoke", action="store_true", help="two hands for half a second, a small database")
    options = parser.parse_args(arguments)
    pin_blas_to_one_thread()
    if options.smoke:
        with tempfile.TemporaryDirectory() as folder:
            print(report(Path(folder), 2, 0.5, entries=300))
        return 0
    database = options.folder / "colour-glove"
    database.mkdir(parents=True, exist_ok=True)
    if options.learn:
        learn(database, CLIPS)
        return 0
    if options.sizes:
        text = picture_sizes.report(database, ENTRIES)
        print(text)
        (options.folder / "camera-sizes.md").write_text(text, encoding="utf-8")
        return 0
    text = report(
        database, options.hands, SECONDS, entries=ENTRIES, fits_shape=not options.unfitted,
        first_seed=options.first_seed,
    )  # fmt: skip
    print(text)
    name = "camera-errors-unfitted.md" if options.unfitted else "camera-errors.md"
    (options.folder / name).write_text(text, encoding="utf-8")
    return 0


def report(
    folder: Path, hands: int, seconds: float, *, entries: int, fits_shape: bool = False,
    first_seed: int = FIRST_SEED,
) -> str:  # fmt: skip
    text = "# The tracker's errors: hands, gloves and pictures that it never saw\n"
    for count, name in ((1, "One camera"), (2, "Two cameras")):
        study = Study(folder, count, seconds, entries, fits_shape, first_seed)
        _ = study.tracker, study.colours  # made once, not in each process
        found: dict[int, TrackedHand] = {}
        work_off(partial(tracked, study), range(hands), os.cpu_count() or 1, found.__setitem__, "tracking")
        those = [hand for _, hand in sorted(found.items())]
        refused = sum(hand.bones is None for hand in those)
        refusals = f"{refused} of {hands} shapes were refused. " if fits_shape else ""
        text += f"\n## {name}\n\n{refusals}{table(those)}\n"
    return text


def learn(folder: Path, clips: int) -> None:
    """An hour of drawing: for one camera and two, of hands as they are assumed and as they are fitted."""
    hand, arrays = PrintedHand(hand_skin(), printed_pattern()), {}
    poses, settings = generated_poses(PAPER_COUNT), DatabaseSettings(entries=ENTRIES)
    database = pose_database(hand.skin, hand.pattern, poses, folder, settings)
    lookup = PoseLookup(database, pca_code(database.transforms))
    for count in (1, 2):
        learned = learned_errors(hand, lookup, count, clips=clips)
        fitted = learned_on_fitted_hands(hand, lookup, count, learned)
        for beginning, each in ((shipped_name(count), learned), (shipped_name(count, True), fitted)):
            arrays |= {beginning + name: array.astype(np.float32) for name, array in each.arrays().items()}
    np.savez_compressed(SHIPPED, allow_pickle=False, **arrays)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
