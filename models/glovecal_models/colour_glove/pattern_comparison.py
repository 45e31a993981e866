"""What a pattern leaves ambiguous: how far apart hands are that look alike to the camera.

Many hands are rendered with a pattern. For others, not among them, the one is looked up whose tiny image is
most alike (``image_distance``). How far its skin lies from the true one, in mm, is what the pattern leaves
open; how far the nearest of all lies is what no pattern could better. All patterns get the same hands.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from glovecal_models.colour_glove.crop import distances
from glovecal_models.colour_glove.database import orientations, palm_centre, rendered_views, view_state
from glovecal_models.colour_glove.pattern import (
    COLOUR_NAMES,
    PATCHES,
    Pattern,
    glove_pattern,
    printed_pattern,
)
from glovecal_models.colour_glove.pose_set import generated_poses
from glovecal_models.colour_glove.skin import HandSkin, hand_skin, posed
from glovecal_models.documents import read_json
from glovecal_models.errors import BadInput
from glovecal_models.progress import Report

COMPARED_ENTRIES, COMPARED_VIEWS = 2000, 200
LARGEST_PATTERN = 100_000
_EVERY = 20
"""Of the vertices, for distances between hands."""
_CONE_DEG = 75.0


@dataclass(frozen=True)
class PatternAmbiguity:
    """Of one pattern, over ``queries`` rendered hands looked up among ``entries``."""

    colours: tuple[int, ...]
    """Of patch 1 and so on."""
    same_colour_mm: float
    """Shortest way over the skin between the seeds of two patches of one colour; infinite without such."""
    mean_mm: float
    """RMS distance of the skins of the true hand and of the one that looks most alike, mean over hands."""
    mean_sd_mm: float
    """Standard deviation of that mean."""
    p90_mm: float
    nearest_mm: float
    """The same to the hand that is nearest in truth, mean: the limit for any pattern."""
    entries: int
    queries: int


def ambiguities(
    patterns: Mapping[str, Pattern],
    skin: HandSkin | None = None,
    *,
    entries: int = COMPARED_ENTRIES,
    queries: int = COMPARED_VIEWS,
    seed: int = 1,
    report: Report | None = None,
) -> dict[str, PatternAmbiguity]:
    """Of each pattern. Time: about 3 ms a hand and pattern. Raises BadInput for counts below 1."""
    if entries < 1 or queries < 2:
        raise BadInput(f"{queries} hands looked up among {entries}; expected at least 2 among 1")
    skin = hand_skin() if skin is None else skin
    rng = np.random.default_rng(seed)
    count = entries + queries
    angles = rng.permutation(generated_poses(max(count, 2000), seed=seed, free=0.0))[:count]
    turns = orientations(count, _CONE_DEG, rng)
    centre = palm_centre(skin)
    hands = np.array(
        [posed(skin, view_state(*hand, centre))[::_EVERY].ravel() for hand in zip(angles, turns, strict=True)]
    )
    hands -= hands.mean(axis=0)
    held, known = hands[:queries], hands[queries:]
    square = (held**2).sum(1)[:, None] + (known**2).sum(1)[None] - 2 * held @ known.T
    apart = np.sqrt(np.maximum(square, 0.0) / (hands.shape[1] / 3))
    found, everyone = {}, np.arange(entries)
    for number, (name, pattern) in enumerate(patterns.items()):
        if report:
            report(name, number / len(patterns))
        views = rendered_views(skin, pattern, angles, turns, max(len(COLOUR_NAMES), pattern.colours))
        tiny, transforms = views["tiny"], views["transforms"]
        alike = [
            int(np.argmin(distances(tiny[q], transforms[q], tiny[queries:], transforms[queries:], everyone)))
            for q in range(queries)
        ]
        errors = apart[np.arange(queries), alike]
        found[name] = PatternAmbiguity(
            tuple(int(colour) for colour in pattern.colour_of_patch),
            pattern.same_colour_mm,
            float(errors.mean()),
            float(errors.std(ddof=1) / np.sqrt(queries)),
            float(np.percentile(errors, 90)),
            float(apart.min(axis=1).mean()),
            entries,
            queries,
        )
    return found


def common_patterns() -> dict[str, Pattern]:
    """What others are compared with: the printed one, three draws as in the paper, and the limit that a
    colour for each patch would reach (nobody can print twenty that a camera tells apart)."""
    skin = hand_skin()
    drawn = {f"random draw {seed}": glove_pattern(skin, draws=1, seed=seed) for seed in (1, 2, 3)}
    return {"printed": printed_pattern()} | drawn | {"20 colours": glove_pattern(skin, colours=PATCHES)}


def read_pattern(file: Path) -> Pattern:
    """The printed patches in colours of one's own: JSON, ``{"colours": [4, 3, ...]}``, 20 numbers of 1 to 10
    for patch 1 and so on. Raises BadInput that names the file."""
    if file.stat().st_size > LARGEST_PATTERN:
        raise BadInput(f"{file}: {file.stat().st_size} bytes; a pattern has at most {LARGEST_PATTERN}")
    document = read_json(file.read_bytes(), str(file))
    example = '{"colours": [4, 3, ...]}, 20 numbers of 1 to 10'
    if not isinstance(document, dict) or set(document) != {"colours"}:
        raise BadInput(f"{file}: expected {example}, nothing else")
    colours, printed = document["colours"], printed_pattern()
    if not isinstance(colours, list) or len(colours) != len(printed.colour_of_patch):
        raise BadInput(f"{file}: expected {example}")
    wrong = [c for c in colours if type(c) is not int or not 1 <= c <= len(COLOUR_NAMES)]
    if wrong:
        raise BadInput(f"{file}: colour {wrong[0]!r}; expected {example}")
    return Pattern(printed.patch, np.array(colours, dtype=np.uint8), printed.seed_distance_mm)
