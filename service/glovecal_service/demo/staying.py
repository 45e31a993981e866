"""The demo's end for those who stay: its second glove goes on moving, and the story is theirs to walk."""

from __future__ import annotations

import os
import sys
import time
import webbrowser
from collections.abc import Callable

from glovecal_client.rest import RestClient
from glovecal_models.takes.write_table import write_takes
from glovecal_service.demo.hidden_session import HiddenSession
from glovecal_service.demo.live_child import GLOVE
from glovecal_service.demo.processes import DemoPlace, running_capture
from glovecal_service.demo.second_act import DIAGNOSED, Findings
from glovecal_service.operating_system import has_display

MOTION_S = 40.0
"""Replayed again and again."""
CAPTURE_AGAIN_S = 2.0
LOOK_S = 0.2
QUESTION = "Stay, and walk through the second part in the studio? Ctrl-C ends it. [Y/n] "


def wants_to_stay(*, as_json: bool) -> bool:
    """Asked on a terminal only, and where somebody can be expected to answer."""
    if as_json or os.environ.get("CI") or not (sys.stdin.isatty() and sys.stdout.isatty()):
        return False
    try:
        return not input(QUESTION).strip().lower().startswith("n")
    except EOFError:
        return False


def stay(
    service: RestClient,
    place: DemoPlace,
    hidden: HiddenSession,
    found: Findings,
    say: Callable[[str], None],
    motion_s: float = MOTION_S,
) -> None:
    """Serve the model without the effect again and stream its glove; returns on Ctrl-C."""
    model = found.models[DIAGNOSED]
    service.post(f"/models/{model}/activate")
    page = f"{place.url}/studio/compare?models={model[:12]}"
    say(f"\nStill running, and the glove with the hidden effect is moving:\n  {page}")
    say("  Compare shows where its model fails, Diagnose names what is missing and adds it by a button,")
    say("  Error fall shows what that saved, and Live how the hand moves with it.")
    say(f"  Elsewhere: export GLOVECAL_URL={place.url} GLOVECAL_ZENOH={place.zenoh}; glovecal watch {GLOVE}")
    say("Ctrl-C here stops it and removes its data.")
    take = hidden.live(motion_s).take
    table = place.folder / "stay.csv"
    write_takes([take], table)
    if has_display():
        webbrowser.open(page)
    try:
        while True:
            with running_capture(
                place,
                device=f"replay:{table}",
                glove=GLOVE,
                subject=found.subject,
                wearing=take.wearing,
                options={"layout": found.layout, "loop": "yes"},
            ) as capture:
                while (code := capture.poll()) is None:  # a wait without end hears no Ctrl-C on Windows
                    time.sleep(LOOK_S)
            say(f"The glove's capture ended (code {code}) and is started again.")
            time.sleep(CAPTURE_AGAIN_S)
    except KeyboardInterrupt:
        say("Stopping.")
