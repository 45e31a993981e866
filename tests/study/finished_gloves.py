"""Answers that are there already, kept so that an interrupted study goes on where it stopped.

One file for each part and each state of the programs: answers of a changed program are not mixed with older
ones, and older ones are not lost.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import glovecal_models

MODELS = Path(glovecal_models.__file__).resolve().parent
HASHED = (".py", ".toml")
SHOWN = 10
FEW = 5
"""Gloves from which on their mean time is believed."""
RECIPE = 2
"""Rises when the same glove and programs get another answer: older answers are not used then."""


def software_hash() -> str:
    """Of every program file of glovecal_models: what an answer depends on beside the glove."""
    digest = hashlib.sha256(b"%d" % RECIPE)
    for path in sorted(path for path in MODELS.rglob("*") if path.suffix in HASHED):
        digest.update(path.relative_to(MODELS).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


class FinishedGloves:
    """Answers of one part, by the key of the glove."""

    def __init__(self, folder: Path, part: str, software: str) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.path = folder / f"{part}-{software[:SHOWN]}.jsonl"
        self._answers: dict[str, dict[str, Any]] = {}
        self._took_s: list[float] = []
        if self.path.exists():
            for line in self.path.read_text(encoding="utf-8").splitlines():
                self._read(line)

    def get(self, key: str) -> dict[str, Any] | None:
        return self._answers.get(key)

    @property
    def glove_s(self) -> float | None:
        """Mean seconds of processor time of a glove; None before a few were asked."""
        return sum(self._took_s) / len(self._took_s) if len(self._took_s) >= FEW else None

    def keep(self, key: str, answer: dict[str, Any], took_s: float = 0.0) -> None:
        """Written to the end of the file at once."""
        document = {"glove": json.loads(key), "answer": answer, "took_s": round(took_s, 1)}
        self._keep(document)
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(document) + "\n")

    def _read(self, line: str) -> None:
        try:
            document = json.loads(line)
        except ValueError:
            return  # the line that was being written when the study was stopped
        self._keep(document)

    def _keep(self, document: dict[str, Any]) -> None:
        self._answers[json.dumps(document["glove"], sort_keys=True)] = document["answer"]
        self._took_s.append(document["took_s"])
