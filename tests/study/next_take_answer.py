"""Whether the take that the diagnosis asks for settles what it could not tell apart."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast, get_args

import numpy as np
from blind_glove import BlindGlove

from glovecal_models.diagnosis.diagnose import diagnose
from glovecal_models.diagnosis.diagnosis import Diagnosis
from glovecal_models.diagnosis.residual_answer import NextTake
from glovecal_models.effects.base.relations import CROSSED, TAPS
from glovecal_models.improvement.limits import IMPROVEMENT_LIMITS, ImprovementLimits
from glovecal_models.simulation.session_plan import TakeMotion
from glovecal_models.simulation.signals import at_times
from glovecal_models.takes.take import KnownLatency, Take
from glovecal_models.takes.tap_latency import USUAL_KEY_S, usual_key

MOST_TAKES = 2
NEW_WEARING_S = 40.0
DELAYS_S = np.arange(0.0, 0.1, 0.001)
"""That frames which come again are tried for."""
TAPS_SD_S = 0.003
"""What taps scatter and the finger's stop is misjudged by."""


def next_take_answer(glove: BlindGlove, limits: ImprovementLimits = IMPROVEMENT_LIMITS) -> dict[str, Any]:
    """Confidence sets before and after each recorded take, and the motions that were asked for."""
    takes, random = list(glove.takes), np.random.default_rng(glove.seed)
    found = diagnose(takes, glove.layout, linear=glove.linear, limits=limits.diagnosis)
    sets, motions = [_told(found)], []
    while len(motions) < MOST_TAKES and len(sets[-1]) > 1 and _decides(found):
        assert found.next_take is not None
        motions.append(found.next_take.motion)
        if found.next_take.motion == TAPS.name:
            tapped = _tapped(glove, random)
            takes = [replace(take, glove_latency=tapped) for take in takes]
        else:
            takes.extend(_recorded(glove, found.next_take, len(motions) - 1))
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
    """By which delay the clean twin's readings, noise included, come nearest to the glove's: of a glove whose
    forms of delay have other parameters than seconds, and of one that sends old readings again."""
    pairs = list(zip(glove.takes, glove.clean_takes, strict=True))
    left = [
        sum(
            float(np.mean((take.readings - at_times(take.time_s, clean.readings, take.time_s - delay)) ** 2))
            for take, clean in pairs
        )
        for delay in DELAYS_S
    ]
    return float(DELAYS_S[int(np.argmin(left))])


def _recorded(glove: BlindGlove, asked: NextTake, repeat: int) -> list[Take]:
    """The wearer does as told; whatever is no motion is a new wearing in free motion."""
    if asked.motion in get_args(TakeMotion):
        motion = cast(TakeMotion, asked.motion)
        return [glove.also(motion, float(asked.seconds), glove.wearings - 1, repeat=repeat)]
    if asked.motion == CROSSED.name:
        rounds, each_s = CROSSED.takes // 3, CROSSED.seconds / CROSSED.takes
        return [take for turn in range(rounds) for take in glove.crossed(each_s, rounds * repeat + turn)]
    return [glove.also("natural", NEW_WEARING_S, glove.wearings + repeat)]
