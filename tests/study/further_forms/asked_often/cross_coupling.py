"""Cross-coupling: neighbouring joints also stretch or bend the sensor, at once and always alike."""

from __future__ import annotations

import numpy as np

from glovecal_models.simulation.causes.form import Draws, Stage, form
from glovecal_models.simulation.scene import Scene


def _neighbour_shares(scene: Scene, draws: Draws) -> tuple[np.ndarray, np.ndarray]:
    """Two other sensors' angles for each sensor as shares of their ranges, each of shape (T, N, S)."""
    count = len(scene.sensors)
    random = draws.stream("neighbours")
    picked = []
    for sensor in range(count):
        others = [other for other in range(count) if other != sensor]
        first, second = random.choice(others, 2, replace=len(others) < 2)
        picked.append((int(first), int(second)))
    firsts, seconds = [pair[0] for pair in picked], [pair[1] for pair in picked]
    draws.values["first_neighbour"] = [float(place) for place in firsts]
    draws.values["second_neighbour"] = [float(place) for place in seconds]
    share = (scene.own - scene.low) / scene.span
    return share[:, :, firsts], share[:, :, seconds]


@form(
    Stage.MECHANICAL,
    "Fabric between the fingers hands on a fixed share of two neighbours' bending (linear; ours).",
    only_by_name=True,
    touches="two",
)
def shared_fabric_pull(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The nearer neighbour counts fully, the other one less."""
    near, far = _neighbour_shares(scene, draws)
    return signal + size * draws.signs() * (near + draws.each("far_share", 0.2, 0.6) * far)


@form(
    Stage.MECHANICAL,
    "Slack between fingers: a neighbour pulls only once it is bent enough to tighten the cloth (ours).",
    only_by_name=True,
    touches="two",
)
def pull_after_slack(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """Nothing up to the slack, then in proportion to what goes beyond it, with a rounded corner."""
    near, _ = _neighbour_shares(scene, draws)
    slack, width = draws.each("slack", 0.2, 0.45), 0.04
    pull = width * np.logaddexp(0.0, (near - slack) / width)
    return signal + size * draws.signs() * pull


@form(
    Stage.MECHANICAL,
    "A neighbour's pull reaches the sensor better the more its own joint has tightened the glove (ours).",
    only_by_name=True,
    touches="two",
)
def pull_on_tight_glove(signal: np.ndarray, scene: Scene, size: np.ndarray, draws: Draws) -> np.ndarray:
    """The neighbour's bend times a transfer that grows with the own bend."""
    near, _ = _neighbour_shares(scene, draws)
    own = np.clip((scene.own - scene.low) / scene.span, 0.0, 1.0)
    loose = draws.each("transfer_when_loose", 0.1, 0.3)
    return signal + size * draws.signs() * near * (loose + (1 - loose) * own)


FORMS = (shared_fabric_pull, pull_after_slack, pull_on_tight_glove)
