"""Set-aside forms of cross coupling."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Form, Stage, form
from glovecal_models.simulation.scene import Scene

FINGERS = ("T", "I", "M", "R", "P")


def _beside(sensor: str) -> tuple[str, str]:
    """The same joint of the two neighbouring fingers; other places feel the index and ring knuckles."""
    finger, _, joint = sensor.partition("_")
    if finger not in FINGERS[1:] or joint not in ("MCP", "PIP", "DIP"):
        return "I_MCP", "R_MCP"
    near = {"I": ("M", "R"), "M": ("I", "R"), "R": ("M", "P"), "P": ("R", "M")}[finger]
    return f"{near[0]}_{joint}", f"{near[1]}_{joint}"


def _same_finger(sensor: str) -> list[str]:
    """The other joints of the sensor's finger; other places feel the wrist and the middle knuckle."""
    finger, _, joint = sensor.partition("_")
    if finger == "T":
        return [name for name in ("T_TMC", "T_MCP", "T_IP") if name != sensor]
    if finger in FINGERS:
        return [f"{finger}_{other}" for other in ("MCP", "PIP", "DIP") if other != joint]
    return ["W_FLEX", "M_MCP"]


@form(
    Stage.MECHANICAL,
    "The cloth over the knuckles can pull but not push: a neighbouring finger bent further than the "
    "own one tightens it over both (glove kinematics in Sturman and Zeltzer 1994).",
    set_aside=True,
)
def shared_cloth_tension(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Only where the neighbour is ahead of the own finger."""
    weight = draws.each("weight", 0.2, 0.8)
    pulls = np.zeros_like(signal)
    for column, sensor in enumerate(scene.sensors):
        own = (scene.own[:, :, column] - scene.low[column]) / scene.span[column]
        one, other = (scene.bent(name) for name in _beside(sensor))
        ahead = [np.maximum(bent - own, 0.0) for bent in (one, other)]
        pulls[:, :, column] = weight[column] * ahead[0] + (1.0 - weight[column]) * ahead[1]
    return signal + size * 10.0 * pulls


@form(
    Stage.MECHANICAL,
    "A strip in one long sleeve over the finger is drawn along when the finger's other joints use up "
    "the sleeve's slack (bend sensor mountings in Simone and others 2007).",
    set_aside=True,
)
def long_sleeve_pull(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Slack first, then with the square of the other joints' bend."""
    slack = draws.each("slack", 0.05, 0.3)
    pulls = np.zeros_like(signal)
    for column, sensor in enumerate(scene.sensors):
        bent = np.mean([scene.bent(name) for name in _same_finger(sensor)], axis=0)
        pulls[:, :, column] = np.maximum(bent - slack[column], 0.0) ** 2
    return signal + size * draws.signs() * 12.0 * pulls


@form(
    Stage.MECHANICAL,
    "Side walls of two glove fingers rub: the cloth is dragged along by the neighbour until it slides"
    " (elastic sliding after Prandtl 1928).",
    set_aside=True,
)
def side_wall_drag(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """What the neighbour moves against the own finger, with elastic grip that slides at a limit."""
    grip = draws.each("grip", 0.08, 0.25)
    apart = np.empty_like(signal)
    for column, sensor in enumerate(scene.sensors):
        own = (scene.own[:, :, column] - scene.low[column]) / scene.span[column]
        apart[:, :, column] = scene.bent(_beside(sensor)[0]) - own
    dragged = np.zeros_like(signal)
    state = np.zeros_like(signal[:, 0])
    for n in range(1, signal.shape[1]):
        state = np.clip(state + apart[:, n] - apart[:, n - 1], -grip, grip)
        dragged[:, n] = state
    return signal + size * 1.5 * dragged / grip


FORMS: tuple[Form, ...] = (shared_cloth_tension, long_sleeve_pull, side_wall_drag)
