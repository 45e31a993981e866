"""The model of the second act, live: one more take of the hidden glove through capture, zenoh and service."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from glovecal_client.rest import RestClient
from glovecal_client.wire.pose import Pose, PoseFlag
from glovecal_models.simulation.session import RecordedTake
from glovecal_models.takes.write_table import write_takes
from glovecal_service.demo.live import metered_poses
from glovecal_service.demo.processes import DemoPlace, running_capture
from glovecal_service.demo.second_act import Findings
from glovecal_service.demo.walk import CAPTURE_PATIENCE_S, SITE

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
    rotations = [item["rotation"] for item in service.get(f"/models/{found.served}")["rotations"]]
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
