"""The demo's walk: serve, record the sampling takes, train, activate, stream a second wearing, compare.

Live poses are listened to: how old they are when they arrive, and whether any is missing. The result is a
table like Wang & Neff 2013, Table 3, and the JSON contract.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import zenoh
from rich.table import Table

from glovecal_client.clock import clock_ns
from glovecal_client.errors import ServiceError, WireError
from glovecal_client.keys import GloveKeys
from glovecal_client.pose_subscriber import PoseCounts, PoseOrder
from glovecal_client.rest import RestClient
from glovecal_client.session import open_client
from glovecal_client.wire.pose import Pose, decode_pose
from glovecal_models.comparison.answer import Comparison
from glovecal_service.demo.processes import DemoPlace, running_capture
from glovecal_service.plain import read
from glovecal_service.questions.comparison import COMPARE
from glovecal_service.questions.train import TRAIN
from glovecal_service.rest.glove.answer import Gloves, Recording
from glovecal_service.rest.job.answer import Job, JobFacts
from glovecal_service.rest.take.answer import Take


class PoseMeter:
    """Takes every pose of a glove and notes when it came.

    Frame times are CLOCK_MONOTONIC of the capture daemon, so latency is true on one computer only.
    """

    def __init__(self) -> None:
        self._order = PoseOrder()
        self._latency_ns: list[int] = []
        self._calibrated = 0
        self._run_id = 0
        self._skipped = 0
        self.poses: list[Pose] = []
        """All that came, each frame's once."""

    def hear(self, sample: zenoh.Sample) -> None:
        now = clock_ns()
        try:
            pose: Pose = decode_pose(sample.payload.to_bytes())
        except WireError:
            self._order.note_damage()
            return
        if self._order.accept(pose) and not pose.stale:
            self._count_skipped(pose)
            self._latency_ns.append(now - pose.monotonic_ns)
            self.poses.append(pose)
            self._calibrated += not pose.uncalibrated

    @property
    def counts(self) -> PoseCounts:
        return self._order.counts()

    def _count_skipped(self, pose: Pose) -> None:
        """The service counts from the start of a run; the first frames may have been skipped already."""
        if pose.run_id != self._run_id:
            self._run_id, self._skipped = pose.run_id, 0
        self._skipped = max(self._skipped, pose.skipped)

    @property
    def skipped(self) -> int:
        """Frames of the newest run that the service left out to stay current."""
        return self._skipped

    @property
    def calibrated(self) -> int:
        """Poses that came from a calibration model."""
        return self._calibrated

    def latency_ms(self, percent: float) -> float:
        """A percentile of reading-to-pose latency, milliseconds; NaN before the first pose."""
        return float(np.percentile(self._latency_ns, percent)) / 1e6 if self._latency_ns else float("nan")


@contextmanager
def metered_poses(endpoint: str, site: str, glove: str) -> Iterator[PoseMeter]:
    """A meter that listens until the end of the block."""
    meter = PoseMeter()
    with open_client([endpoint], wait_s=10) as session:
        handler = zenoh.handlers.Callback(meter.hear, indirect=False)
        subscriber = session.declare_subscriber(GloveKeys(site, glove).pose, handler)
        try:
            yield meter
        finally:
            subscriber.undeclare()


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
    comparisons: dict[str, Comparison] = field(default_factory=dict)
    sampled_frames: int = 0
    sampled_s: float = 0.0
    meter: PoseMeter = field(default_factory=PoseMeter)
    sent: int = 0


def walk(service: RestClient, place: DemoPlace, seed: int, say: Say, plan: WalkPlan | None = None) -> Walk:
    """The whole walk on a running service."""
    plan = plan or WalkPlan()
    found, served = Walk(), plan.before[-1]
    service.post("/subjects", {"name": SUBJECT, "title": "Simulated subject"})
    say(f"Subject {SUBJECT} puts on a simulated CyberGlove (18 sensors, seed {seed}).")
    takes = [_record(service, place, motion, "first", seed, say, found) for motion in plan.sampling]
    found.sampled_frames = sum(take.frames for take in takes)
    found.sampled_s = sum(take.duration_s for take in takes)
    ids = [take.id for take in takes]
    for method in plan.before:
        _finish_training(service, method, _start_training(service, method, ids), found, say)
    service.post(f"/models/{found.models[served]}/activate")
    trains_on = f"; {plan.meanwhile} is training in the background" if plan.meanwhile else ""
    say(f"Model {found.models[served][:12]} ({served}) is active{trains_on}.")
    meanwhile = _start_training(service, plan.meanwhile, ids) if plan.meanwhile else None
    say("The glove is taken off and put on again.")
    with metered_poses(place.zenoh, SITE, GLOVE) as meter:
        found.meter = meter
        test = _record(service, place, plan.test, "second", seed, say, found)
    found.sent = test.sent or 0
    if plan.meanwhile and meanwhile:
        _finish_training(service, plan.meanwhile, meanwhile, found, say)
    for method, model in found.models.items():
        answer = service.post(f"/models/{model}/compare", {"takes": [test.id]})
        found.comparisons[method] = COMPARE.read(answer)
    return found


