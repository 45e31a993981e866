"""The demo's walk: serve, record the sampling takes, train, activate, stream a second wearing, compare."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from glovecal_client.errors import ServiceError
from glovecal_client.rest import RestClient
from glovecal_service.demo.live import PoseMeter, metered_poses
from glovecal_service.demo.processes import DemoPlace, running_capture

SUBJECT, GLOVE, SITE, LAYOUT = "demo-subject", "demo-right", "lab", "cyberglove18"
FREE_MOTION_S = 5.0
QUICK_TRAINING = {"samples": 1000, "folds": 0, "iterations": 100}
"""Half the samples and rounds of a usual training, and no error estimate: the second wearing will show the
error."""
CAPTURE_PATIENCE_S = 120.0
Say = Callable[[str], None]


@dataclass(frozen=True)
class WalkPlan:
    """What is recorded and trained."""

    sampling: tuple[str, ...] = ("key_poses", "cross_couple", "thumb", "wrist", "free")
    test: str = "evaluation"
    """The motion of the second wearing."""
    before: tuple[str, ...] = ("raw", "linear", "lmc_gpr")
    """What is trained before the second wearing; the last is served."""
    meanwhile: str | None = "spgp"
    """What is trained during it: prediction does not wait for training."""


SMOKE = WalkPlan(sampling=("free",), test="free", before=("raw", "linear"), meanwhile=None)
"""Both motions of a few seconds, and nothing that needs training processes."""


@dataclass
class Walk:
    """What the demo found out."""

    models: dict[str, str] = field(default_factory=dict)
    comparisons: dict[str, dict[str, Any]] = field(default_factory=dict)
    sampled_frames: int = 0
    sampled_s: float = 0.0
    recording: dict[str, Any] = field(default_factory=dict)
    meter: PoseMeter = field(default_factory=PoseMeter)
    sent: int = 0


def walk(service: RestClient, place: DemoPlace, seed: int, say: Say, plan: WalkPlan | None = None) -> Walk:
    """The whole walk on a running service."""
    plan = plan or WalkPlan()
    found, served = Walk(), plan.before[-1]
    service.post("/subjects", {"name": SUBJECT, "title": "Simulated subject"})
    say(f"Subject {SUBJECT} puts on a simulated CyberGlove (18 sensors, seed {seed}).")
    takes = [_record(service, place, motion, "first", seed, say, found) for motion in plan.sampling]
    found.sampled_frames = sum(take["frames"] for take in takes)
    found.sampled_s = sum(take["duration_s"] for take in takes)
    ids = [take["id"] for take in takes]
    for method in plan.before:
        _finish_training(service, _start_training(service, method, ids), found, say)
    service.post(f"/models/{found.models[served]}/activate")
    trains_on = f"; {plan.meanwhile} is training in the background" if plan.meanwhile else ""
    say(f"Model {found.models[served][:12]} ({served}) is active{trains_on}.")
    meanwhile = _start_training(service, plan.meanwhile, ids) if plan.meanwhile else None
    say("The glove is taken off and put on again.")
    with metered_poses(place.zenoh, SITE, GLOVE) as meter:
        found.meter = meter
        test = _record(service, place, plan.test, "second", seed, say, found)
    found.recording = test["accounting"]
    if meanwhile is not None:
        _finish_training(service, meanwhile, found, say)
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
    if wearing == "second":
        options["reference_noise_deg"] = "0"  # the simulated hand's truth itself
    # each motion is a run of its own, and nothing in this glove remembers: no pre-roll
    wanted = {
        "glove": GLOVE,
        "name": f"{wearing}-{motion}",
        "subject": SUBJECT,
        "wearing": wearing,
        "lead_s": 0,
    }
    recording = service.post("/recordings", wanted) if _is_seen(service) else None
    with running_capture(place, glove=GLOVE, subject=SUBJECT, wearing=wearing, options=options) as capture:
        if recording is None:
            _wait_until_seen(service)
            recording = service.post("/recordings", wanted)
        capture.wait(CAPTURE_PATIENCE_S)
        finished = service.finish_recording(recording["id"])
    take = service.attach_reference(finished["facts"]["take"], reference)
    say(
        f"  take {take['name']}: {take['frames']} frames in {take['duration_s']:.1f} s, "
        f"{finished['facts']['repaired']} fetched from the capture log, "
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


def _start_training(service: RestClient, method: str, takes: list[str]) -> dict[str, Any]:
    body = {"subject": SUBJECT, "layout": LAYOUT, "method": method, "takes": takes, "activate": False}
    return service.post("/models/train", body | QUICK_TRAINING)


def _finish_training(service: RestClient, job: dict[str, Any], found: Walk, say: Say) -> None:
    job = service.wait_for_job(job["id"])
    method = job["payload"]["method"]
    found.models[method] = job["result"]["model"]
    started, finished = (datetime.fromisoformat(job[name]) for name in ("started_at", "finished_at"))
    say(f"  trained {method} in {(finished - started).total_seconds():.1f} s")
