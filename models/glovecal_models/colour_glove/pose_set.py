"""Hand shapes to fill a database with: many natural ones, and of these few that cover them evenly.

The paper recorded 18,000 finger configurations of sign language, gestures and jiggling with a CyberGlove
(section 4.2). Here they are generated, or come from recorded takes. A configuration is (20,) angles in
degrees in the order of ``FINGER_ROTATIONS``. Two configurations are as far apart as the root mean square
distance of their skins' vertices, with the palm held still.
"""

from __future__ import annotations

import numpy as np

from glovecal_models.colour_glove.hand_state import FINGER_ROTATIONS, RANGE_DEG
from glovecal_models.colour_glove.skin import HandSkin, configured
from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import FINGERS

PAPER_COUNT = 18_000
POSE_NOISE_DEG = 5.0
FREE = 0.35
"""Share of configurations whose joints go anywhere in their ranges: hands do more than an alphabet has."""
_DIP_OF_PIP, _DIP_OWN_DEG = 0.6, 8.0
"""How the last joint goes with the middle one, and the standard deviation of what is its own."""
_SYNERGY_DEG = 6.0
_BENDS = {
    "s": (0.0, 0.0, 0.0),  # straight
    "c": (35.0, 40.0, 25.0),  # curved
    "h": (5.0, 85.0, 55.0),  # hooked
    "k": (75.0, 10.0, 5.0),  # bent at the knuckle
    "f": (80.0, 95.0, 60.0),  # in the fist
    "o": (50.0, 60.0, 35.0),  # towards the thumb
}
_THUMBS = {
    "side": (5.0, 10.0, 5.0, 5.0, 5.0),
    "out": (10.0, 60.0, 15.0, 5.0, 5.0),
    "across": (45.0, 25.0, 40.0, 35.0, 40.0),
    "opposed": (45.0, 40.0, 45.0, 20.0, 30.0),
    "tucked": (55.0, 15.0, 45.0, 45.0, 60.0),
}
"""T_TMC, TI_ABD, T_VIR, T_MCP, T_IP."""
_SHAPES = {
    "A": ("side", "ffff", 0), "B": ("tucked", "ssss", 0), "C": ("opposed", "cccc", 3),
    "D": ("opposed", "sooo", 0), "E": ("across", "hhhh", 0), "F": ("opposed", "osss", 12),
    "G": ("side", "kfff", 0), "H": ("tucked", "kkff", 0), "I": ("across", "fffs", 0),
    "J": ("side", "fffs", 5), "K": ("opposed", "skff", 8), "L": ("out", "sfff", 0),
    "M": ("tucked", "kkkf", 0), "N": ("tucked", "kkff", 4), "O": ("opposed", "oooo", 0),
    "P": ("opposed", "ckff", 8), "Q": ("side", "offf", 0), "R": ("across", "ssff", 0),
    "S": ("across", "ffff", 0), "T": ("side", "offf", 6), "U": ("across", "ssff", 2),
    "V": ("across", "ssff", 22), "W": ("tucked", "sssf", 16), "X": ("across", "hfff", 0),
    "Y": ("out", "fffs", 14), "5": ("out", "ssss", 18),
}  # fmt: skip
"""Like the American hand alphabet: thumb, bends of index to pinky, spread. Coarse, and ours."""


def hand_shapes() -> dict[str, np.ndarray]:
    """The 26 shapes by name, (20,) each."""
    return {name: _angles(*shape) for name, shape in _SHAPES.items()}


def generated_poses(count: int = PAPER_COUNT, *, seed: int = 1, free: float = FREE) -> np.ndarray:
    """Configurations (N, 20): shapes mixed finger by finger, partly on the way between two, with correlated
    and independent noise, within a hand's range; a share ``free`` of them has nothing of the shapes."""
    rng = np.random.default_rng(seed)
    shapes = np.array(list(hand_shapes().values()))
    first, second, way = (rng.integers(0, len(shapes), count) for _ in range(3))
    of_second = rng.random((count, len(FINGERS))) < 0.35
    mixed = np.where(of_second[:, _FINGER_OF], shapes[second], shapes[first])
    towards = np.where(rng.random(count) < 0.5, rng.random(count), 0.0)[:, None]
    mixed = mixed + towards * (shapes[way] - mixed)
    mixed += _SYNERGY_DEG * rng.normal(size=(count, len(_SYNERGIES))) @ _SYNERGIES
    poses = np.clip(mixed + rng.normal(0.0, POSE_NOISE_DEG, mixed.shape), *RANGE_DEG.T)
    if free:
        is_free = rng.random(count) < free
        poses[is_free] = _free_poses(int(is_free.sum()), rng)
    return poses


