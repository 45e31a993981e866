"""A take of a guided sampling, and what was asked for in it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from glovecal_models.inverse_kinematics.contact import Rod, Touch
from glovecal_models.layout import Layout
from glovecal_models.sampling.sampled_takes import SampledTake
from glovecal_models.sampling.step import Kind
from glovecal_models.takes.take import Take

FK: tuple[Kind, ...] = ("fk_independent", "fk_cross_couple")


@dataclass(frozen=True)
class TaughtTake:
    take: Take
    kind: Kind
    contacts: Mapping[str, Touch | Rod] = field(default_factory=dict)
    """What tips did, by the name that the take gives its frames."""

    @classmethod
    def of(cls, sampled: SampledTake) -> TaughtTake:
        return cls.from_document(sampled.take, sampled.to_document())

    @classmethod
    def from_document(cls, take: Take, document: Mapping[str, Any]) -> TaughtTake:
        """``document``: as ``SampledTake.to_document`` makes it. Raises BadInput for an impossible rod."""
        contacts = {
            step["pose"]: contact_of(step["touches"], step["rod_mm"])
            for step in document["steps"]
            if step["touches"]
        }
        return cls(take, document["kind"], contacts)

    def in_order(self, layout: Layout) -> TaughtTake:
        """With the layout's sensors alone, in its order; the take has them all."""
        take = self.take
        columns = [take.sensors.index(name) for name in layout.sensors]
        ordered = replace(take, sensors=layout.sensors, readings=take.readings[:, columns])
        return replace(self, take=ordered)

    def frames(self, pose: str) -> np.ndarray:
        """Rows of the take that are named ``pose``, lead-in left out."""
        names = self.take.poses or ("",) * len(self.take.time_s)
        rows = np.array([index for index, name in enumerate(names) if name == pose], dtype=int)
        return rows[rows >= self.take.lead_in_frames]

    def steps(self) -> list[np.ndarray]:
        """Rows in which the same rotations have the same known angles, in the order of time."""
        known = self.take.reference_at_frames(self.take.rotations)
        rows = np.flatnonzero(np.isfinite(known).any(axis=1))
        if not len(rows):
            return []
        changes = (np.diff(rows) > 1) | (np.nan_to_num(np.diff(known[rows], axis=0)) != 0).any(axis=1)
        return np.split(rows, np.flatnonzero(changes) + 1)


def contact_of(touches: Sequence[str], rod_mm: float | None) -> Touch | Rod:
    """What the tips of a step do. Raises BadInput for a rod that nobody can hold."""
    first, second = touches
    tips = (first, second)
    return Touch(tips) if rod_mm is None else Rod(tips, float(rod_mm))
