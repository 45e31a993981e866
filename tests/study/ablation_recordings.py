"""Real recordings with all rules and without each. They are no part of the project: without them there is
nothing to ask."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from ablation_answer import Ablation, ablation
from finished_gloves import FinishedGloves

from glovecal_models.diagnosis.state import Choices
from glovecal_models.layout import Layout
from glovecal_models.takes.table import read_takes
from glovecal_models.takes.take import Take

PEOPLE, PLACEMENTS, WALKERS = range(300, 305), (1, 2, 3), ("P002-*-L", "P002-*-R", "P003-*-L", "P003-*-R")
DEAD = ("G08", "G16")


@dataclass(frozen=True)
class Recording:
    """One set of takes, and what is known to be true of them."""

    name: str
    pattern: str
    first: str | None
    """Named first; None: nothing."""
    second: str | None = None
    """Once the clocks are right."""
    leave_out: tuple[str, ...] = ()


RECORDINGS = (
    *(
        Recording(f"ankle P{who}, placement {at}", f"ankle/P{who}-placement{at}-*.frames.csv", "clock_offset")
        for who in PEOPLE
        for at in PLACEMENTS
    ),
    *(
        Recording(
            f"ankle P{who}, three placements", f"ankle/P{who}-placement?-*.frames.csv", "clock_offset",
            "donning_shift",
        )
        for who in PEOPLE
    ),
    *(Recording(f"gait {walker}", f"gait/{walker}-*.csv", None) for walker in WALKERS),
    Recording("robot thumb", "cyberglove-robot-thumb/*.csv", None, leave_out=DEAD),
    Recording("known angles", "flex-static/one-sensor.csv", "nonlinearity"),
)  # fmt: skip


def recorded_answers(
    folder: Path, finished: FinishedGloves
) -> Iterator[tuple[Recording, str | None, dict[str, Any]]]:
    """Each recording, what is true of it, and its verdicts; twice where the clocks are put right first."""
    for item in RECORDINGS:
        paths = sorted(folder.glob(item.pattern))
        if not paths:
            continue
        key = json.dumps({"recording": item.name})
        answer = finished.get(key)
        if answer is None:
            answer = _asked([take for path in paths for take in read_takes(path)], item)
            finished.keep(key, answer)
        yield item, item.first, answer["alone"]
        if answer.get("second"):
            yield item, item.second, answer["second"]


def _asked(takes: Sequence[Take], item: Recording) -> dict[str, Any]:
    sensors = [name for name in takes[0].sensors if name not in item.leave_out]
    layout = Layout.from_columns("recorded", sensors, takes[0].rotations)
    alone = ablation(takes, layout, Choices(linear=True))
    answer = {"alone": alone.to_document()}
    if item.second is not None and (moved := _in_time(takes, alone)):
        answer["second"] = ablation(moved, layout, Choices(linear=True)).to_document()
    return answer


def _in_time(takes: Sequence[Take], found: Ablation) -> list[Take]:
    """The takes with their references as much later as the first of the ranking says."""
    first = found.whole.naming.first
    comparison = None if first is None else found.whole.effects[first.effect].comparison
    delay = None if first is None or comparison is None else comparison.reference_delay_s(first)
    if delay is None:
        return []
    delays = np.broadcast_to(delay, (len(takes),))
    return [
        replace(take, reference_time_s=take.reference_time_s + float(by))
        for take, by in zip(takes, delays, strict=True)
    ]
