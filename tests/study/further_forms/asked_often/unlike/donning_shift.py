"""Donning shift: a fingertip that reaches the glove's end, ribs that lie elsewhere, and slack that arches."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


def _per_wearing(scene: Scene, draws: Draws, name: str, low: float, high: float) -> np.ndarray:
    """One number for each sensor and wearing, shape (T, 1, S)."""
    drawn = [
        draws.stream(name, start.wearing).uniform(low, high, len(scene.sensors)) for start in scene.starts
    ]
    return np.stack(drawn)[:, None]


@form(
    Stage.WEARING,
    "From another bend in each wearing the fingertip reaches the glove's end and stretches it (ours).",
    only_by_name=True,
)
def fingertip_reaches_end(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Nothing up to that bend, then in proportion."""
    reached = _per_wearing(scene, draws, "reached", 0.35, 0.85)
    pull = _per_wearing(scene, draws, "pull", 0.4, 1.2)
    share = (signal - scene.low) / scene.span
    return signal + size * 20 * pull * np.maximum(share - reached, 0.0)


@form(
    Stage.WEARING,
    "A strip with even ribs lies elsewhere along the finger per wearing: another phase of its ripple (ours).",
    only_by_name=True,
)
def ribs_lie_elsewhere(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Two to four ribs pass over the knuckle from straight to bent."""
    phase = _per_wearing(scene, draws, "phase", 0.0, 2 * np.pi)
    share = (signal - scene.low) / scene.span
    return signal + size * 3 * np.sin(2 * np.pi * draws.each("ribs", 1.8, 4.0) * share + phase)


@form(
    Stage.WEARING,
    "Slack left per wearing arches the strip by the root of what bending has not taken up (shallow arch).",
    only_by_name=True,
)
def slack_arches_the_strip(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Steep just before the slack is used up, nothing then; how much an arch lifts depends on its place."""
    slack = _per_wearing(scene, draws, "slack", 0.1, 0.8)
    lift = _per_wearing(scene, draws, "lift", 0.3, 1.2)
    share = (signal - scene.low) / scene.span
    return signal + size * draws.signs() * 8 * lift * np.sqrt(np.maximum(slack - share, 0.0))


FORMS = (fingertip_reaches_end, ribs_lie_elsewhere, slack_arches_the_strip)
