"""What stands between two effects: rivals, look-alikes, parts of a whole, remainders that mimic another."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, fields

from glovecal_models.errors import BadInput


@dataclass(frozen=True)
class Motion:
    """A recording to make."""

    name: str
    what: str
    """The instruction, in the words that the wearer reads."""
    seconds: int
    """Of all its takes."""
    takes: int = 1


class LackOfMotion(str):
    """Why takes cannot show an effect, where a take of ``motion`` could."""

    __slots__ = ("motion",)
    motion: Motion

    def __new__(cls, why: str, motion: Motion) -> LackOfMotion:
        lacks = super().__new__(cls, why)
        lacks.motion = motion
        return lacks


@dataclass(frozen=True)
class Rival:
    """Two effects that the same takes may not tell apart, and the recording that does.

    It holds the other way round too, unless that has a row of its own: which recording is better may depend
    on which of the two explains more.
    """

    effect: str
    rival: str
    told_apart_by: Motion


@dataclass(frozen=True)
class Whole:
    """An effect known by its signature, of which others seem to explain a part."""

    effect: str
    parts: tuple[str, ...]
    share: float
    """Of the squared error up to which they do; who explains more is no part of it."""
    why: str


@dataclass(frozen=True)
class Remainder:
    """What the form of an effect misses, beside which others have to save more, or may save less."""

    effect: str
    like: tuple[str, ...]
    """Effects that it may look like: they have to save more."""
    unlike: tuple[str, ...]
    """Effects that it hardly looks like: they may save less."""
    why: str


@dataclass(frozen=True)
class Relations:
    """The table; joined, checked and asked by name."""

    rivals: tuple[Rival, ...] = ()
    alike: tuple[tuple[str, ...], ...] = ()
    """Groups whose members a correction of one leaves looking like the others: these are not asked for once a
    model has the one, and the group itself says which comes first."""
    alike_between_levels: tuple[tuple[str, str], ...] = ()
    """An effect that is found between known angles held one after another, and one that a single pass over
    them cannot tell from it."""
    taken_for: tuple[tuple[str, str], ...] = ()
    """An effect that is found by its signature, and one that looks the same there: both are told where the
    second saves error on the same rotation."""
    alike_at_several: tuple[tuple[str, str], ...] = ()
    """An effect that is found by its signature at one sensor, and one that does the same to several: where
    that is found at others too, it is no finding of its own."""
    wholes: tuple[Whole, ...] = ()
    remainders: tuple[Remainder, ...] = ()
    unrecorded: tuple[tuple[str, str], ...] = ()
    """An effect, and what the same evidence may also mean that no effect stands for, as the end of a
    sentence."""
    of_the_base: tuple[tuple[str, str], ...] = ()
    """An effect, and the training method whose base learns it by itself: asked for where the base is a
    straight line."""

    def recording(self, effect: str, other: str) -> Motion | None:
        """That tells the two apart, the first of which explains more; None where none is known."""
        known = {(row.effect, row.rival): row.told_apart_by for row in self.rivals}
        return known.get((effect, other), known.get((other, effect)))

    def alike_to(self, effect: str) -> tuple[str, ...]:
        """The other members of its group."""
        return tuple(name for group in self.alike if effect in group for name in group if name != effect)

    def between_levels(self, effect: str) -> tuple[str, ...]:
        """Effects that one pass over held angles cannot tell it from."""
        return tuple(other for found, other in self.alike_between_levels if found == effect)

    def whole(self, effect: str) -> Whole:
        """That others seem to explain a part of; without parts for any other effect."""
        return next((row for row in self.wholes if row.effect == effect), Whole(effect, (), 0.0, ""))

    def remainder(self, effect: str) -> Remainder:
        """Of its form; like and unlike nothing where none is known."""
        return next((row for row in self.remainders if row.effect == effect), Remainder(effect, (), (), ""))

    def joined(self, others: Iterable[Relations]) -> Relations:
        """With the rows of ``others``."""
        every = [self, *others]
        return Relations(
            *(tuple(row for each in every for row in getattr(each, item.name)) for item in fields(self))
        )

    def check(self, names: Collection[str]) -> None:
        """Raise BadInput for a row of an effect that is not among ``names``, one that relates an effect to
        itself, and one that stands there twice."""
        unknown = sorted({name for row in self.rows() for name in row} - set(names))
        if unknown:
            raise BadInput(f"what stands between effects names {unknown[0]!r}, which is no effect")
        for row in self.rows():
            if len(set(row)) < len(row):
                raise BadInput(f"what stands between effects relates {row[0]!r} to itself")
        once = {
            "rivals": [f"{row.effect} and {row.rival}" for row in self.rivals],
            "a group of look-alikes": [name for group in self.alike for name in group],
            "parts": [row.effect for row in self.wholes],
            "a remainder": [row.effect for row in self.remainders],
        }
        for what, of in once.items():
            twice = next((name for name in of if of.count(name) > 1), None)
            if twice is not None:
                raise BadInput(f"what stands between effects has {what} of {twice} twice")

    def rows(self) -> Iterator[tuple[str, ...]]:
        """The effects of each row."""
        yield from ((row.effect, row.rival) for row in self.rivals)
        yield from self.alike
        yield from self.alike_between_levels
        yield from self.taken_for
        yield from self.alike_at_several
        yield from ((row.effect, *row.parts) for row in self.wholes)
        yield from ((row.effect, *row.like, *row.unlike) for row in self.remainders)
        yield from ((name,) for name, _ in (*self.unrecorded, *self.of_the_base))


NO_RELATIONS = Relations()


# Recordings that tell effects apart; an effect names those that decide between it and its rivals.


FAST = Motion(
    "fast",
    "Swing several fingers to and fro, about 25 degrees wide: begin slowly, speed up over five seconds to as"
    " fast as you comfortably can (2 to 3.5 times a second), slow down again over the next five, and so on;"
    " three times 30 s, with a rest between.",
    90,
    3,
)
RAMPS = Motion(
    "ramps",
    "Close and open the hand slowly, turning back half-way now and then; once at 10, once at 40 degrees a"
    " second; then hold the fist for 20 s. Three such takes of 40 s.",
    120,
    3,
)
ONE_FINGER = Motion(
    "one_finger",
    "Rest the hand on a table and move one finger after another while the others lie still.",
    30,
)
CUPPED_PALM = Motion(
    "palm",
    "Cup the palm and flatten it again, as far as it goes, every few seconds, while the fingers keep still:"
    " straight first, then half bent, then with the thumb laid across the palm.",
    40,
)
SHUFFLED = Motion(
    "shuffled",
    "Set the same angles once more, in another order, without touching the mounting.",
    60,
)
CROSSED = Motion(
    "crossed",
    "Change one thing at a time: put in another battery without switching off, a full and a half-empty one in"
    " turn; take the glove off and on without switching off; switch off and on without taking it off; 20 s of"
    " free motion after each. All of it three times: how often a cause changed counts, not how long it was"
    " seen.",
    180,
    9,
)
AIR = Motion(
    "air",
    "Put in another battery, full and half-empty ones in turn, or switch off and on; the glove stays on the"
    " hand. Then change the air at it: hold it in a cool box, then in a plastic bag, then in front of a fan"
    " heater; three minutes each, and right after each 20 s of free motion. All of it three times.",
    180,
    9,
)
TAPS = Motion(
    "taps",
    "Measure the glove's own delay, which no take with a reference can show. Run: glovecal take latency"
    " GLOVE, and tap a key at least 20 times with one finger.",
    40,
)
