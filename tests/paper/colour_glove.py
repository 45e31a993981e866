"""Wang & Popovic 2009 on rendered images: what a larger database buys (Figure 8), what codes do (Figure 9).

The hands looked up are held out from what the database is made of, and rendered by the same hand model: an
upper bound of what photographs give.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from boosted_code import boosted_code

from glovecal_models.colour_glove.crop import distance_transform
from glovecal_models.colour_glove.database import (
    DatabaseSettings,
    PoseDatabase,
    orientations,
    palm_centre,
    pose_database,
    rendered_views,
)
from glovecal_models.colour_glove.lookup import Code, PoseLookup, pca_code
from glovecal_models.colour_glove.pattern import glove_pattern
from glovecal_models.colour_glove.pose_set import PAPER_COUNT, generated_poses
from glovecal_models.colour_glove.skin import configured, hand_skin
from glovecal_models.progress import Report, part

SIZES = (100, 1_000, 10_000, 100_000)
SAMPLINGS = ("low-dispersion", "random")
HELD_OUT, QUICK_HELD_OUT, QUICK_DIVISOR = 500, 40, 10
CODED, PAPER_RANK, PAPER_RANK_SD, PAPER_GAIN = 100_000, 16.0, 78.0, 50.0
BITS = (32, 64, 128, 192, 256)
RERANKED = 300
_EVERY = 100
"""Vertex: about fifty give the RMS distance within some per cent."""


@dataclass(frozen=True)
class CoverageRow:
    entries: int
    sampling: str
    pose_nearest_mm: float
    """Mean vertex RMS distance of the held-out hand to the entry nearest in pose."""
    image_nearest_px2: float
    """Mean image distance to the entry nearest in image."""
    found_mm: float
    """Vertex RMS distance to the entry nearest in image: what a look-up answers."""
    found_deg: float
    """Mean absolute joint error of it."""


@dataclass(frozen=True)
class CodeRow:
    code: str
    entries: int
    queries: int
    rank_mean: float
    rank_sd: float
    rank_median: float
    within: float
    """Share of queries whose true neighbour is among the 300 that are compared."""
    learned_s: float | None
    """None: the beginning of a longer code, which was learned once."""
    look_up_ms: float
    brute_ms: float
    """Processor time of one thread, as are ``learned_s`` and ``look_up_ms``."""


@dataclass(frozen=True)
class _HeldOut:
    angles_deg: np.ndarray
    rotations: np.ndarray
    tiny: np.ndarray
    rest_deg: np.ndarray
    """The poses that are left for the database."""


def coverage(
    size: int, sampling: str, seed: int, quick: bool, report: Report
) -> Mapping[str, Sequence[CoverageRow]]:
    held = _held_out(seed, quick)
    with TemporaryDirectory(prefix="glovecal-paper-") as folder:
        database = _built(held, size, sampling, seed, quick, Path(folder), report)
        brute = PoseLookup(database, None)
        own = _vertices(held.angles_deg, held.rotations)
        theirs = np.concatenate(
            [
                _vertices(database.angles_deg[low : low + 1000], database.rotations[low : low + 1000])
                for low in range(0, len(database), 1000)
            ]
        )
        nearest, images, found, degrees = [], [], [], []
        for query, tiny in enumerate(held.tiny):
            away = np.sqrt(((theirs - own[query]) ** 2).sum(axis=1))
            best = brute.neighbours(tiny, 1)
            entry = best.entries[0]
            nearest.append(away.min())
            images.append(best.distances[0])
            found.append(away[entry])
            degrees.append(np.abs(database.angles_deg[entry] - held.angles_deg[query]).mean())
            report("looking up", 0.7 + 0.3 * query / len(held.tiny))
        row = CoverageRow(
            len(database),
            sampling,
            pose_nearest_mm=float(np.mean(nearest)),
            image_nearest_px2=float(np.mean(images)),
            found_mm=float(np.mean(found)),
            found_deg=float(np.mean(degrees)),
        )
        return {"coverage": [row]}


def codes(seed: int, quick: bool, report: Report) -> Mapping[str, Sequence[CodeRow]]:
    held = _held_out(seed, quick)
    with TemporaryDirectory(prefix="glovecal-paper-") as folder:
        database = _built(held, CODED, "low-dispersion", seed, quick, Path(folder), report)
        brute, began = PoseLookup(database, None), time.process_time()
        true = [int(brute.neighbours(tiny, 1).entries[0]) for tiny in held.tiny]
        brute_ms = 1e3 * (time.process_time() - began) / len(true)
        rows = []
        for dimensions in (16, 32):
            began = time.process_time()
            pca = pca_code(database.transforms, dimensions)
            learned_s = time.process_time() - began
            rows.append(_code_row(f"PCA {dimensions}", pca, learned_s, database, held.tiny, true, brute_ms))
        began = time.process_time()
        boosted = boosted_code(
            database.tiny, database.transforms, max(BITS), report=part(report, 0.75, 0.98), seed=seed
        )
        learned_s = time.process_time() - began
        for bits in BITS:
            short, own_s = boosted.shortened(bits), learned_s if bits == max(BITS) else None
            rows.append(_code_row(f"{bits} bits", short, own_s, database, held.tiny, true, brute_ms))
        return {"codes": rows}


def _code_row(
    name: str,
    code: Code,
    learned_s: float | None,
    database: PoseDatabase,
    queries: np.ndarray,
    true: Sequence[int],
    brute_ms: float,
) -> CodeRow:
    ranks = []
    for tiny, best in zip(queries, true, strict=True):
        order = code.nearest(distance_transform(tiny), len(database))
        ranks.append(int(np.flatnonzero(order == best)[0]) + 1)
    lookup, began = PoseLookup(database, code), time.process_time()
    for tiny in queries:
        lookup.neighbours(tiny, reranked=RERANKED)
    look_up_ms = 1e3 * (time.process_time() - began) / len(queries)
    return CodeRow(
        name,
        len(database),
        len(queries),
        rank_mean=float(np.mean(ranks)),
        rank_sd=float(np.std(ranks)),
        rank_median=float(np.median(ranks)),
        within=float(np.mean(np.array(ranks) <= RERANKED)),
        learned_s=learned_s,
        look_up_ms=look_up_ms,
        brute_ms=brute_ms,
    )


def _held_out(seed: int, quick: bool) -> _HeldOut:
    poses, rng = generated_poses(PAPER_COUNT, seed=seed, free=0.0), np.random.default_rng([seed, 8])
    order = rng.permutation(len(poses))
    count = QUICK_HELD_OUT if quick else HELD_OUT
    angles, turns = poses[order[:count]], orientations(count, DatabaseSettings().cone_deg, rng)
    skin = hand_skin()
    tiny = rendered_views(skin, glove_pattern(skin), angles, turns)["tiny"]
    return _HeldOut(angles, turns, tiny, poses[order[count:]])


def _built(
    held: _HeldOut, size: int, sampling: str, seed: int, quick: bool, folder: Path, report: Report
) -> PoseDatabase:
    size = max(50, size // QUICK_DIVISOR) if quick else size
    skin, settings = hand_skin(), DatabaseSettings(size, sampling=sampling, seed=seed + 1)
    said = part(report, 0.0, 0.7)
    return pose_database(skin, glove_pattern(skin), held.rest_deg, folder, settings, workers=1, report=said)


def _vertices(angles_deg: np.ndarray, rotations: np.ndarray) -> np.ndarray:
    """(N, V 3) float32 about the palm's centre, scaled so that distances are root mean squares."""
    skin = hand_skin()
    found = configured(skin, np.asarray(angles_deg), _EVERY) - palm_centre(skin)
    turned = np.einsum("nab,nvb->nva", np.asarray(rotations, dtype=float), found)
    return (turned.reshape(len(found), -1) / np.sqrt(found.shape[1])).astype(np.float32)
