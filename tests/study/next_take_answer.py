"""Whether the take that the diagnosis asks for settles what it could not tell apart."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from blind_glove import BlindGlove
from further_forms import every_form
from further_takes import FurtherTakes

from glovecal_models.diagnosis.diagnose import diagnose
from glovecal_models.diagnosis.diagnosis import Diagnosis
from glovecal_models.effects.base.relations import TAPS
from glovecal_models.improvement.limits import IMPROVEMENT_LIMITS, ImprovementLimits
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.signals import at_times
from glovecal_models.takes.take import KnownLatency
from glovecal_models.takes.tap_latency import USUAL_KEY_S, usual_key

MOST_TAKES = 2
MOST_BITS = 16
DELAYS_S = np.arange(0.0, 0.1, 0.001)
"""That frames which come again are tried for."""
TAPS_SD_S = 0.003
"""What taps scatter and the finger's stop is misjudged by."""


def next_take_answer(glove: BlindGlove, limits: ImprovementLimits = IMPROVEMENT_LIMITS) -> dict[str, Any]:
    """Confidence sets before and after each recorded take, and the motions that were asked for."""
    takes, random = list(glove.takes), np.random.default_rng(glove.seed)
    found = diagnose(takes, glove.layout, linear=glove.linear, limits=limits.diagnosis)
    sets, motions, further = [_told(found)], [], FurtherTakes(glove)
    while len(motions) < MOST_TAKES and len(sets[-1]) > 1 and _decides(found):
        assert found.next_take is not None
        motions.append(found.next_take.motion)
        if found.next_take.motion == TAPS.name:
            tapped = _tapped(glove, random)
            takes = [replace(take, glove_latency=tapped) for take in takes]
        else:
            takes.extend(further.recorded(found.next_take))
        found: Diagnosis = diagnose(takes, glove.layout, linear=glove.linear, limits=limits.diagnosis)
        sets.append(_told(found))
    return {"confidence_sets": sets, "motions": motions}


def _told(found: Diagnosis) -> list[str]:
    return [] if found.named is None else list(found.named.confidence_set)


def _decides(found: Diagnosis) -> bool:
    """Whether the take asked for is about the set, not about what could not be judged."""
    asked = found.next_take
    return asked is not None and bool(set(asked.separates) & set(_told(found)))


def _tapped(glove: BlindGlove, random: np.random.Generator) -> KnownLatency:
    """What taps on some key measure: how late the whole glove is, whatever makes it so."""
    usual_s, key_sd_s = usual_key()
    wrong_s = usual_s - random.uniform(*USUAL_KEY_S) + random.normal(0.0, TAPS_SD_S)
    return KnownLatency(_late_s(glove) + wrong_s, float(np.hypot(TAPS_SD_S, key_sd_s)))


def _late_s(glove: BlindGlove) -> float:
    """By which delay the clean twin's readings come nearest to the glove's: of a glove whose forms of delay
    have other parameters than seconds, and of one that sends old readings again. Without noise, which comes
    after the delay: it would be the same without any."""
    quiet = replace(glove.plan, sensor_noise_deg=0.0, bits=MOST_BITS)
    session = record_session(quiet, glove.causes, forms_of=every_form)
    pairs = list(zip(session.takes, session.clean, strict=True))
    left = [
        sum(
            float(np.mean((take.readings - at_times(take.time_s, clean.readings, take.time_s - delay)) ** 2))
            for take, clean in pairs
        )
        for delay in DELAYS_S
    ]
    return float(DELAYS_S[int(np.argmin(left))])
