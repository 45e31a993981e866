"""What gloves answer to commands, as REST gives it, and what their clocks' answers come to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from math import hypot
from typing import Any

from pydantic import BaseModel, Field


class GloveAnswer(BaseModel):
    glove: str
    answer: dict[str, Any] | None = Field(description="The device's document; null where it was refused.")
    problem: str | None = Field(description="Why it was refused, or that nobody answered.")


class GloveAnswers(BaseModel):
    answers: list[GloveAnswer]
    sentences: list[str] = Field(description="How far the gloves' clocks are apart, where they told them.")


def clock_sentences(answers: Sequence[Mapping[str, Any]]) -> list[str]:
    """How far each two gloves' clocks are apart, with the standard deviation, and which cannot be trusted."""
    clocks = {item["glove"]: (item["answer"] or {}).get("clock") for item in answers}
    known = {name: clock for name, clock in clocks.items() if clock}
    told = [
        f"The clock of {name} counts no frames, or jumps: only its whole seconds were used."
        for name, clock in known.items()
        if not clock["is_consistent"]
    ]
    for (one, first), (other, second) in combinations(known.items(), 2):
        apart = first["ahead_s"] - second["ahead_s"]
        sd = hypot(first["sd_s"], second["sd_s"])
        told.append(
            f"The clock of {one} is {1e3 * apart:+.1f} ms ahead of that of {other}, standard deviation "
            f"{1e3 * sd:.1f} ms."
        )
    return told
