"""Which letter is taken for which, on simulated poses: rates with intervals over signers, table and picture.

A simulated signer makes each letter a little differently from the table (``SHAPE_SD_DEG`` for each joint, the
same every time), and the glove errs by its standard deviation, correlated between joints.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student
from stream.drawing import PALE, Drawing
from stream.simulated_hand import SHARED

from glovecal_models.hand.rotations import HAND_ROTATIONS
from spelling.alphabet import HARD, LETTERS, LETTERS_DEG, SAME_SHAPE
from spelling.nearest_letter import FAR, NO_LETTER, SHAPE_SD_DEG, letter_distances

BENT_DEG = 120.0
"""A finger whose knuckle and middle joint bend by more in sum hides its outer joints from a camera."""
_JOINTS = {name: place for place, name in enumerate(HAND_ROTATIONS)}


@dataclass(frozen=True)
class Confusion:
    glove_sd_deg: float
    hidden_sd_deg: float
    """Of the joints that the letter hides; for a data glove the same."""
    wrist: bool
    """The glove measures the wrist."""
    rates: np.ndarray
    """(signers, 24, 25): of each letter shown, which was read; the last column is no letter."""

    @property
    def mean(self) -> np.ndarray:
        """(24, 25)."""
        return self.rates.mean(axis=0)

    def right(self, letters: str = LETTERS) -> tuple[float, float, float]:
        """Rate read right and its 95 % interval over signers (t)."""
        rows = [LETTERS.index(letter) for letter in letters]
        each = self.rates[:, rows, rows].mean(axis=1)
        half = float(student.ppf(0.975, len(each) - 1)) * each.std(ddof=1) / np.sqrt(len(each))
        mean = float(each.mean())
        return mean, max(mean - half, 0.0), min(mean + half, 1.0)

    def swaps(self, most: int = 6) -> list[tuple[str, str, float]]:
        """The letters most often taken for others: shown, read, rate."""
        off = self.mean[:, :-1] * (1 - np.eye(len(LETTERS)))
        order = np.argsort(-off, axis=None)[:most]
        pairs = [np.unravel_index(place, off.shape) for place in order]
        return [(LETTERS[shown], LETTERS[read], float(off[shown, read])) for shown, read in pairs]


def simulated_confusion(
    glove_sd_deg: float, hidden_sd_deg: float | None = None, *,
    wrist: bool = True, signers: int = 30, shown: int = 20, seed: int = 1,
) -> Confusion:  # fmt: skip
    """Each of ``signers`` shows each letter ``shown`` times to a glove with that standard deviation.

    ``hidden_sd_deg``: of joints that a camera does not see in the letter shown; None: none is hidden.
    """
    hidden_sd_deg = glove_sd_deg if hidden_sd_deg is None else hidden_sd_deg
    deviations = np.where(hidden_joints(), hidden_sd_deg, glove_sd_deg)[None, :, None]
    rng = np.random.default_rng(seed)
    letters, joints = LETTERS_DEG.shape
    own = SHAPE_SD_DEG * rng.normal(size=(signers, letters, 1, joints))
    shape = (signers, letters, shown)
    errors = np.sqrt(1 - SHARED) * rng.normal(size=(*shape, joints))
    errors += np.sqrt(SHARED) * rng.normal(size=(*shape, 1))
    hands = (LETTERS_DEG[None, :, None] + own + deviations * errors).reshape(-1, joints)
    measured = np.arange(joints) < (joints if wrist else joints - 2)
    stated = np.broadcast_to(deviations, errors.shape).reshape(-1, joints)
    distances = letter_distances(hands, stated, measured)
    read = np.where(distances.min(axis=1) <= FAR, distances.argmin(axis=1), NO_LETTER).reshape(shape)
    rates = (read[..., None] == np.arange(letters + 1)).mean(axis=2)
    return Confusion(glove_sd_deg, hidden_sd_deg, wrist, rates)


def hidden_joints() -> np.ndarray:
    """(24, R) bool: joints that a camera does not see in a letter: the outer ones of closed fingers,
    and the thumb where it lies under or between them."""
    bend = {finger: _sum(f"{finger}_MCP", f"{finger}_PIP") for finger in "IMRP"}
    hidden = np.zeros(LETTERS_DEG.shape, bool)
    for finger, sums in bend.items():
        for joint in ("PIP", "DIP"):
            hidden[:, _JOINTS[f"{finger}_{joint}"]] = sums > BENT_DEG
    tucked = (bend["I"] > BENT_DEG) & (LETTERS_DEG[:, _JOINTS["TI_ABD"]] < 20)
    for name in ("T_TMC", "TI_ABD", "T_VIR", "T_MCP", "T_IP"):
        hidden[:, _JOINTS[name]] = tucked
    return hidden


def _sum(*names: str) -> np.ndarray:
    return LETTERS_DEG[:, [_JOINTS[name] for name in names]].sum(axis=1)


def sentences(confusion: Confusion) -> str:
    """What was found, in a few lines."""
    signers = len(confusion.rates)
    wrist = "the wrist measured" if confusion.wrist else "the wrist not measured"
    lines = [f"Simulated, {_errors(confusion)}, {wrist}, {signers} signers:"]
    groups = {"all 24 letters": LETTERS, ", ".join(HARD): HARD}
    groups["the others"] = "".join(letter for letter in LETTERS if letter not in HARD)
    if not confusion.wrist:
        groups["those of a shape of their own"] = "".join(
            letter for letter in LETTERS if letter not in "".join(SAME_SHAPE)
        )
    for name, letters in groups.items():
        rate, low, high = (100 * value for value in confusion.right(letters))
        lines.append(f"  {name}: {rate:.1f} % read right (95 % interval {low:.1f} to {high:.1f})")
    lines.append(f"  no letter: {100 * confusion.mean[:, -1].mean():.1f} %")
    swaps = [f"{shown} as {read} {100 * rate:.0f} %" for shown, read, rate in confusion.swaps() if rate > 0]
    lines.append("  most often: " + (", ".join(swaps) or "none"))
    return "\n".join(lines)


def _errors(confusion: Confusion) -> str:
    hidden = confusion.hidden_sd_deg
    more = f" ({hidden:g} where hidden)" if hidden != confusion.glove_sd_deg else ""
    return f"error sd {confusion.glove_sd_deg:g} degrees{more}"


def table(confusion: Confusion) -> str:
    """Rows: letter shown; columns: letter read, in percent; the last column is no letter."""
    head = "    " + "".join(f"{letter:>4}" for letter in LETTERS) + "   -"
    rows = [
        f"  {letter} " + "".join(f"{100 * rate:4.0f}" if rate >= 0.005 else "   ." for rate in row)
        for letter, row in zip(LETTERS, confusion.mean, strict=True)
    ]
    return "\n".join([head, *rows])


def picture(confusion: Confusion) -> Drawing:
    """The table as squares, darker where more; what is wrong is red."""
    cell, edge, top = 22, 40, 76
    drawing = Drawing(edge + 25 * cell + 20, top + 24 * cell + 20)
    rate, low, high = (100 * value for value in confusion.right())
    wrist = "" if confusion.wrist else ", wrist not measured"
    drawing.text((12, 20), f"Simulated hands, {_errors(confusion)}{wrist}", 14)
    drawing.text(
        (12, 38), f"{rate:.0f} % of letters read right (95 % interval {low:.0f} to {high:.0f} %)", 12
    )
    drawing.text((12, 54), "row: shown, column: read (-: no letter), numbers in percent", 11, "#5a6773")
    for place, letter in enumerate(LETTERS + "-"):
        drawing.text((edge + (place + 0.5) * cell, top - 5), letter, 12, anchor="middle")
    for row, (letter, shares) in enumerate(zip(LETTERS, confusion.mean, strict=True)):
        y = top + row * cell
        drawing.text((edge - 14, y + 16), letter, 12, anchor="middle")
        for column, share in enumerate(shares):
            x = edge + column * cell
            corners = [(x, y), (x + cell, y), (x + cell, y + cell), (x, y + cell)]
            drawing.polygon(corners, _shade(share, row == column), PALE)
            if share >= 0.005:
                colour = "#ffffff" if share > 0.55 else "#1d2733"
                drawing.text((x + cell / 2, y + 15), f"{100 * share:.0f}", 9, colour, "middle")
    return drawing


def _shade(share: float, right: bool) -> str:
    full = np.array([31, 95, 153] if right else [190, 45, 35])
    strength = share if right else min(1.0, 1.5 * share)
    red, green, blue = (255 + (full - 255) * strength).astype(int)
    return f"#{red:02x}{green:02x}{blue:02x}"
