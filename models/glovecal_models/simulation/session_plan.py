"""What to record in a simulated session: which channels, how many takes, what motion, how clean a glove.

The sizes are typical values: 60 frames a second; a reference of 0.4 degrees white noise and as much again
that lasts 0.3 s; sensor noise of 0.3 degrees; a garment that creeps by 0.4 degrees within half a minute.

When each take of a simulated session is recorded: clock, power, battery, wearing, air.

Crossed sessions change battery, power and wearing at different takes, so that each can be told from the
others. In confounded ones everything starts once and changes with time only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.layout import Layout
from glovecal_models.names import did_you_mean

TakeMotion = Literal["natural", "fast", "ramps", "holds", "one_finger", "poses", "still", "palm"]
TAKE_MOTIONS: tuple[TakeMotion, ...] = get_args(TakeMotion)
SHORTEST_TAKE_S = 5.0
FIVE_SENSORS = ("I_MCP", "I_PIP", "M_MCP", "M_PIP", "R_MCP")
FULL_BATTERY_V = (4.02, 4.15)
VOLTS_PER_HOUR = 0.7
SUPPLY_JUMP_V = 0.015
HALF_EMPTY_BATTERY_V = (3.65, 3.78)
AIR_FELT_S = 90.0
"""In which a glove feels 63 % of other air, and forgets as much of it."""
MOST_HUMID_PCT = 97.0
GAP_S = (30.0, 240.0)
DONNING_S = (60.0, 180.0)


@dataclass(frozen=True)
class SessionPlan:
    """A session to be simulated. The same plan is the same glove, hand, motion and noise, to the byte."""

    seed: int = 0
    sensors: tuple[str, ...] = FIVE_SENSORS
    rotations: tuple[str, ...] = ()
    """Rotations with a sensor of the same place or name; none given means one per sensor, named alike."""
    wearings: int = 3
    takes_per_wearing: int = 4
    take_s: float = 40.0
    rate_hz: float = 60.0
    motions: tuple[TakeMotion, ...] = ()
    """One motion for each take of a wearing or of the session; none given means natural motion."""
    bits: int = 8
    nuisance: Literal["white", "drift", "posture"] = "drift"
    """What a healthy glove has beside white noise: nothing, a slow slip, or one that follows posture."""
    reference_white_deg: float = 0.4
    reference_lasting_deg: float = 0.4
    """Size of the reference's noise that lasts 0.3 s (first-order)."""
    sensor_noise_deg: float = 0.3
    nuisance_deg: float = 0.4
    reference_clock: Literal["same", "own"] = "same"
    """With its own clock the reference has 100 rows a second at times of its own."""
    frame_jitter_s: float = 0.0
    """Standard deviation of the frames' times around the even beat."""
    confounded: bool = False
    """One power-on, one battery, wearings in turn: all three then grow with time and cannot be told apart."""
    cloth: bool = False
    """Whether neighbours pull on sensors as in Wang & Neff 2013, Table 1 (stretch.py)."""

    def __post_init__(self) -> None:
        if not self.sensors or len(set(self.sensors)) != len(self.sensors):
            raise BadInput(f"sensors must be given once each, not {self.sensors}")
        if self.rotations and not set(self.sensors) <= set(self.rotations):
            if len(self.rotations) != len(self.sensors):
                raise BadInput("rotations must be one per sensor, or name every sensor's own rotation")
        elif not self.rotations:
            object.__setattr__(self, "rotations", self.sensors)
        for name, value, lowest in (
            ("seed", self.seed, 0), ("wearings", self.wearings, 1),
            ("takes_per_wearing", self.takes_per_wearing, 1), ("take_s", self.take_s, SHORTEST_TAKE_S),
            ("rate_hz", self.rate_hz, 10), ("bits", self.bits, 6),
            ("frame_jitter_s", self.frame_jitter_s, 0),
        ):  # fmt: skip
            if not value >= lowest:
                raise BadInput(f"{name} is {value}; it must be at least {lowest}")
        if len(self.motions) not in (0, 1, self.takes_per_wearing, self.takes):
            raise BadInput(f"{len(self.motions)} motions for {self.takes_per_wearing} takes per wearing")
        unknown = set(self.motions) - set(TAKE_MOTIONS)
        if unknown:
            meant = did_you_mean(sorted(unknown)[0], TAKE_MOTIONS)
            raise BadInput(f"no motion {sorted(unknown)[0]!r}; {meant}")

    @property
    def takes(self) -> int:
        return self.wearings * self.takes_per_wearing

    @property
    def own_rotations(self) -> tuple[int, ...]:
        """For each sensor the place of its own rotation: by name, else by the sensor's own place."""
        by_name = set(self.sensors) <= set(self.rotations)
        return tuple(
            self.rotations.index(sensor) if by_name else place for place, sensor in enumerate(self.sensors)
        )

    def motion(self, take: int) -> TakeMotion:
        """The motion of the take of this number, counted from 0 over the session."""
        return self.motions[take % len(self.motions)] if self.motions else "natural"

    @classmethod
    def of_layout(cls, layout: Layout | str, **choices: Any) -> SessionPlan:
        """A plan with a layout's sensors and rotations, such as cyberglove18, and its neighbours' pulls."""
        layout = Layout.built_in(layout) if isinstance(layout, str) else layout
        plan: dict[str, Any] = {"sensors": layout.sensors, "rotations": layout.rotations, "cloth": True}
        return cls(**(plan | choices))


def take_names(plan: SessionPlan) -> Sequence[tuple[int, str, str]]:
    """For every take in order: its wearing's number from 0, its name and its wearing's name."""
    return [
        (wearing, f"w{wearing + 1}-t{take + 1}", wearing_name(wearing))
        for wearing in range(plan.wearings)
        for take in range(plan.takes_per_wearing)
    ]


def wearing_name(wearing: int) -> str:
    """How takes name the wearing of this number, counted from 0."""
    return f"wearing-{wearing + 1}"


@dataclass(frozen=True)
class AirChange:
    """Until a take begins the glove is held into other air; its sensors come to feel it, and forget it."""

    warmer_c: float
    damper_pct: float
    """Water that is added, as relative humidity; warming and cooling change that by themselves."""
    lasts_s: float
    """How long, until the take's first frame."""

    def felt(
        self, temperature_c: np.ndarray, humidity_pct: np.ndarray, time_s: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Both, any shape, ``time_s`` after the first frame."""
        inside_s = np.maximum(self.lasts_s + np.minimum(time_s, 0.0), 0.0)
        share = -np.expm1(-inside_s / AIR_FELT_S) * np.exp(-np.maximum(time_s, 0.0) / AIR_FELT_S)
        changed_c = temperature_c + self.warmer_c * share
        drier = _saturated_hpa(temperature_c) / _saturated_hpa(changed_c)
        return changed_c, np.clip((humidity_pct + self.damper_pct * share) * drier, 0.0, MOST_HUMID_PCT)


def _saturated_hpa(temperature_c: np.ndarray) -> np.ndarray:
    """Vapour pressure over water (Magnus' formula with the numbers of the WMO)."""
    return 6.112 * np.exp(17.62 * temperature_c / (243.12 + temperature_c))


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
    air: AirChange | None = None
    """None: as the room and the hand make it."""


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
