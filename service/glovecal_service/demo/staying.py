"""The demo's end for those who stay: its second glove goes on moving, and the story is theirs to repeat.

The model of the second act is live: one more take of the hidden glove goes through capture and zenoh.
"""

from __future__ import annotations

import os
import sys
import time
import webbrowser
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from glovecal_client.rest import RestClient
from glovecal_client.wire.pose import Pose, PoseFlag
from glovecal_models.simulation.session import RecordedTake
from glovecal_models.takes.write_table import write_takes
from glovecal_service.demo.processes import DemoPlace, running_capture
from glovecal_service.demo.second_act import DIAGNOSED, Findings
from glovecal_service.demo.walk import CAPTURE_PATIENCE_S, SITE, metered_poses
from glovecal_service.first_run.hidden_session import HiddenSession
from glovecal_service.operating_system import has_display
from glovecal_service.plain import read
from glovecal_service.rest.model.answer import ModelInFull

GLOVE = "demo-hidden"


@dataclass(frozen=True)
class LiveFigures:
    """What came, and how far it was from what the hand really did."""

    sent: int
    uncalibrated: int
    """Poses before the service had the model ready for this glove."""
    poses: int
    """From the model in question."""
    settled: int
    """Of these, with all effects knowing enough of the past."""
    rmse_deg: float
    """Over all of these poses; NaN without any."""
    settled_rmse_deg: float
    """Over settled ones; NaN without any."""


def live_child(service: RestClient, place: DemoPlace, recorded: RecordedTake, found: Findings) -> LiveFigures:
    """Stream ``recorded`` at its own pace while the walk's last model is active."""
    take = recorded.take
    table = place.folder / "live.csv"
    write_takes([take], table)
    with metered_poses(place.zenoh, SITE, GLOVE) as meter:
        with running_capture(
            place,
            device=f"replay:{table}",
            glove=GLOVE,
            subject=found.subject,
            wearing=take.wearing,
            options={"layout": found.layout},
        ) as capture:
            capture.wait(CAPTURE_PATIENCE_S)
        made = [pose for pose in meter.poses if pose.model_sha256 == found.served]
        uncalibrated = sum(pose.uncalibrated for pose in meter.poses)
    served = read(ModelInFull, service.get(f"/models/{found.served}"))
    rotations = [item.rotation for item in served.rotations]
    columns = [take.rotations.index(name) for name in rotations]
    return _figures(made, columns, recorded.truth, uncalibrated)


def _figures(made: list[Pose], columns: list[int], truth: np.ndarray, uncalibrated: int) -> LiveFigures:
    """A pose belongs to the frame of its sequence number, whenever it was sent."""
    made = [pose for pose in made if pose.sequence < len(truth)]
    settled = [pose for pose in made if not pose.flags & PoseFlag.SETTLING]

    def rmse(poses: list[Pose]) -> float:
        errors = [pose.degrees - truth[pose.sequence, columns] for pose in poses]
        return float(np.sqrt(np.nanmean(np.square(errors)))) if errors else float("nan")

    return LiveFigures(len(truth), uncalibrated, len(made), len(settled), rmse(made), rmse(settled))


def live_sentence(live: LiveFigures) -> str:
    """One sentence for people."""
    start = f"Live: {live.sent} frames of one more take streamed"
    if live.uncalibrated:
        start += f"; {live.uncalibrated} poses while the service loaded the model, then"
    else:
        start += ";"
    start += f" {live.poses} poses from it"
    if not live.poses:
        return f"{start}."
    start += f", {live.rmse_deg:.2f} degrees from what the hand really did"
    if not live.settled:
        return f"{start}; all are flagged settling, because the effect remembers longer than this take."
    if live.settled == live.poses:
        return f"{start}."
    return f"{start}; {live.settled} of them are past settling, {live.settled_rmse_deg:.2f} degrees from it."


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
