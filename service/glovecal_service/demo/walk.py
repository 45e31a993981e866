"""The demo's walk: serve, record the sampling takes, train, activate, stream a second wearing, compare."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from glovecal_client.errors import ServiceError
from glovecal_client.rest import RestClient
from glovecal_service.cli.record import finish_recording
from glovecal_service.demo.live import PoseMeter, metered_poses
from glovecal_service.demo.processes import DemoPlace, running_capture

SUBJECT, GLOVE, SITE, LAYOUT = "demo-subject", "demo-right", "lab", "cyberglove18"
FREE_MOTION_S = 7.0
SAMPLING = ("key_poses", "cross_couple", "thumb", "wrist", "free")
METHODS = ("raw", "linear", "lmc_gpr", "spgp")
SERVED = "lmc_gpr"
CAPTURE_PATIENCE_S = 120.0
Say = Callable[[str], None]


@dataclass
class Walk:
    """What the demo found out."""

    models: dict[str, str] = field(default_factory=dict)
    training_s: dict[str, float] = field(default_factory=dict)
    held_out_deg: dict[str, float] = field(default_factory=dict)
    comparisons: dict[str, dict[str, Any]] = field(default_factory=dict)
    sampled_frames: int = 0
    sampled_s: float = 0.0
    recording: dict[str, Any] = field(default_factory=dict)
    meter: PoseMeter = field(default_factory=PoseMeter)
    sent: int = 0


def walk(service: RestClient, place: DemoPlace, seed: int, say: Say) -> Walk:
    """The whole walk on a running service."""
    found = Walk()
    service.post("/subjects", {"name": SUBJECT, "title": "Simulated subject"})
    say(f"Subject {SUBJECT} puts on a simulated CyberGlove (18 sensors, seed {seed}).")
    takes = [_record(service, place, motion, "first", seed, say, found) for motion in SAMPLING]
    found.sampled_frames = sum(take["frames"] for take in takes)
    found.sampled_s = sum(take["duration_s"] for take in takes)
    for method in METHODS:
        _train(service, method, [take["id"] for take in takes], found, say)
    service.post(f"/models/{found.models[SERVED]}/activate")
    say(f"Model {found.models[SERVED][:12]} ({SERVED}) is active. The glove is taken off and put on again.")
    with metered_poses(place.zenoh, SITE, GLOVE) as meter:
        found.meter = meter
        test = _record(service, place, "evaluation", "second", seed, say, found)
    found.recording = test["accounting"]
    for method, model in found.models.items():
        found.comparisons[method] = service.post(f"/models/{model}/compare", {"takes": [test["id"]]})
    return found


def _record(
    service: RestClient, place: DemoPlace, motion: str, wearing: str, seed: int, say: Say, found: Walk
) -> dict[str, Any]:
    """One motion as a take with its reference attached."""
    reference = place.folder / f"{wearing}-{motion}.reference.csv"
    options = {
        "seed": str(seed),
        "motion": motion,
        "wearing": "0" if wearing == "first" else "1",
        "reference": str(reference),
    }
    if motion == "free":
        options["duration"] = str(FREE_MOTION_S)  # it has no end of its own
    if motion == "evaluation":
        options["reference_noise_deg"] = "0"  # the simulated hand's truth itself
    wanted = {"glove": GLOVE, "name": f"{wearing}-{motion}", "subject": SUBJECT, "wearing": wearing}
    recording = service.post("/recordings", wanted) if _is_seen(service) else None
    with running_capture(place, glove=GLOVE, subject=SUBJECT, wearing=wearing, options=options) as capture:
        if recording is None:
            _wait_until_seen(service)
            recording = service.post("/recordings", wanted)
        capture.wait(CAPTURE_PATIENCE_S)
        finished = finish_recording(service, recording["id"])
    take = service.attach_reference(finished["facts"]["take"], reference)
    say(
        f"  take {take['name']}: {take['frames']} frames in {take['duration_s']:.1f} s, "
        f"{len(finished['facts']['missing'])} gaps, {len(take['rotations'])} rotations measured"
    )
    return take


def _is_seen(service: RestClient) -> bool:
    return any(glove["name"] == GLOVE for glove in service.get("/gloves")["seen"])


def _wait_until_seen(service: RestClient) -> None:
    until = time.monotonic() + 20
    while not _is_seen(service):
        if time.monotonic() > until:
            raise ServiceError(504, "No glove", f"the service did not see glove {GLOVE} within 20 s")
        time.sleep(0.05)


def _train(service: RestClient, method: str, takes: list[str], found: Walk, say: Say) -> None:
    started = time.monotonic()
    body = {"subject": SUBJECT, "layout": LAYOUT, "method": method, "takes": takes, "activate": False}
    job = service.wait_for_job(service.post("/models/train", body)["id"])
    result = job["result"]
    found.models[method] = result["model"]
    found.training_s[method] = time.monotonic() - started
    found.held_out_deg[method] = result["held_out_rmse_deg"]
    say(
        f"  trained {method} in {found.training_s[method]:.1f} s, "
        f"error on left-out takes {found.held_out_deg[method]:.2f} degrees"
    )
