"""Recordings that tell effects apart; an effect names those that decide between it and its rivals."""

from __future__ import annotations

from glovecal_models.effects.base.facts import Motion

FAST = Motion(
    "fast",
    "Swing several fingers to and fro as fast as you comfortably can, 2 to 3.5 times a second, about 25"
    " degrees wide.",
    45,
)
RAMPS = Motion(
    "ramps",
    "Close and open the hand slowly, turning back half-way now and then; once at 10, once at 40 degrees a"
    " second; then hold the fist for 20 s.",
    40,
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
    "Change one thing at a time: put in a fresh battery without switching off, take the glove off and on"
    " without switching off, switch off and on without taking it off; 40 s of free motion after each.",
    120,
)
TAPS = Motion(
    "taps",
    "Measure the glove's own delay, which no take with a reference can show. Run: glovecal take latency"
    " GLOVE, and tap a key at least 20 times with one finger.",
    40,
)
