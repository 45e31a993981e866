"""What looks wrong about takes before anything is learned from them; likes are told once."""

from __future__ import annotations

import re
from collections.abc import Sequence

from glovecal_models.takes.take import Take
from glovecal_models.takes.take_check import check_take

NUMBER = re.compile(r"[0-9]+(\.[0-9]+)?(e-?[0-9]+)?")


def take_warnings(takes: Sequence[Take]) -> list[str]:
    """The sentences of ``check_take``; of those that differ in numbers alone the first, and how many more."""
    alike: dict[str, list[str]] = {}
    for take in takes:
        if not len(take.time_s):
            continue
        for sentence in check_take(take).sentences:
            key = NUMBER.sub("#", sentence.removeprefix(f"Take {take.name!r}"))
            alike.setdefault(key.replace("gaps", "gap"), []).append(sentence)
    return [_told(sentences) for sentences in alike.values()]


def only_take_sentence(takes: Sequence[Take]) -> str | None:
    """What a single take means for the errors."""
    if len(takes) != 1:
        return None
    seconds = takes[0].duration_s
    return (
        f"There is only one take, of {seconds:.0f} s: errors are on pieces of it left out, and nothing tells"
        " how the model does in another take or wearing. Record a second one."
    )


def _told(sentences: Sequence[str]) -> str:
    more = len(sentences) - 1
    return sentences[0] if not more else f"{sentences[0]} So do {more} more takes."
