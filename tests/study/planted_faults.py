"""Faults planted into real readings and references, and what is told of them.

A fault is found where ``take check``, the takes held against each other, or ``diagnose`` names what is at
fault and how. A sentence is false where it is about a sensor, a rotation or a take that is sound.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from glove_choices import few_takes

from glovecal_models.comparison.odd_takes import fitting, odd_takes
from glovecal_models.diagnosis.model_on_takes import ModelOnTakes
from glovecal_models.layout import Layout
from glovecal_models.takes.reference_jumps import without_jumps
from glovecal_models.takes.table import read_takes
from glovecal_models.takes.take import Take
from glovecal_models.takes.take_check import excluded_sentences, take_warnings

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
TUNED = ("P300", "P301", "P302", "P002")
"""Whoever chose constants looked at these people alone; P303, P304 and P003 are kept apart."""
STRIDES = 10
TRUE_OF_ALL = re.compile(r"gaps? in the frames|frames repeat the one before|take clocks finds")
"""Gaps are there, strides are recorded with readings that are held, and the sleeves' clocks are off."""
FIRST_HEALTHY = 1000


@dataclass(frozen=True)
class Session:
    """Takes of one person and one wearing."""

    name: str
    takes: tuple[Take, ...]
    others: tuple[tuple[Take, ...], ...] = ()
    """The same takes of other people."""

    @property
    def layout(self) -> Layout:
        return Layout.from_columns("recorded", self.takes[0].sensors, self.takes[0].rotations)

    @property
    def is_tuned(self) -> bool:
        return self.name.split("-")[0] in TUNED


@dataclass(frozen=True)
class Planted:
    """Takes with a fault, and the names that are concerned."""

    takes: tuple[Take, ...]
    names: tuple[str, ...]
    take: str | None = None
    """None: more than one."""


@dataclass(frozen=True)
class Marked:
    """What was told of one session."""

    fault: str
    session: str
    number: int
    found: bool
    false: tuple[str, ...]
    """Sentences about what is sound."""
    other: tuple[str, ...]
    """Sentences about what is at fault that do not name the fault."""
    named: str | None
    """The effect that is named."""


def sessions() -> list[Session]:
    """Real ones; none where the recordings are not here."""
    ankles = [
        (
            f"P{person}-placement{placement}",
            sorted(DATA.glob(f"ankle/P{person}-placement{placement}-*.frames.csv")),
        )
        for placement in (1, 2, 3)
        for person in range(300, 305)
    ]
    strides = [
        (f"{person}-walk-{side}", sorted(DATA.glob(f"gait/{person}-WALK*-{side}-?.csv"))[:STRIDES])
        for person in ("P002", "P003")
        for side in "LR"
    ]
    found = [
        Session(name, tuple(take for file in files for take in read_takes(file)))
        for name, files in (*ankles, *strides)
        if files
    ]
    return [replace(each, others=tuple(_alike(each, found))) for each in found]


def _alike(session: Session, every: Sequence[Session]) -> Iterator[tuple[Take, ...]]:
    kind = session.name.partition("-")[2]
    for other in every:
        if other.name != session.name and other.name.partition("-")[2] == kind:
            yield other.takes


# Faults. Each is planted with its own stream of random numbers.

Plant = Callable[[Session, np.random.Generator], Planted]


def _with_readings(take: Take, sensor: int, values: np.ndarray) -> Take:
    readings = take.readings.copy()
    readings[:, sensor] = values
    return replace(take, readings=readings)


def _changed(takes: Sequence[Take], number: int, take: Take) -> tuple[Take, ...]:
    return (*takes[:number], take, *takes[number + 1 :])


def _some(session: Session, random: np.random.Generator) -> tuple[int, int]:
    """A take and a sensor."""
    return int(random.integers(len(session.takes))), int(random.integers(len(session.takes[0].sensors)))


def stuck_for(session: Session, random: np.random.Generator, seconds: float = 2.0) -> Planted:
    """While its neighbours move at least as much as usual; of strides so many as last that long."""
    long = [number for number, take in enumerate(session.takes) if take.duration_s > seconds + 0.3]
    _, sensor = _some(session, random)
    name = session.takes[0].sensors[sensor]
    if not long:
        first = int(random.integers(len(session.takes) - 1))
        pair = [
            _with_readings(take, sensor, np.full(len(take.time_s), session.takes[first].readings[0, sensor]))
            for take in session.takes[first : first + 2]
        ]
        return Planted((*session.takes[:first], *pair, *session.takes[first + 2 :]), (name,))
    number = int(random.choice(long))
    take = session.takes[number]
    frames = int(np.searchsorted(take.time_s, take.time_s[0] + seconds)) + 1
    moved = np.abs(np.diff(np.delete(take.readings, sensor, axis=1), axis=0)).sum(axis=1)
    sums = np.convolve(moved, np.ones(frames - 1), "valid")
    first = int(random.choice(np.flatnonzero(sums >= np.median(sums))))
    values = take.readings[:, sensor].copy()
    values[first : first + frames] = values[first]
    return Planted(_changed(session.takes, number, _with_readings(take, sensor, values)), (name,), take.name)


