"""Garment slip: the glove moves on the hand while it is worn, and nothing brings it back before it is off.

A strap gives way once, a seam wanders over its knuckle, and every opening of a closed hand works the cloth
on by a notch. Each begins anew when the glove is put on again.

A strap lets go, a wrinkle travels along the finger, and every fist pulls the glove on by another notch.

A seam that ravels, cloth that sags from straight fingers, or a sheath that turns round its finger.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene

SHUT, OPEN = 0.55, 0.4
"""How far the hand closes and opens again to count as opened once."""


@form(
    Stage.WEARING,
    "A strap gives way once in every wearing, within seconds, and all sensors sit otherwise from"
    " then on (ours).",
    only_by_name=True,
)
def strap_gives_way(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A smooth step at one moment of each wearing, of another height for each sensor and wearing."""
    over_s = draws.one("over_s", 1.0, 5.0)
    given = np.empty_like(signal)
    for take, start in enumerate(scene.starts):
        random = draws.stream("strap", start.wearing)
        moment = random.uniform(45.0, 130.0)
        heights = random.uniform(0.5, 1.5, len(scene.sensors))
        step = 0.5 + 0.5 * np.tanh((scene.since_donned_s[take] - moment) / over_s)
        given[take] = step[:, None] * heights
    return signal + size * draws.signs() * 4.0 * given


