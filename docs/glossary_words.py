"""The glossary as the studio shows it: ``python3 docs/glossary_words.py`` writes it beside the pages."""

from __future__ import annotations

import json
import re
from pathlib import Path

HERE = Path(__file__).parent
GLOSSARY = HERE / "glossary.md"
WORDS = HERE.parent / "service" / "glovecal_service" / "studio" / "static" / "words.json"


def words() -> dict[str, str]:
    """What each word means, as plain text."""
    found = re.findall(r"^### (.+)\n(.+)$", GLOSSARY.read_text(encoding="utf-8"), re.MULTILINE)
    return {word: _plain(meaning) for word, meaning in found}


def written() -> str:
    return json.dumps(words(), ensure_ascii=False, indent=1) + "\n"


def _plain(markdown: str) -> str:
    text = re.sub(r"\[([^\]]+)\]\([^)]+\)", r"\1", markdown)
    return re.sub(r"[`*]", "", text)


if __name__ == "__main__":
    WORDS.write_text(written(), encoding="utf-8")
