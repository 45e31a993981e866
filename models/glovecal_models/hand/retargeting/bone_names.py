"""A hand's bones as people name them, to say which bone of another skeleton is which."""

from __future__ import annotations

from collections.abc import Mapping

from glovecal_models.errors import BadInput
from glovecal_models.hand.bones import HAND, PHALANGES
from glovecal_models.hand.rotations import HANDS, Handedness
from glovecal_models.names import did_you_mean

TIP = "tip"
BONES_AND_TIPS: tuple[str, ...] = (
    HAND, *(f"{finger}_{part}" for finger, parts in PHALANGES.items() for part in (*parts, TIP))
)  # fmt: skip


def bones_of(given: Mapping[str, str], hand: Handedness) -> dict[str, str]:
    """Another skeleton's bones by those of one hand; ``given``: by bone, or by ``left.index_proximal`` for
    one hand alone. Raises BadInput for what is no bone of a hand."""
    own: dict[str, str] = {}
    for key, other in given.items():
        side, _, bone = key.rpartition(".")
        if bone not in BONES_AND_TIPS or side not in ("", *HANDS):
            raise BadInput(f"a hand has no bone {key!r}; {did_you_mean(bone, BONES_AND_TIPS)}")
        if side in ("", hand):
            own[bone] = other
    return own