def _free_poses(count: int, rng: np.random.Generator) -> np.ndarray:
    """Each finger and joint on its own but for the last joints; bent knuckles leave little room to spread."""
    low, high = RANGE_DEG.T
    poses = rng.uniform(low, high, (count, len(FINGER_ROTATIONS)))
    column = {name: place for place, name in enumerate(FINGER_ROTATIONS)}
    for finger in "IMRP":
        last = column[f"{finger}_DIP"]
        own = _DIP_OF_PIP * poses[:, column[f"{finger}_PIP"]] + rng.normal(0.0, _DIP_OWN_DEG, count)
        poses[:, last] = np.clip(own, low[last], high[last])
    for spread, finger in (("IM_ABD", "I"), ("MR_ABD", "R"), ("RP_ABD", "P")):
        bent = np.clip(poses[:, column[f"{finger}_MCP"]] / 90.0, 0.0, 1.0)
        poses[:, column[spread]] *= 1.0 - 0.7 * bent
    return np.clip(poses, low, high)


def shape_features(
    skin: HandSkin, poses_deg: np.ndarray, *, dimensions: int = 40, every: int = 8
) -> np.ndarray:
    """(N, dimensions) in which the distance of two rows is nearly their skins' vertex RMS distance, mm.

    Principal components of every ``every``-th vertex; learned on at most 2,000 poses.
    """
    poses = np.asarray(poses_deg, dtype=float)
    basis_of = poses[:: max(1, len(poses) // 2000)]
    sample = _vertices(skin, basis_of, every)
    mean = sample.mean(axis=0)
    _, _, axes = np.linalg.svd(sample - mean, full_matrices=False)
    axes = axes[:dimensions]
    chunks = [poses[low : low + 1000] for low in range(0, len(poses), 1000)]
    return np.concatenate([(_vertices(skin, chunk, every) - mean) @ axes.T for chunk in chunks])


def low_dispersion(features: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Indices (count,) such that each next row is farthest from all before, and the dispersion after each.

    The greedy sampling of section 4.2. It begins with the row nearest to the mean. Raises BadInput when there
    are fewer rows.
    """
    if not 1 <= count <= len(features):
        raise BadInput(f"{count} samples of {len(features)} poses; expected 1 to {len(features)}")
    chosen = [int(np.argmin(((features - features.mean(axis=0)) ** 2).sum(axis=1)))]
    nearest = ((features - features[chosen[0]]) ** 2).sum(axis=1)
    dispersion = [nearest.max()]
    while len(chosen) < count:
        chosen.append(int(np.argmax(nearest)))
        nearest = np.minimum(nearest, ((features - features[chosen[-1]]) ** 2).sum(axis=1))
        dispersion.append(nearest.max())
    return np.array(chosen), np.sqrt(dispersion)


def _vertices(skin: HandSkin, poses: np.ndarray, every: int) -> np.ndarray:
    """(N, V' 3), scaled so that distances are root mean squares."""
    found = configured(skin, poses, every)
    return found.reshape(len(poses), -1) / np.sqrt(found.shape[1])


_OF_SPREAD = {"TI": "T", "IM": "I", "MR": "R", "RP": "P"}
_FINGER_OF = np.array([list(FINGERS).index(_OF_SPREAD.get(name[:2], name[0])) for name in FINGER_ROTATIONS])


def _angles(thumb: str, bends: str, spread: float) -> np.ndarray:
    given = dict(zip(("T_TMC", "TI_ABD", "T_VIR", "T_MCP", "T_IP"), _THUMBS[thumb], strict=True))
    for finger, bend in zip("IMRP", bends, strict=True):
        given |= {
            f"{finger}_{joint}": angle
            for joint, angle in zip(("MCP", "PIP", "DIP"), _BENDS[bend], strict=True)
        }
    given |= dict.fromkeys(("IM_ABD", "MR_ABD", "RP_ABD"), spread)
    return np.array([given[name] for name in FINGER_ROTATIONS])


def _synergies() -> np.ndarray:
    """Fingers bend together, each finger's joints do, fingers spread together, the thumb opposes: (S, 20)."""

    def moves(*names: str) -> list[float]:
        return [1.0 if name in names else 0.0 for name in FINGER_ROTATIONS]

    joints = ("MCP", "PIP", "DIP")
    rows = [moves(*(f"{finger}_{joint}" for finger in "IMRP")) for joint in joints]
    rows += [moves(*(f"{finger}_{joint}" for joint in joints)) for finger in "IMRP"]
    rows += [moves(*(f"{finger}_{joint}" for finger in "IMRP" for joint in joints))]
    rows += [
        moves("IM_ABD", "MR_ABD", "RP_ABD"),
        moves("T_TMC", "T_VIR"),
        moves("TI_ABD"),
        moves("T_MCP", "T_IP"),
    ]
    return np.array(rows)


_SYNERGIES = _synergies()
