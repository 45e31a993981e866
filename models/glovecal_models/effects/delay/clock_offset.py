"""Clock offset: the reference system's clock and the glove's do not agree, in each take by its own amount.

A reference-side effect: it is repaired in the measurement, not predicted. The offset comes from the clock
scan; a drift is added in takes of a minute or more where it pays.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from glovecal_models.effects.base.effect import Decoy, Parameter, Side
from glovecal_models.effects.base.signature_effect import Finding, SignatureEffect, check_signature_input
from glovecal_models.effects.delay.clock_drift import LARGEST_PPM, ClockDrift, clock_drift, without_drift
from glovecal_models.effects.delay.clock_scan import RANGE_S, ClockOffset, aligned, clock_offsets
from glovecal_models.takes.take import Take


@dataclass(frozen=True)
class TakeClock:
    """One take's clock: the scan's answer, and a drift where one pays."""

    scan: ClockOffset
    drift: ClockDrift | None

    @property
    def offset_s(self) -> float:
        return self.drift.offset_s if self.drift else self.scan.offset_s

    @property
    def drift_ppm(self) -> float:
        return self.drift.drift_ppm if self.drift else 0.0

    def repaired(self, take: Take) -> Take:
        """The take with its reference on the frames' clock; the same object when the clocks agree."""
        if self.drift is not None:
            return without_drift(take, self.drift)
        return aligned(take, self.scan.offset_s) if self.scan.verdict == "offset" else take


class ClockOffsetEffect(SignatureEffect):
    name = "clock_offset"
    explanation = "Glove and reference system were recorded with clocks that disagree."
    source = "two recorders without a common clock; real ankle recordings: -2.0 to 0.6 s, each take its own"
    side: ClassVar[Side] = "reference"
    decoy: ClassVar[Decoy] = "reversed in time"
    parameters: ClassVar = (
        Parameter("offset", "s", -RANGE_S, RANGE_S, "some tenths of a second, each take its own"),
        Parameter("drift", "ppm", -LARGEST_PPM, LARGEST_PPM, "below 100 ppm for two good clocks"),
    )

    def clocks(self, takes: Sequence[Take], *, drift: bool = True) -> tuple[TakeClock, ...]:
        """One answer per take, in their order; takes of one wearing are judged together."""
        return tuple(
            TakeClock(scan, _drift(take, scan) if drift else None)
            for take, scan in zip(takes, clock_offsets(takes), strict=True)
        )

    def find(
        self,
        takes: Sequence[Take],
        sensor_of: Mapping[str, str],
        errors: Sequence[np.ndarray] | None = None,
    ) -> tuple[Finding, ...]:
        check_signature_input(takes, sensor_of, errors)
        found = [_finding(clock) for clock in self.clocks(takes)]
        known = [item for item in found if item is not None]
        return tuple(sorted(known, key=lambda item: -abs(item.evidence["offset_s"])))

    def repaired(self, takes: Sequence[Take], *, drift: bool = True) -> tuple[Take, ...]:
        clocks = self.clocks(takes, drift=drift)
        return tuple(clock.repaired(take) for take, clock in zip(takes, clocks, strict=True))


def _drift(take: Take, scan: ClockOffset) -> ClockDrift | None:
    return clock_drift(take, scan.offset_s) if scan.verdict in ("offset", "agrees") else None


def _finding(clock: TakeClock) -> Finding | None:
    scan, drift = clock.scan, clock.drift
    if drift is None and scan.verdict not in ("offset", "range too small"):
        return None
    evidence = {
        "offset_s": clock.offset_s,
        "drift_ppm": clock.drift_ppm,
        "unexplained_before_pct": 100.0 * scan.unexplained_before,
        "unexplained_after_pct": 100.0 * (drift.unexplained_after if drift else scan.unexplained_after),
        "unexplained_reversed_pct": 100.0 * scan.unexplained_reversed,
    }
    return Finding(
        ClockOffsetEffect.name, (scan.take,), drift.sentence if drift else scan.sentence,
        kind="drift" if drift else scan.verdict, evidence=evidence,
    )  # fmt: skip