@form(
    Stage.WEARING,
    "A seam that lifts the strip wanders along the finger: a hump whose place moves since donning (ours).",
    only_by_name=True,
)
def seam_wanders(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The bend at which the seam lies on the knuckle rises ever slower from where it lay at donning."""
    first, way = draws.each("first_place", 0.1, 0.3), draws.each("way", 0.5, 0.7)
    slows_s = draws.one("slows_s", 90.0, 200.0)
    worn = np.maximum(scene.since_donned_s, 0.0)[:, :, None]
    place = first + way * worn / (worn + slows_s)
    share = (signal - scene.low) / scene.span
    lifted = np.exp(-0.5 * np.square((share - place) / draws.each("width", 0.12, 0.22)))
    return signal + size * draws.signs() * 6.0 * lifted


@form(
    Stage.WEARING,
    "Each opening of a closed hand works the cloth on by a notch that closing does not take back"
    " (ratchet; ours).",
    only_by_name=True,
)
def notch_at_each_opening(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """One way only, by steps of unequal height, and as often while nobody records."""
    notches_per_s = draws.one("unrecorded_per_s", 0.05, 0.15)
    worked = np.empty_like(signal)
    for take, start in enumerate(scene.starts):
        # Nobody looked before the first frame; as many openings as are usual have gone by then.
        before = int(notches_per_s * max(start.since_donned_s, 0.0))
        count = before + _openings(scene.closing[take] * (scene.time_s >= 0))
        random = draws.stream("notches", start.wearing)
        heights = np.cumsum(random.exponential(1.0, (count[-1] + 1, len(scene.sensors))), axis=0)
        worked[take] = heights[count]
    return signal + size * draws.signs() * worked


def _openings(closing: np.ndarray) -> np.ndarray:
    """How often the hand has opened so far after it was closed, shape (N,)."""
    told = np.where(closing > SHUT, 1, np.where(closing < OPEN, 0, -1))
    last = np.maximum.accumulate(np.where(told >= 0, np.arange(len(told)), 0))
    shut = told[last] == 1
    return np.cumsum(np.diff(shut.astype(int), prepend=0) < 0)


@form(
    Stage.WEARING,
    "Once in each wearing a strap lets go, and the glove sits elsewhere from then on (ours).",
    only_by_name=True,
)
def strap_lets_go(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """One slip per wearing, during one of its takes, of a size and direction of its own per sensor."""
    slipped = np.empty((len(scene.starts), len(scene.time_s), len(scene.sensors)))
    for row, start in enumerate(scene.starts):
        random = draws.stream("slip", start.wearing)
        takes = [other for other in scene.starts if other.wearing == start.wearing]
        during = takes[int(random.random() * len(takes))]
        moment_s = during.since_donned_s + random.uniform(0.15, 0.85) * during.take_s
        far = random.choice([-1.0, 1.0], len(scene.sensors)) * random.uniform(0.6, 1.4, len(scene.sensors))
        after = np.clip((scene.since_donned_s[row] - moment_s) / random.uniform(0.2, 1.0), -30, 30)
        slipped[row] = far / (1 + np.exp(-after[:, None]))
    return signal + size * 2 * slipped


@form(
    Stage.WEARING,
    "A wrinkle travels along the finger from donning on, and lifts the sensor at ever larger bends (ours).",
    only_by_name=True,
)
def wrinkle_travels(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A hump over the bend whose place moves on with the time since donning, ever more slowly."""
    since = np.maximum(scene.since_donned_s, 0)[:, :, None]
    moved = draws.each("way", 0.4, 0.7) * -np.expm1(-since / draws.each("slows_s", 60.0, 200.0))
    place = draws.each("first", 0.1, 0.25) + moved
    bend = (signal - scene.low) / scene.span
    hump = np.exp(-(((bend - place) / draws.each("width", 0.12, 0.2)) ** 2))
    return signal + size * draws.signs() * 3 * hump


@form(
    Stage.WEARING,
    "Every fist pulls the glove on by a notch that is not given back, the first ones most (ratchet; ours).",
    only_by_name=True,
)
def notch_by_fist(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A power of the number of fists made since donning."""
    made = _fists(scene, draws.one("closed", 0.52, 0.6), draws.one("opened", 0.4, 0.46))
    return signal + size * draws.signs() * made[:, :, None] ** draws.each("power", 0.5, 0.9)


def _fists(scene: Scene, closed: float, opened: float) -> np.ndarray:
    """How often the hand has closed since donning, shape (T, N); a fist counts once until reopened."""
    shut = np.zeros(len(scene.starts), dtype=bool)
    made = np.zeros_like(scene.closing)
    for frame in range(1, made.shape[1]):
        now = scene.closing[:, frame]
        begins = ~shut & (now > closed)
        shut = (shut | begins) & (now > opened)
        made[:, frame] = made[:, frame - 1] + begins
    last = made[:, scene.recorded.stop - 1].copy()
    for row, start in enumerate(scene.starts):
        for earlier, other in enumerate(scene.starts):
            if other.wearing == start.wearing and other.session_s < start.session_s:
                made[row] += last[earlier]
    return made


@form(
    Stage.WEARING,
    "A seam ravels stitch by stitch, quicker and quicker, as each one lost loads the next more (ours).",
    only_by_name=True,
)
def seam_ravels(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """All sensors move on by a step with each stitch, and stitches follow each other ever sooner."""
    quickens = _per_wearing(scene, draws, "quickens_s", 150.0, 350.0)[:, None]
    stitches = draws.one("stitches", 4.0, 9.0)
    own = draws.each("own", 0.6, 1.4) * draws.signs()
    gone = np.expm1(_worn(scene) / quickens) / np.expm1(600.0 / quickens)
    return signal + size * 3 * own * (np.floor(stitches * gone + 0.5) / stitches)[:, :, None]


@form(
    Stage.WEARING,
    "Cloth grown slack sags from straight fingers, with the root of the time worn (diffusive give; ours).",
    only_by_name=True,
)
def sags_when_straight(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Below a certain bend each sensor falls off, by more and more since donning."""
    below = draws.each("below_bend", 0.35, 0.6)
    pace = _per_wearing(scene, draws, "pace", 0.6, 1.4)[:, None]
    slack = pace * np.sqrt(_worn(scene) / 600.0)
    bend = (signal - scene.low) / scene.span
    return signal + size * 8 * draws.signs() * slack[:, :, None] * np.maximum(below - bend, 0.0)


@form(
    Stage.WEARING,
    "A finger's sheath turns slowly round it, so that the strip sees the bend by the cosine"
    " (geometry; ours).",
    only_by_name=True,
)
def sheath_turns(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each sheath turns from where it was put on, one way or the other, and swings a little on its way."""
    swing_s, own = draws.one("swing_s", 90.0, 200.0), draws.each("own", 0.5, 1.0)
    rate = _per_wearing(scene, draws, "turn", 0.7, 1.5)[:, None]
    worn = _worn(scene)
    turned = rate * (worn / 600.0 + 0.25 * np.sin(2 * np.pi * worn / swing_s))
    seen = np.cos(np.clip(turned[:, :, None] * own, -1.5, 1.5)) - 1
    return signal + size * 8 * (signal - scene.low) / scene.span * seen


def _worn(scene: Scene) -> np.ndarray:
    """Seconds since donning, between putting on and half an hour."""
    return np.clip(scene.since_donned_s, 0.0, 1800.0)


def _per_wearing(scene: Scene, draws: Draws, name: str, low: float, high: float) -> np.ndarray:
    """One number for every take, the same within a wearing."""
    return np.array([draws.stream(name, start.wearing).uniform(low, high) for start in scene.starts])


FORMS = (
    strap_gives_way,
    seam_wanders,
    notch_at_each_opening,
    strap_lets_go,
    wrinkle_travels,
    notch_by_fist,
    seam_ravels,
    sags_when_straight,
    sheath_turns,
)
