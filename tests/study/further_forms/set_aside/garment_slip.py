"""Set-aside forms of garment slip."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Form, Stage, form
from glovecal_models.simulation.scene import Scene


@form(
    Stage.WEARING,
    "Each closing of the hand works the glove a little further towards the fingertips, less and less "
    "until it is held by the webs (ratcheting under cyclic load, Johnson 1985).",
    set_aside=True,
)
def ratchets_with_each_closing(
    signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws
) -> np.ndarray:
    """A slip with the way the hand has closed since the glove was put on."""
    path = draws.each("path", 25.0, 80.0)
    closing = np.maximum(np.diff(scene.closing, axis=1, prepend=scene.closing[:, :1]), 0.0)
    usual = float(closing.mean())
    worn = scene.since_donned_s > 0.0
    before = usual * scene.rate_hz * np.maximum(scene.since_donned_s[:, :1], 0.0)
    closed = before + np.cumsum(np.where(worn, closing, 0.0), axis=1)
    slipped = -np.expm1(-closed[:, :, None] / path)
    return signal + size * draws.signs() * 6.0 * slipped


@form(
    Stage.WEARING,
    "The cloth sticks to the skin and lets go at single moments, each time by another length in the "
    "same direction (stick-slip, Bowden and Leben 1939).",
    set_aside=True,
)
def lets_go_at_moments(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Steps at random times of each wearing; each step reaches the sensors unequally."""
    apart = draws.one("apart_s", 50.0, 120.0)
    side = draws.signs()
    slipped = np.zeros_like(signal)
    for take, start in enumerate(scene.starts):
        random = draws.stream("moments", start.wearing)
        moments = np.cumsum(random.exponential(apart, 40))
        steps = random.gamma(1.5, 0.7, (40, side.size))
        total = np.concatenate([np.zeros((1, side.size)), np.cumsum(steps, axis=0)])
        slipped[take] = total[np.searchsorted(moments, scene.since_donned_s[take])]
    return signal + size * side * slipped / 2.0


@form(
    Stage.WEARING,
    "After some minutes sweat makes the skin slippery first and the glove gives way at the fingers "
    "within a minute (skin friction against moisture, Gerhardt and others 2008).",
    set_aside=True,
)
def sweat_lets_it_slide(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Held at first; then the bent finger pulls its sleeve back for good and less bend is seen."""
    lasts = draws.one("lasts_s", 10.0, 40.0)
    bent = np.clip((signal - scene.low) / scene.span, 0.0, 1.2)
    begins = np.array([draws.stream("begins", start.wearing).uniform(60.0, 300.0) for start in scene.starts])
    slid = 1.0 / (1.0 + np.exp(-np.clip((scene.since_donned_s - begins[:, None]) / lasts, -30.0, 30.0)))
    return signal - size * 6.0 * slid[:, :, None] * (draws.each("shift", 0.1, 0.6) + bent)


FORMS: tuple[Form, ...] = (ratchets_with_each_closing, lets_go_at_moments, sweat_lets_it_slide)
