"""What looks wrong about takes before anything is learned from them; like warnings are counted."""

from __future__ import annotations

import re
from collections.abc import Sequence

from glovecal_models.takes.reference_jumps import jump_sentences
from glovecal_models.takes.take import Take
from glovecal_models.takes.take_check import check_take

_NAME = re.compile(r"^Take (['\"]).*?\1")
_NUMBER = re.compile(r"[0-9]+(\.[0-9]+)?(e[-+]?[0-9]+)?")


def take_warnings(takes: Sequence[Take]) -> list[str]:
    """The sentences of ``check_take``; of those that differ in numbers alone the first, and how many more."""
    return alike_once([each for take in takes if len(take.time_s) for each in check_take(take).sentences])


def excluded_sentences(takes: Sequence[Take]) -> list[str]:
    """On reference angles that are excluded, as they jump away and come back."""
    return alike_once([each for take in takes for each in jump_sentences(take, take.excluded)])


def alike_once(sentences: Sequence[str]) -> list[str]:
    """Of those that differ in numbers alone the first, and how many more."""
    alike: dict[str, list[str]] = {}
    for sentence in sentences:
        alike.setdefault(kind_of(sentence), []).append(sentence)
    return [_summarized(some) for some in alike.values()]


def kind_of(sentence: str) -> str:
    """The same text for warnings that differ in the take's name and in numbers alone."""
    return _NUMBER.sub("#", _NAME.sub("", sentence)).replace("gaps", "gap").replace("takes", "take")


def _summarized(sentences: Sequence[str]) -> str:
    more = len(sentences) - 1
    return (
        sentences[0] if not more else f"{sentences[0]} The same in {more} more take{'s' if more > 1 else ''}."
    )