def _record(
    service: RestClient, place: DemoPlace, motion: str, wearing: str, seed: int, say: Say, found: Walk
) -> Take:
    """One motion as a take with its reference attached."""
    reference = place.folder / f"{wearing}-{motion}.reference.csv"
    options = {
        "seed": str(seed),
        "motion": motion,
        "wearing": "0" if wearing == "first" else "1",
        "reference": str(reference),
    }
    if motion == "free":
        options |= {"duration": str(FREE_MOTION_S)}  # it has no end of its own
    if wearing == "second":
        options |= {"reference_noise_deg": "0"}  # the simulated hand's truth itself
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
        begun = read(Recording, recording)
        account = read(Recording, service.finish_recording(begun.id)).account
    take = read(Take, service.attach_reference(account.take or "", reference))
    say(
        f"  take {take.name}: {take.frames} frames in {take.duration_s:.1f} s, "
        f"{account.repaired} fetched from the capture log, "
        f"{len(account.missing)} gaps, {len(take.rotations)} rotations measured"
    )
    return take


def _is_seen(service: RestClient) -> bool:
    return any(glove.name == GLOVE for glove in read(Gloves, service.get("/gloves")).seen)


def _wait_until_seen(service: RestClient) -> None:
    until = time.monotonic() + CAPTURE_PATIENCE_S
    while not _is_seen(service):
        if time.monotonic() > until:
            sentence = f"the service did not see glove {GLOVE} within {CAPTURE_PATIENCE_S:.0f} s"
            raise ServiceError(504, "No glove", sentence)
        time.sleep(0.05)


def _start_training(service: RestClient, method: str, takes: list[str]) -> str:
    """The job."""
    body = {"subject": SUBJECT, "layout": LAYOUT, "method": method, "takes": takes, "activate": False}
    return read(JobFacts, service.post("/models/train", body | QUICK_TRAINING)).id


def _finish_training(service: RestClient, method: str, begun: str, found: Walk, say: Say) -> None:
    job = read(Job, service.wait_for_job(begun))
    found.models[method] = TRAIN.read(job.result).model
    say(f"  trained {method} in {job.took_s:.1f} s")


HEADINGS = {"raw": "raw", "linear": "linear", "lmc_gpr": "LMC-GPR", "spgp": "SPGP 100"}


def error_table(found: Walk) -> Table:
    """Mean and standard deviation of the absolute error over all rotations, per pose and over all."""
    table = Table(title="Error in degrees, second wearing (not used for training)", box=None, pad_edge=False)
    table.add_column("pose")
    for method in found.models:
        table.add_column(HEADINGS[method], justify="right")
    by_pose = {
        method: {item.pose: item for item in found.comparisons[method].poses} for method in found.models
    }
    for pose in by_pose[next(iter(found.models))]:
        cells = (by_pose[method][pose] for method in found.models)
        table.add_row(pose, *(f"{cell.mean_deg:.1f} ± {cell.sd_deg:.1f}" for cell in cells))
    rmse = rmse_deg(found)
    table.add_row("all frames, RMSE", *(f"{rmse[method]:.2f}" for method in found.models), style="bold")
    return table


def rmse_deg(found: Walk) -> dict[str, float]:
    """Root mean square error of each method over all rotations and frames of the second wearing."""
    return {method: found.comparisons[method].rmse_deg for method in found.models}


def sentences(found: Walk) -> list[str]:
    """What the figures say, with a scale for each."""
    rmse, received, skipped = rmse_deg(found), found.meter.counts.received, found.meter.skipped
    spread = found.comparisons["linear"].overall.baseline_deg
    median, late = found.meter.latency_ms(50), found.meter.latency_ms(99)
    return [
        f"Scale: the error when predicting the mean is {spread:.1f} degrees; sensor noise and 8-bit steps "
        "are about 1 degree.",
        f"Error ratios: LMC-GPR to linear {rmse['lmc_gpr'] / rmse['linear']:.2f}, SPGP to LMC-GPR "
        f"{rmse['spgp'] / rmse['lmc_gpr']:.2f}.",
        f"Live: reading to pose {median:.2f} ms (median), {late:.2f} ms (99th percentile) through two zenoh "
        "hops; frame period 8.3 ms at 120 Hz.",
        f"Frames: {found.sent} sent, {received} poses received, {skipped} skipped by the service, "
        f"{found.sent - received - skipped} lost.",
    ]


def contract(found: Walk) -> dict[str, Any]:
    """The JSON of ``glovecal demo --json``."""
    meter = found.meter
    return {
        "rmse_deg": {method: round(value, 4) for method, value in rmse_deg(found).items()},
        "latency_ms": {
            "p50": round(found.meter.latency_ms(50), 4),
            "p99": round(found.meter.latency_ms(99), 4),
        },
        "frames": {
            "sent": found.sent,
            "received": meter.counts.received,
            "skipped": meter.skipped,
        },
    }
