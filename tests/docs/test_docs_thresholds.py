"""The page of thresholds is what the limits say."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"


def test_the_page_is_what_the_limits_say(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "path", [str(DOCS), *sys.path])
    from thresholds_page import PAGE, thresholds_page

    assert PAGE.read_text(encoding="utf-8") == thresholds_page(), "python3 docs/thresholds_page.py writes it"
