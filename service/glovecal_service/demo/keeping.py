"""``glovecal demo --keep``: the service stays, with a live simulated glove, until Ctrl-C."""

from __future__ import annotations

from collections.abc import Callable

from glovecal_service.demo.processes import DemoPlace, running_capture
from glovecal_service.demo.walk import GLOVE, SUBJECT


def keep_running(place: DemoPlace, seed: int, say: Callable[[str], None]) -> None:
    """Stream free motion again and again; returns on Ctrl-C."""
    say(f"\nStill running. REST: {place.url}/v1/openapi.json")
    say(f"  export GLOVECAL_URL={place.url} GLOVECAL_ZENOH={place.zenoh}")
    say(f"  glovecal model list;  glovecal watch {GLOVE};  Ctrl-C here stops it and removes its data.")
    options = {"seed": str(seed), "motion": "free", "wearing": "1"}
    try:
        while True:
            with running_capture(
                place, glove=GLOVE, subject=SUBJECT, wearing="second", options=options
            ) as capture:
                capture.wait()
    except KeyboardInterrupt:
        say("Stopping.")
