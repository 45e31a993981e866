"""What is recorded with a simulated glove after its session because the diagnosis asked for it: each take is
later than those before, and the wearer does as told."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast, get_args

import numpy as np
from blind_glove import BlindGlove

from glovecal_models.diagnosis.residual_answer import NextTake
from glovecal_models.effects.base.relations import AIR, CROSSED
from glovecal_models.simulation.session_plan import (
    FULL_BATTERY_V,
    HALF_EMPTY_BATTERY_V,
    VOLTS_PER_HOUR,
    AirChange,
    TakeMotion,
    TakeStart,
    schedule,
    wearing_name,
)
from glovecal_models.takes.take import Take

FIRST_KEY = 200_000
PAUSE_S = 60.0
"""From the end of a take to the next, while one thing is changed."""
AIR_S = 180.0
"""In other air before a take."""
NEW_WEARING_S = 40.0


class FurtherTakes:
    """Of one glove; its battery, power, wearing and time go on from recording to recording."""

    def __init__(self, glove: BlindGlove) -> None:
        self._glove = glove
        self._last: TakeStart = schedule(glove.session.plan)[-1]
        self._count = 0
        self._random = np.random.default_rng([glove.seed, 43])

    def recorded(self, asked: NextTake) -> list[Take]:
        """Whatever is no motion is a new wearing in free motion."""
        each_s = asked.seconds / asked.takes
        if asked.motion in get_args(TakeMotion):
            motion = cast(TakeMotion, asked.motion)
            return [self._take(each_s, motion=motion) for _ in range(asked.takes)]
        in_rounds = {CROSSED.name: self._crossed, AIR.name: self._in_other_air}.get(asked.motion)
        if in_rounds is None:
            return [self._take(NEW_WEARING_S, **self._put_on_anew())]
        return [take for _ in range(asked.takes // 3) for take in in_rounds(each_s)]

    def _crossed(self, take_s: float) -> list[Take]:
        """One change at a time: another battery without switching off, full and half-empty in turn; the glove
        off and on without switching off; switched off and on without taking it off."""
        return [
            self._take(take_s, supply_v=self._other_battery_v()),
            self._take(take_s, **self._put_on_anew()),
            self._take(take_s, power_on_s=self._random.uniform(4.0, 70.0)),
        ]

    def _in_other_air(self, take_s: float) -> list[Take]:
        """Of a cool box, a plastic bag and a fan heater, in one wearing, after another battery is put in, for
        which the glove is switched off."""
        random = self._random
        airs = (
            AirChange(-random.uniform(4.0, 8.0), 0.0, AIR_S),
            AirChange(random.uniform(0.5, 1.5), random.uniform(15.0, 30.0), AIR_S),
            AirChange(random.uniform(4.0, 8.0), 0.0, AIR_S),
        )
        switched = {"supply_v": self._other_battery_v(), "power_on_s": AIR_S + random.uniform(4.0, 70.0)}
        return [
            self._take(take_s, AIR_S, air=air, **({} if number else switched))
            for number, air in enumerate(airs)
        ]

    def _other_battery_v(self) -> float:
        """Full where the last one was half-empty."""
        is_full = self._last.supply_v > HALF_EMPTY_BATTERY_V[1]
        return self._random.uniform(*(HALF_EMPTY_BATTERY_V if is_full else FULL_BATTERY_V))

    def _put_on_anew(self) -> dict[str, Any]:
        wearing = self._last.wearing + 1
        return {
            "wearing": wearing,
            "wearing_name": wearing_name(wearing),
            "since_donned_s": self._random.uniform(20.0, 60.0),
        }

    def _take(self, take_s: float, pause_s: float = PAUSE_S, **changed: Any) -> Take:
        """After a pause, with what was ``changed`` in it."""
        last, later_s = self._last, self._last.take_s + pause_s
        going_on = replace(
            last,
            key=FIRST_KEY + self._count,
            name=f"further-{self._count + 1}",
            motion="natural",
            take_s=take_s,
            session_s=last.session_s + later_s,
            power_on_s=last.power_on_s + later_s,
            since_donned_s=last.since_donned_s + later_s,
            supply_v=last.supply_v - VOLTS_PER_HOUR * later_s / 3600,
            air=None,
        )
        self._last, self._count = replace(going_on, **changed), self._count + 1
        return self._glove.at(self._last)