def stuck_on(session: Session, random: np.random.Generator) -> Planted:
    """From a moment in the first half of the takes on, for ever."""
    _, sensor = _some(session, random)
    number = int(random.integers(max(len(session.takes) // 2, 1)))
    takes = list(session.takes)
    first = int(random.uniform(0.2, 0.6) * len(takes[number].time_s))
    level = takes[number].readings[first, sensor]
    for later in range(number, len(takes)):
        values = takes[later].readings[:, sensor].copy()
        values[first if later == number else 0 :] = level
        takes[later] = _with_readings(takes[later], sensor, values)
    return Planted(tuple(takes), (takes[0].sensors[sensor],))


def clipped(session: Session, random: np.random.Generator) -> Planted:
    """At one end of its range over all takes, for a fifth of the time."""
    _, sensor = _some(session, random)
    every = np.concatenate([take.readings[:, sensor] for take in session.takes])
    at_top = bool(random.integers(2))
    end = float(np.quantile(every, 0.8 if at_top else 0.2))
    cut = np.minimum if at_top else np.maximum
    takes = [_with_readings(take, sensor, cut(take.readings[:, sensor], end)) for take in session.takes]
    return Planted(tuple(takes), (takes[0].sensors[sensor],))


def dead(session: Session, random: np.random.Generator) -> Planted:
    """Constant, or trembling between two values, in all takes."""
    _, sensor = _some(session, random)
    level, step = float(session.takes[0].readings[0, sensor]), 0.1 * float(random.integers(2))
    takes = [
        _with_readings(take, sensor, level + step * random.integers(0, 2, len(take.time_s)))
        for take in session.takes
    ]
    return Planted(tuple(takes), (takes[0].sensors[sensor],))


def _pair(session: Session, random: np.random.Generator) -> list[int]:
    return sorted(int(each) for each in random.permutation(len(session.takes[0].sensors))[:2])


def _exchanged(values: np.ndarray, pair: Sequence[int], first: int = 0) -> np.ndarray:
    result = values.copy()
    result[first:, pair] = values[first:, pair[::-1]]
    return result


def swapped_in_one(session: Session, random: np.random.Generator) -> Planted:
    number, pair = int(random.integers(len(session.takes))), _pair(session, random)
    take = session.takes[number]
    changed = replace(take, readings=_exchanged(take.readings, pair))
    return Planted(
        _changed(session.takes, number, changed), tuple(take.sensors[each] for each in pair), take.name
    )


def swapped_on(session: Session, random: np.random.Generator) -> Planted:
    """From a moment within a take on; where later takes are told, that is right, too."""
    number, pair = int(random.integers(len(session.takes))), _pair(session, random)
    takes = list(session.takes)
    first = int(random.uniform(0.2, 0.8) * len(takes[number].time_s))
    for later in range(number, len(takes)):
        begin = first if later == number else 0
        takes[later] = replace(takes[later], readings=_exchanged(takes[later].readings, pair, begin))
    return Planted(tuple(takes), tuple(takes[0].sensors[each] for each in pair))


def wired(session: Session, random: np.random.Generator) -> Planted:
    """A copy of its neighbour, with noise of up to 1 % of the range."""
    one, other = (int(each) for each in random.permutation(len(session.takes[0].sensors))[:2])
    span = max(float(np.ptp(take.readings[:, other])) for take in session.takes)
    noise = span * float(random.choice([0.0, 0.002, 0.01]))
    takes = [
        _with_readings(
            take, one, np.round(take.readings[:, other] + noise * random.normal(size=len(take.time_s)), 1)
        )
        for take in session.takes
    ]
    return Planted(tuple(takes), tuple(takes[0].sensors[each] for each in (one, other)))


def reference_swapped(session: Session, random: np.random.Generator) -> Planted:
    number, _ = _some(session, random)
    take = session.takes[number]
    changed = replace(take, reference=take.reference[:, ::-1])
    return Planted(_changed(session.takes, number, changed), take.rotations, take.name)


def wandering(session: Session, random: np.random.Generator) -> Planted:
    """By 5 to 15 degrees from the take's beginning to its end, evenly or not."""
    number, _ = _some(session, random)
    take, column = session.takes[number], int(random.integers(len(session.takes[0].rotations)))
    share = np.linspace(0.0, 1.0, len(take.reference_time_s)) ** float(random.choice([0.5, 1.0, 2.0]))
    reference = take.reference.copy()
    reference[:, column] += float(random.choice([-1, 1]) * random.choice([5.0, 8.0, 15.0])) * share
    changed = replace(take, reference=reference)
    return Planted(_changed(session.takes, number, changed), (take.rotations[column],), take.name)


def glitching(session: Session, random: np.random.Generator) -> Planted:
    """1 to 2 % of a column's angles are 15 to 60 degrees off, one by one."""
    number, _ = _some(session, random)
    take, column = session.takes[number], int(random.integers(len(session.takes[0].rotations)))
    reference = take.reference.copy()
    wild = np.flatnonzero(random.random(len(reference)) < random.choice([0.01, 0.02]))
    wild = wild if len(wild) else np.array([len(reference) // 2])
    reference[wild, column] += random.choice([-1, 1], len(wild)) * random.uniform(15, 60, len(wild))
    changed = replace(take, reference=reference)
    return Planted(_changed(session.takes, number, changed), (take.rotations[column],), take.name)


def somebody_else(session: Session, random: np.random.Generator) -> Planted:
    """The same motion of another person, under the take's name."""
    number, _ = _some(session, random)
    take, other = session.takes[number], session.others[int(random.integers(len(session.others)))]
    theirs = other[min(number, len(other) - 1)]
    changed = replace(theirs, name=take.name, wearing=take.wearing)
    return Planted(_changed(session.takes, number, changed), (), take.name)


FAULTS: dict[str, tuple[Plant, str]] = {
    "stuck for 2 s": (stuck_for, "reads .* from|stands still|always"),
    "stuck for ever": (stuck_on, "reads .* from|stands still|always"),
    "clipped": (clipped, "cut off|end stop"),
    "dead": (dead, "always|only .* or "),
    "swapped in one take": (swapped_in_one, "exchanged|reverse order|another order"),
    "swapped from a moment on": (swapped_on, "exchange"),
    "wired to its neighbour": (wired, "read the same"),
    "two references swapped": (reference_swapped, "exchanged|reverse order|another order"),
    "a wandering reference": (wandering, "wanders"),
    "a glitching reference": (glitching, "jump"),
    "somebody else's take": (somebody_else, "nother person"),
}
"""How each is planted, and what it is called."""
UNTOUCHED = "untouched"


def told(takes: Sequence[Take], layout: Layout, *, linear: bool = True) -> tuple[list[str], str | None]:
    """All that is said of takes, sensors and reference, and the effect that is named."""
    takes = [without_jumps(take) for take in takes]
    sentences = [*excluded_sentences(takes), *(each for take in takes for each in take_warnings([take]))]
    odd = odd_takes(takes, layout)
    fitted = ModelOnTakes(tuple(fitting(takes, odd)), layout, linear)
    found = fitted.diagnosed(judge_residual=False)
    sentences += [item.told for item in odd]
    sentences += [
        *found.sensor_problems,
        *found.reference_problems,
        *(item.sentence for item in found.findings),
    ]
    named = None if found.named is None else found.named.effect
    return [each for each in dict.fromkeys(sentences) if not TRUE_OF_ALL.search(each)], named


def asked(session: Session, fault: str, number: int) -> Marked:
    """One fault in one session."""
    random = np.random.default_rng([zlib.crc32(f"{session.name} {fault}".encode()), number])
    plant, words = FAULTS.get(fault, (lambda each, _: Planted(each.takes, ()), "$^"))
    planted = plant(session, random)
    sentences, named = told(planted.takes, session.layout)
    every = (*session.takes[0].sensors, *session.takes[0].rotations)
    marked: dict[str, list[str]] = {"found": [], "false": [], "other": []}
    for sentence in sentences:
        names = {name for name in every if re.search(rf"\b{name}\b", sentence)}
        about = {take.name for take in session.takes if re.search(rf"\b{re.escape(take.name)}\b", sentence)}
        right_take = planted.take is None or planted.take in about or not about
        right = bool(planted.names and names & set(planted.names)) or (not names and fault in FAULTS)
        is_named = set(planted.names) <= names and right_take and bool(re.search(words, sentence))
        is_about = (
            right and right_take if planted.names else planted.take is not None and planted.take in about
        )
        marked["found" if is_named and is_about else "other" if is_about else "false"].append(sentence)
    return Marked(
        fault,
        session.name,
        number,
        bool(marked["found"]),
        tuple(marked["false"]),
        tuple(marked["other"]),
        named,
    )


def healthy(number: int) -> Marked:
    """A simulated glove without a fault."""
    glove = few_takes(number)
    sentences, named = told(glove.takes, glove.layout, linear=glove.linear)
    return Marked(UNTOUCHED, f"simulated {number}", number, False, tuple(sentences), (), named)


def marked(job: tuple[Session, str, int] | int) -> Marked:
    return healthy(job) if isinstance(job, int) else asked(*job)
