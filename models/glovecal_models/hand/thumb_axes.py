"""About which axes the thumb's two sensors turn its metacarpal: a rotation of that bone's local frame.

Krnoul et al. 2016, section 3.3.2: bones of character models turn about their own direction, which does not
suit the thumb. A post-rotation of the bone's frame makes the roll sensor turn about x alone, and the
abduction sensor about y alone. The paper's angles, (-39, -13, 27) degrees for the right hand, belong to its
tool's frame, and it does not tell the order of the three turns: they are a setting here (``PAPER_DEG`` and an
order), and no default. Ours follows from what the sensors do: the frame whose x and y are the two axes of the
skeleton. The left hand is the mirror image, axes and all.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean

PAPER_DEG = (-39.0, -13.0, 27.0)
ORDERS = ("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")
"""Each turn about an axis of the frame that the turns before have left."""
Axis = tuple[float, float, float]


@dataclass(frozen=True)
class ThumbAxes:
    """In the frame of the closed thumb's metacarpal: x along the bone, z out of its nail's side."""

    roll: Axis
    """About which the roll sensor's rotation turns (T_TMC), a unit vector."""
    abduction: Axis
    """Of the thumb-index abduction (TI_ABD), across ``roll``."""

    @classmethod
    def rotated(cls, angles_deg: Sequence[float], order: str) -> ThumbAxes:
        """x and y of a frame turned by ``angles_deg`` about x, y and z, one after another in ``order``.

        Raises BadInput for another order, and for angles that are not three finite numbers.
        """
        from scipy.spatial.transform import Rotation  # slow to load, and seldom needed

        if order not in ORDERS:
            raise BadInput(f"order of the thumb's turns is {order!r}; {did_you_mean(order, ORDERS)}")
        if len(angles_deg) != 3 or not np.isfinite(angles_deg).all():
            raise BadInput(
                f"the thumb's post-rotation is {tuple(angles_deg)}, expected three angles, degrees"
            )
        by_axis = dict(zip("XYZ", angles_deg, strict=True))
        turned = Rotation.from_euler(order, [by_axis[axis] for axis in order], degrees=True).as_matrix()
        x, y, _ = turned.T.tolist()
        return cls(tuple(x), tuple(y))

    def angles_deg(self, order: str) -> Axis:
        """The post-rotation about x, y and z that ``rotated`` makes these axes of."""
        from scipy.spatial.transform import Rotation

        if order not in ORDERS:
            raise BadInput(f"order of the thumb's turns is {order!r}; {did_you_mean(order, ORDERS)}")
        frame = np.column_stack([self.roll, self.abduction, np.cross(self.roll, self.abduction)])
        with warnings.catch_warnings():  # where the middle turn is 90 degrees, one of many answers is given
            warnings.simplefilter("ignore", UserWarning)
            turned = Rotation.from_matrix(frame).as_euler(order, degrees=True)
        found = dict(zip(order, turned.tolist(), strict=True))
        return found["X"], found["Y"], found["Z"]
