"""What a study has found so far, kept beside its answers: figures, pictures and how many gloves."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from study_figure import StudyFigure, table
from study_parts import PARTS

SHOWN = 10


@dataclass
class PartResults:
    """Of one part."""

    asked: int
    """Gloves asked for; those that are missing failed or were not reached."""
    done: int
    figures: list[StudyFigure]


@dataclass
class StudyResults:
    """Of one state of the programs, with open or with set-aside forms."""

    software: str
    set_aside: bool = False
    limits: dict[str, float] = field(default_factory=dict)
    """Those that are not as usual."""
    parts: dict[str, PartResults] = field(default_factory=dict)
    pictures: dict[str, str] = field(default_factory=dict)
    """Titles by the name of the PNG file."""

    @property
    def forms(self) -> str:
        return "set-aside forms" if self.set_aside else "open forms"

    @property
    def head(self) -> str:
        told = "".join(f"; {name} = {value:g}" for name, value in self.limits.items())
        return f"Simulated gloves, {self.forms}; programs {self.software[:SHOWN]}{told}."

    def write(self, path: Path) -> None:
        """``path`` with the endings .md and .json."""
        some = [(PARTS[name], name, part) for name, part in self.ordered()]
        text = [f"# Blind study of the diagnosis\n\n{self.head}\n"]
        for part, name, found in some:
            text.append(f"## {name}\n\n{part.sentence} {counts(found)}\n\n{table(found.figures)}\n")
        path.with_suffix(".md").write_text("\n".join(text), encoding="utf-8")
        document = {
            "software": self.software,
            "set_aside": self.set_aside,
            "limits": self.limits,
            "pictures": self.pictures,
            "parts": {
                name: {
                    "asked": found.asked,
                    "done": found.done,
                    "figures": [figure.to_document() for figure in found.figures],
                }
                for _, name, found in some
            },
        }
        path.with_suffix(".json").write_text(json.dumps(document, indent=1), encoding="utf-8")

    def ordered(self) -> list[tuple[str, PartResults]]:
        return [(name, self.parts[name]) for name in PARTS if name in self.parts]

    @classmethod
    def read(cls, path: Path, software: str) -> StudyResults | None:
        """What is kept there; None where nothing is, or where it is of other programs."""
        path = path.with_suffix(".json")
        document: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
        if document.get("software") != software or "parts" not in document:
            return None
        parts = {
            name: PartResults(
                part["asked"], part["done"], [StudyFigure.from_document(each) for each in part["figures"]]
            )
            for name, part in document["parts"].items()
        }
        return cls(software, document["set_aside"], document["limits"], parts, document["pictures"])


def counts(found: PartResults) -> str:
    """A sentence."""
    missing = found.asked - found.done
    return f"{found.done} of {found.asked} gloves{f', {missing} missing' if missing else ''}."
