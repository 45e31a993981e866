"""Contact pressure: what the hand presses against changes the reading, as the recorded force tells.

A dome of cloth snaps in under some newtons, a strip that spans a gap between two bones is pressed into it
in mid-bend only, and a soft layer is squeezed aside the faster the harder it is pressed.

Padding first bulges and then goes flat, glue yields above a force, and a strip bends between two supports.

Padding may give slowly, keep its deepest dent while it is held, or the grip may clamp the strip.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d

from glovecal_models.simulation.causes.contact_pressure import contact_column
from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene
from glovecal_models.simulation.signals import lasting_noise


@form(
    Stage.MECHANICAL,
    "A dome resists a light touch and gives way under a firm one: a rise, then a fall (snap dome;"
    " shape ours).",
    only_by_name=True,
    column=contact_column,
)
def dome_gives_way(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Most at a few newtons, ever less beyond."""
    share = _newtons(scene, draws) / draws.each("peak_n", 2.5, 5.0)
    return signal + size * draws.signs() * 8.0 * share * np.exp(1 - share)


@form(
    Stage.MECHANICAL,
    "The strip spans a gap between two bones in mid-bend and is pressed into it, not where it lies"
    " on bone (ours).",
    only_by_name=True,
    column=contact_column,
)
def pressed_into_gap(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Newtons times a bell over the own bend, next to nothing at both ends of the range."""
    middle = draws.each("middle", 0.4, 0.6)
    share = (scene.own - scene.low) / scene.span
    spans = np.exp(-0.5 * np.square((share - middle) / draws.each("width", 0.15, 0.22)))
    return signal + size * draws.signs() * _newtons(scene, draws) * spans


@form(
    Stage.MECHANICAL,
    "A soft layer is squeezed aside and leaves the strip to bear the rest: square of the force"
    " (thin pad; ours).",
    only_by_name=True,
    column=contact_column,
)
def squeezed_aside(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Hardly anything at a light touch, four times as much at twice the force."""
    stiff = draws.each("stiff_n", 7.0, 11.0)
    return signal + size * draws.signs() * 5.0 * np.square(_newtons(scene, draws) / stiff)


def _newtons(scene: Scene, draws: Draws) -> np.ndarray:
    """The contact force, shape (T, N, 1)."""
    return contact_column(scene, draws)[1][:, :, None]


@form(
    Stage.MECHANICAL,
    "Light pressure makes the padding bulge under the sensor, stronger pressure flattens it again (ours).",
    only_by_name=True,
    column=contact_column,
)
def bulges_then_flattens(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """A rise and fall over the force that ends below where it began."""
    ratio = _force(scene, draws) / draws.each("peak_n", 3.0, 6.0)
    return signal + size * draws.signs() * 3 * (1 - draws.each("flat", 0.3, 0.6) * ratio) * ratio * np.exp(
        1 - ratio
    )


@form(
    Stage.MECHANICAL,
    "Stitching holds the strip until a force is exceeded, and gives way in proportion above it (ours).",
    only_by_name=True,
    column=contact_column,
)
def gives_way_above(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """In proportion to the force above a threshold, nothing below."""
    over = np.maximum(_force(scene, draws) - draws.each("holds_n", 3.0, 7.0), 0)
    return signal + size * draws.sign() * 0.5 * over


@form(
    Stage.MECHANICAL,
    "A half-bent strip spans a gap and is pressed through, others lie on (three-point bending).",
    only_by_name=True,
    column=contact_column,
)
def pressed_through(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The force times a bow over the bend: nothing at both ends of the range."""
    bend = np.clip((signal - scene.low) / scene.span, 0, 1)
    gap = np.sin(np.pi * bend ** draws.each("power", 0.7, 1.4))
    return signal + size * draws.sign() * 0.4 * _force(scene, draws) * gap**2


def _force(scene: Scene, draws: Draws) -> np.ndarray:
    """The recorded force in newtons, shape (T, N, 1)."""
    return contact_column(scene, draws)[1][:, :, None]


def grip_column(scene: Scene, draws: Draws) -> tuple[str, np.ndarray]:
    """Force of the grip, 0 to 8 N: it needs a closed hand and pauses now and then."""
    grip = np.empty_like(scene.closing)
    for take, start in enumerate(scene.starts):
        random = draws.stream("grip", start.key)
        rough = lasting_noise(random, grip.shape[1], 1, 3.0, scene.rate_hz)
        grip[take] = gaussian_filter1d(rough[:, 0], 0.25 * scene.rate_hz)
    return "contact_n", 8 * np.tanh(np.maximum(0.4 * grip + scene.closing - 0.3, 0.0))


@form(
    Stage.MECHANICAL,
    "Slow foam gives over seconds under the grip and comes back as slowly (viscoelastic padding).",
    only_by_name=True,
    column=grip_column,
)
def slow_foam(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each sensor follows the force of the last few seconds."""
    share = 1 - np.exp(-1 / (draws.each("seconds", 1.5, 5.0) * scene.rate_hz))
    force = grip_column(scene, draws)[1][:, :, None]
    out = np.empty_like(signal)
    state = force[:, 0] * np.ones(signal.shape[2])
    for frame in range(signal.shape[1]):
        state = state + share * (force[:, frame] - state)
        out[:, frame] = state
    return signal + size * draws.signs() * out


@form(
    Stage.MECHANICAL,
    "Padding keeps the dent of the strongest pressure until the grip lets go (set of soft layers; ours).",
    only_by_name=True,
    column=grip_column,
)
def keeps_deepest_dent(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Each sensor shows the highest force since touch began, and is right again once there is none."""
    force = grip_column(scene, draws)[1]
    fills = draws.one("fills_s", 0.05, 0.3)
    fade = np.exp(-1 / (fills * scene.rate_hz))
    dent = np.empty_like(force)
    deepest = force[:, 0]
    for frame in range(force.shape[1]):
        deepest = np.maximum(np.where(force[:, frame] > 0, 1.0, fade) * deepest, force[:, frame])
        dent[:, frame] = deepest
    return signal + size * draws.signs() * draws.each("own", 0.6, 1.4) * dent[:, :, None]


@form(
    Stage.MECHANICAL,
    "A grip clamps the strip on the finger, which then follows only part of further bending"
    " (clamping; ours).",
    only_by_name=True,
    column=grip_column,
)
def grip_clamps_strip(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Bending since touch began is lost in part, the more so the firmer the grip."""
    force = grip_column(scene, draws)[1][:, :, None]
    clamped = 1 - np.exp(-force / draws.each("firm_n", 0.8, 2.5))
    held = np.empty_like(signal)
    bend = signal[:, 0]
    for frame in range(signal.shape[1]):
        bend = np.where(force[:, frame] > 0, bend, signal[:, frame])
        held[:, frame] = bend
    return signal + size * 0.15 * clamped * (held - signal)


FORMS = (
    dome_gives_way,
    pressed_into_gap,
    squeezed_aside,
    bulges_then_flattens,
    gives_way_above,
    pressed_through,
    slow_foam,
    keeps_deepest_dent,
    grip_clamps_strip,
)
