"""Set-aside forms of palm arch."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Form, Stage, form
from glovecal_models.simulation.scene import Scene


def _low_pass(values: np.ndarray, tau_s: np.ndarray | float, rate_hz: float) -> np.ndarray:
    """First-order lag along axis 1."""
    share = 1.0 - np.exp(-1.0 / (rate_hz * np.asarray(tau_s)))
    followed = np.empty_like(values)
    state = values[:, 0].copy()
    for n in range(values.shape[1]):
        state += share * (values[:, n] - state)
        followed[:, n] = state
    return followed


@form(
    Stage.MECHANICAL,
    "Cloth in the hollow of the palm folds suddenly along the thenar crease and unfolds later than it"
    " folded (snap-through of shallow arches, Timoshenko and Gere 1961).",
    set_aside=True,
    touches="palm",
)
def thenar_crease_snaps(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Two states with two thresholds, and a little give in each."""
    arch = scene.bent("PALM_ARCH")[:, :, None]
    reach = np.percentile(arch[:, scene.recorded], [30, 70])
    middle = reach[0] + draws.each("middle", 0.3, 0.7) * (reach[1] - reach[0])
    apart = draws.each("apart", 0.05, 0.2) * (reach[1] - reach[0])
    event = (arch > middle + apart).astype(int) - (arch < middle - apart).astype(int)
    last = np.maximum.accumulate(np.where(event != 0, np.arange(arch.shape[1])[:, None], 0), axis=1)
    folded = np.take_along_axis(event, last, axis=1) > 0
    folded = _low_pass(folded.astype(float), 0.08, scene.rate_hz)
    return signal + size * draws.signs() * (1.5 * folded + 2.0 * arch)


@form(
    Stage.MECHANICAL,
    "Hollowing the palm rolls the metacarpal heads towards each other, so that a strip lies beside "
    "its joint's axis and sees less of the bend (Sancho-Bru and others 2014 on the metacarpal arch).",
    set_aside=True,
    touches="palm",
)
def metacarpal_roll(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A loss in proportion to the bend and to the roll's square, with a small shift of its own."""
    roll = draws.each("roll_deg", 15.0, 35.0)
    turned = np.radians(roll * scene.bent("PALM_ARCH")[:, :, None])
    bent = np.sin(np.radians(np.clip(scene.own, -90.0, 90.0)))
    return signal - size * 60.0 * (1.0 - np.cos(turned)) * (0.3 + bent)


@form(
    Stage.MECHANICAL,
    "A hollowed palm tightens the back of the glove, which then gives way within seconds and is loose"
    " when the palm flattens (stress relaxation of knitted fabrics, Morton and Hearle 2008).",
    set_aside=True,
    touches="palm",
)
def arch_pull_relaxes(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A pull that fades by a share of itself."""
    tau, fades = draws.each("tau_s", 2.0, 9.0), draws.each("fades", 0.5, 0.9)
    arch = scene.bent("PALM_ARCH")[:, :, None] * np.ones_like(signal)
    return signal + size * draws.signs() * 6.0 * (arch - fades * _low_pass(arch, tau, scene.rate_hz))


FORMS: tuple[Form, ...] = (thenar_crease_snaps, metacarpal_roll, arch_pull_relaxes)
