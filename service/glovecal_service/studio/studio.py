"""What every page of the studio is given."""

from __future__ import annotations

from dataclasses import dataclass

from glovecal_service.studio.live_feed import LiveFeeds
from glovecal_service.studio.service import Service


@dataclass(frozen=True)
class Studio:
    """The service, and what gloves send now."""

    service: Service
    feeds: LiveFeeds
    largest_file: int
    """Bytes that a page's upload takes, as any upload over REST."""
