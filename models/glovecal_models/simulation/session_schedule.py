"""When each take of a simulated session is recorded: clock, power, battery, wearing, air.

Crossed sessions change battery, power and wearing at different takes, so that each can be told from the
others. In confounded ones everything starts once and changes with time only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean
from glovecal_models.simulation.session_plan import (
    SHORTEST_TAKE_S,
    TAKE_MOTIONS,
    SessionPlan,
    TakeMotion,
    take_names,
    wearing_name,
)

FULL_BATTERY_V = (4.02, 4.15)
VOLTS_PER_HOUR = 0.7
SUPPLY_JUMP_V = 0.015
GAP_S = (30.0, 240.0)
DONNING_S = (60.0, 180.0)


@dataclass(frozen=True)
class TakeStart:
    """The circumstances at a take's first frame."""

    key: int
    """Seeds whatever is random in this take."""
    name: str
    wearing: int
    wearing_name: str
    motion: TakeMotion
    take_s: float
    session_s: float
    """Seconds since the session began."""
    power_on_s: float
    since_donned_s: float
    supply_v: float


def schedule(plan: SessionPlan) -> tuple[TakeStart, ...]:
    """The start of every planned take, in order of time."""
    random = np.random.default_rng([plan.seed, 40])
    power_cycled, battery_changed = _events(plan, random)
    now, power_on, supply = 0.0, 0.0, random.uniform(*FULL_BATTERY_V)
    donned = 0.0
    starts: list[TakeStart] = []
    for number, (wearing, name, wearing_label) in enumerate(take_names(plan)):
        new_wearing = number == 0 or wearing != starts[-1].wearing
        gap = random.uniform(*GAP_S)
        if new_wearing:
            gap += random.uniform(*DONNING_S)
            donned = now + gap - random.uniform(20.0, 60.0)
        now += gap
        supply -= VOLTS_PER_HOUR * (gap + plan.take_s) / 3600
        fresh = random.uniform(*FULL_BATTERY_V), random.uniform(4.0, 70.0)
        if number in battery_changed:
            supply = fresh[0]
        if number == 0 or number in power_cycled:
            power_on = now - fresh[1]
        starts.append(
            TakeStart(
                key=number,
                name=name,
                wearing=wearing,
                wearing_name=wearing_label,
                motion=plan.motion(number),
                take_s=plan.take_s,
                session_s=now,
                power_on_s=now - power_on,
                since_donned_s=now - donned,
                supply_v=supply + SUPPLY_JUMP_V * random.standard_normal(),
            )
        )
        now += plan.take_s
    return tuple(starts)


def one_more(
    plan: SessionPlan, motion: TakeMotion, take_s: float, wearing: int, repeat: int
) -> tuple[TakeStart, ...]:
    """The start of one take after the planned ones, as a schedule of one. Raises BadInput."""
    if motion not in TAKE_MOTIONS:
        raise BadInput(f"no motion {motion!r}; {did_you_mean(motion, TAKE_MOTIONS)}")
    if take_s < SHORTEST_TAKE_S or wearing < 0 or repeat < 0:
        raise BadInput(f"no take of {take_s:g} s in wearing {wearing}, repeat {repeat}: both count from 0")
    before = schedule(plan)
    last = before[-1]
    key = 100_000 + 1_000 * repeat + 10 * wearing + TAKE_MOTIONS.index(motion)
    random = np.random.default_rng([plan.seed, 41, key])
    gap = random.uniform(*GAP_S) + plan.take_s
    same = last.wearing == wearing
    return (
        TakeStart(
            key=key,
            name=f"w{wearing + 1}-{motion}-{repeat + 1}".replace("_", "-"),
            wearing=wearing,
            wearing_name=wearing_name(wearing),
            motion=motion,
            take_s=take_s,
            session_s=last.session_s + gap,
            power_on_s=last.power_on_s + gap,
            since_donned_s=last.since_donned_s + gap if same else random.uniform(20.0, 60.0),
            supply_v=last.supply_v - VOLTS_PER_HOUR * gap / 3600,
        ),
    )


def _events(plan: SessionPlan, random: np.random.Generator) -> tuple[set[int], set[int]]:
    """Takes before which the power was switched off and on, and those before which a battery was changed."""
    later = np.arange(1, plan.takes)
    if plan.confounded or not len(later):
        return set(), set()
    inside = later[later % plan.takes_per_wearing != 0]
    between = later[later % plan.takes_per_wearing == 0]
    cycled = set(random.permutation(inside)[: max(len(inside) // 3, 1)].tolist())
    cycled |= set(random.permutation(between)[: len(between) // 2].tolist())
    kept = [int(number) for number in later if int(number) not in cycled] or [int(later[-1])]
    changed = set(random.permutation(kept)[: 1 + plan.takes // 8].tolist())
    return cycled, changed


class Air:
    """Temperature and humidity at the sensors: the room's slow swings, and what a hand adds in a glove."""

    def __init__(self, plan: SessionPlan) -> None:
        random = np.random.default_rng([plan.seed, 42])
        self._confounded = plan.confounded
        self._start = random.uniform(20.0, 24.0), random.uniform(38.0, 52.0)
        self._period_s = random.uniform(500.0, 2400.0, (2, 2))
        self._phase = random.uniform(0, 2 * np.pi, (2, 2))
        self._swing = np.array([[1.2, 0.8], [3.0, 2.0]]) * random.uniform(0.7, 1.3, (2, 2))
        self._warming = random.uniform(2.0, 4.0), random.uniform(4.0, 10.0)

    def temperature_c(self, session_s: np.ndarray, since_donned_s: np.ndarray) -> np.ndarray:
        """Degrees Celsius; any shape."""
        return self._at(0, session_s, since_donned_s)

    def humidity_pct(self, session_s: np.ndarray, since_donned_s: np.ndarray) -> np.ndarray:
        """Relative humidity in per cent; any shape."""
        return self._at(1, session_s, since_donned_s)

    @property
    def usual(self) -> tuple[float, float]:
        """The mean temperature and humidity of forty minutes in a glove."""
        session_s = np.linspace(0.0, 2400.0, 241)
        worn_s = np.full(241, 400.0)
        temperature, humidity = (self._at(which, session_s, worn_s) for which in range(2))
        return float(temperature.mean()), float(humidity.mean())

    def _at(self, which: int, session_s: np.ndarray, since_donned_s: np.ndarray) -> np.ndarray:
        if self._confounded:
            return self._start[which] + 2 * self._warming[which] * -np.expm1(-session_s / 1500.0)
        waves = sum(
            self._swing[which, wave]
            * np.sin(2 * np.pi * session_s / self._period_s[which, wave] + self._phase[which, wave])
            for wave in range(2)
        )
        warmed = self._warming[which] * -np.expm1(-np.maximum(since_donned_s, 0.0) / 600.0)
        return self._start[which] + waves + warmed
