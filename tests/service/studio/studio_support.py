"""A page of the studio as tests open it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from playwright.sync_api import Page


@dataclass
class Opened:
    """A page of the studio, and what went wrong on it."""

    page: Page
    complaints: list[str] = field(default_factory=list)
    """Console errors, uncaught errors."""
    asked: list[str] = field(default_factory=list)
    """Addresses of all requests."""


Open = Callable[..., Opened]
