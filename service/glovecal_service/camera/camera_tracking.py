"""One camera from its start to its end: pictures are labelled, the hand is tracked, poses go out.

The newest picture wins; every picture read is tracked, without a hand, unusable, stamped twice, skipped or
waiting, and the counts say which.
"""

from __future__ import annotations

import secrets
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from glovecal_client.capture.status import CaptureStatus
from glovecal_client.clock import clock_ns, computer_id, wall_ns
from glovecal_client.encryption.key_file import settle_encryption
from glovecal_client.errors import CaptureRefused
from glovecal_client.pictures.source import PictureSource
from glovecal_client.wire.pose import Pose, PoseFlag, RotationFlag, encode_pose
from glovecal_models.colour_glove.hand_state import FINGER_ROTATIONS, STAGES, PoseEstimate
from glovecal_models.colour_glove.pictures.picture_check import shadowed
from glovecal_models.colour_glove.pose.both_ways import Follows
from glovecal_models.errors import BadInput, Cancelled
from glovecal_models.hand.skeleton import skeleton_document
from glovecal_models.names import did_you_mean
from glovecal_service.camera.camera_link import HAND, NO_HAND, CameraAnswers, CameraHealth, CameraLink
from glovecal_service.camera.camera_settings import CameraSettings
from glovecal_service.camera.drawn_view import SeenPicture, drawn_view
from glovecal_service.camera.picture_reader import KeptPictures, NewestPicture, NumberedPicture, PictureReader
from glovecal_service.camera.tracking_setup import CameraLight, TrackingSetup, tracking_setup
from glovecal_service.jobs.time_left import TimeLeft
from glovecal_service.plain import reason_of

TURN_S = 0.1
STATUS_EVERY_S = 1.0
CHECK_EVERY_S = 0.2
STALE_AFTER_S, STALE_AGAIN_S = 0.5, 1.0
"""As of a glove that is silent."""
COMMANDS = {
    "stage": f"how far each picture is followed: {', '.join(STAGES)}",
    "balance": "tell the light's gains from the last pictures of the glove",
    "stop": "end this camera",
}


@dataclass(frozen=True)
class CameraSummary:
    """What a run came to."""

    run_id: int
    pictures: int
    tracked: int
    without_hand: int
    skipped: int
    unusable: int
    stamped_twice: int
    dropped: int
    reconnects: int
    kept: str
    sentence: str

    def __str__(self) -> str:
        return (
            f"run {self.run_id:016x}: {self.pictures} pictures, {self.tracked} tracked, "
            f"{self.without_hand} without a hand, {self.skipped} skipped, {self.unusable} unusable, "
            f"{self.stamped_twice} stamped twice, {self.dropped} dropped by the camera, "
            f"{self.reconnects} reconnects; {self.kept}; {self.sentence}"
        )


class CameraTracking:
    """``run`` returns when it is told to stop, or a file is over."""

    def __init__(self, settings: CameraSettings, report: Callable[[str], None]) -> None:
        self.health = CameraHealth()
        self._settings, self._report = settings, report
        self._run_id = secrets.randbits(64)
        self._status = CaptureStatus(self._run_id, wall_ns(), clock_ns())
        self._newest = NewestPicture()
        settle_encryption(settings.data)
        self._kept = KeptPictures(settings.keep, settings.folder / "kept", settings.glove)
        self._stop = threading.Event()
        self._stage = settings.stage
        self._setup: TrackingSetup | None = None
        self._source: PictureSource | None = None
        self._tracker: Follows | None = None
        self._reader: PictureReader | None = None
        self._seen: SeenPicture | None = None
        self._light = CameraLight()
        self._last: Pose | None = None
        self._last_s = self._stale_s = self._status_s = self._checked_s = 0.0
        self._no_pose = 0
        self._preparing, self._percent = TimeLeft(0.0), -1

    def run(self, stop: threading.Event, source: PictureSource | None = None) -> CameraSummary:
        """``source``: in place of the one that the settings name. Raises BadInput, DeviceError,
        CaptureRefused."""
        self._stop = stop
        answers = CameraAnswers(
            self._status_document, self._meta, self._pose_meta, self._command, self._picture
        )
        run = (self._status.started_wall_ns, self._run_id)
        settings = self._settings
        self._link = CameraLink(settings.keys, settings.zenoh, run, answers, self._report)
        self._link.start()
        try:
            self._prepare(source)
            self._track_until_stopped()
        except Cancelled:
            pass
        except Exception as error:
            self._end(reason_of(error))
            raise
        self._end("stopped" if stop.is_set() else self._status.sentence)
        return self._summary()

    def _prepare(self, source: PictureSource | None) -> None:
        self._change("opening", "preparing the hand, its pattern and the pose database")
        pictures = [self._settings.source if source is None else source]
        setup = tracking_setup(self._settings, pictures, self._say_progress, self._stop.is_set)
        source = setup.sources[0]
        self._tracker = setup.tracker(self._stage)
        self._change("opening", "compiling, once a computer")
        setup.tracker(self._stage).track([setup.example()], 0.0)
        self._setup, self._source = setup, source
        if not setup.is_calibrated:
            self._report(
                "The camera is not calibrated: focal length and distortion are assumed, so that distance is "
                "wrong by as much as they are; glovecal camera calibrate measures them."
            )
        self._report(f"Kept: {_KEPT[self._settings.keep]}.")
        self._reader = PictureReader(source, self._newest, self._kept, self._status, self._status_changed)
        self._link.publish_metas()
        self._reader.start()

    def _track_until_stopped(self) -> None:
        while not self._stop.is_set():
            if self._link.refusal:
                raise CaptureRefused(self._link.refusal)
            taken = self._newest.take(TURN_S)
            if taken is not None:
                self._take(taken)
            elif self._newest.is_over:
                return
            now = time.monotonic()
            self._repeat_stale(now)
            if now - self._status_s >= STATUS_EVERY_S:
                self._status_s = now
                self._status.disk_problem = self._kept.problem or None
                self._link.publish_status()

    def _take(self, taken: NumberedPicture) -> None:
        assert self._setup is not None
        assert self._source is not None
        assert self._tracker is not None
        began = time.perf_counter()
        pixels, tracker = taken.picture.pixels, self._tracker
        try:
            pixels = self._setup.seen(pixels)
            labels = self._light.labels(pixels, self._setup)
            self._kept.keep_labels(labels, self._source, taken.picture.monotonic_ns, taken.picture.wall_ns)
            self._check(pixels, labels)
            estimate = tracker.track([labels], taken.monotonic_ns / 1e9)
            if estimate is not None and self.health.present:
                estimate = replace(estimate, accepted=np.zeros_like(estimate.accepted))
        except (BadInput, ArithmeticError, ValueError, np.linalg.LinAlgError) as error:
            self.health.note_unusable(reason_of(error))
            self._no_pose += 1
            return
        shown = None if pixels.ndim == 2 else pixels
        self._seen = SeenPicture(taken.number, shown, labels, estimate, self._source.simulated)
        if estimate is None:
            self.health.note_no_hand()
            self._no_pose += 1
            return
        spent_ms = 1000 * (time.perf_counter() - began)
        latency_ms = self._publish(taken, estimate)
        self.health.note_pose(estimate, latency_ms, spent_ms)

    def _check(self, pixels: np.ndarray, labels: np.ndarray) -> None:
        """Now and then: it takes as long as looking the hand up."""
        assert self._setup is not None
        now = time.monotonic()
        if pixels.ndim != 3 or now - self._checked_s < CHECK_EVERY_S:
            return
        self._checked_s = now
        found = self._setup.check.findings(pixels, labels)
        self.health.note_findings({each.kind: each.sentence for each in found})
        self.health.note_light(shadowed(pixels, labels))

    def _publish(self, taken: NumberedPicture, estimate: PoseEstimate) -> float:
        """Latency in milliseconds, from the picture's stamp until the pose was handed to the network."""
        assert self._setup is not None
        assert self._source is not None
        flags = PoseFlag.SIMULATED if self._source.simulated else PoseFlag(0)
        if not estimate.accepted.all():
            flags |= PoseFlag.TOO_UNCERTAIN
        age_ns = max(0, clock_ns() - taken.monotonic_ns)
        pose = Pose(
            taken.number, self._run_id, taken.monotonic_ns, taken.wall_ns,
            degrees=estimate.state.angles_deg.astype(np.float32),
            deviations=estimate.standard_deviation[: len(FINGER_ROTATIONS)].astype(np.float32),
            rotation_flags=np.where(estimate.accepted, 0, int(RotationFlag.TOO_UNCERTAIN)).astype(np.uint8),
            model_sha256=self._setup.name(estimate.stage),
            flags=int(flags),
            skipped=(self._newest.skipped + self._no_pose) % (1 << 64),
            age_us=min(age_ns // 1000, (1 << 32) - 1),
        )  # fmt: skip
        self._link.publish_pose(encode_pose(pose))
        self._last, self._last_s = pose, time.monotonic()
        return (clock_ns() - taken.monotonic_ns) / 1e6

    def _repeat_stale(self, now: float) -> None:
        """Half a second after the last pose, and once a second from then on: that pose, marked."""
        if self._last is None or now - self._last_s < STALE_AFTER_S or now - self._stale_s < STALE_AGAIN_S:
            return
        self._stale_s = now
        self._link.publish_pose(encode_pose(replace(self._last, flags=self._last.flags | PoseFlag.STALE)))

    def _end(self, sentence: str) -> None:
        if self._reader and not self._reader.stop():
            sentence += "; the camera's driver hangs"
        self._newest.end()
        self._kept.close()
        self._ended_with = sentence
        self._change("stopped", sentence)
        self._link.close()

    def _command(self, name: str, argument: str) -> Mapping[str, Any]:
        if name == "stop":
            self._stop.set()
            return {"stopping": True}
        if name not in COMMANDS:
            raise BadInput(f"a camera has no command {name!r}; {did_you_mean(name, COMMANDS)}")
        if self._setup is None:
            raise BadInput(f"the camera is not ready yet: {self._status.sentence}")
        return self._balance(self._setup) if name == "balance" else self._choose_stage(self._setup, argument)

    def _balance(self, setup: TrackingSetup) -> dict[str, Any]:
        found = self._light.balance(setup, own_colours=self._settings.colours is not None)
        self.health.forget_poses()
        self._link.publish_status()
        return found

    def _choose_stage(self, setup: TrackingSetup, argument: str) -> dict[str, Any]:
        self._tracker = setup.tracker(argument)
        self._stage = argument
        self._link.publish_metas()
        self._link.publish_status()
        return {"stage": argument}

    def _picture(self, asked: Mapping[str, str]) -> bytes:
        seen, setup = self._seen, self._setup
        if seen is None or setup is None:
            raise BadInput(f"no picture yet: {self._status.sentence}")
        return drawn_view(seen, setup.hand, setup.cameras[0], asked)

    def _say_progress(self, sentence: str, fraction: float) -> None:
        percent = round(100 * fraction)
        if percent == self._percent:
            return
        self._percent, seconds = percent, self._preparing.seconds(fraction)
        left = "" if seconds is None else f", about {max(1, round(seconds))} s left"
        self._change("opening", f"{sentence}, {percent} %{left}")

    def _change(self, state: str, sentence: str) -> None:
        if self._status.change(state, sentence):  # type: ignore[arg-type]
            self._status_changed()

    def _status_changed(self) -> None:
        self._report(self._status.sentence)
        self._link.publish_status()

    def _status_document(self) -> dict[str, Any]:
        """As a capture daemon's, with what is a camera's own under ``camera``."""
        health, settings = self.health.document(), self._settings
        status = self._status.document()
        if status["state"] == "streaming" and health["sees"] in (NO_HAND, HAND):
            status["sentence"] = self._kept.problem or health["problem"] or _view(health)
        missing = 0 if self._reader is None else self._reader.missing.dropped
        status["bad_frames"] = health["unusable"]
        camera = {
            "source": settings.source,
            "simulated": self._is_simulated,
            "stage": self._stage,
            "stages": list(STAGES),
            "pictures": self._status.frames,
            "skipped": self._newest.skipped,
            "waiting": self._newest.waiting,
            "stamped_twice": self._status.duplicates,
            "dropped": missing,
            "reconnects": self._status.reconnects,
            "gains": asdict(self._light.gains),
            "calibrated": self._setup is not None and self._setup.is_calibrated,
            "kept": settings.keep,
            "kept_pictures": self._kept.pictures,
            "not_kept": self._kept.failed,
            "kept_file": None if self._kept.file is None else self._kept.file.name,
            "kept_problem": self._kept.problem,
            **health,
        }
        return {**status, "camera": camera}

    def _meta(self) -> dict[str, Any]:
        settings = self._settings
        return {
            "site": settings.site,
            "glove": settings.glove,
            "device": f"camera {settings.source}",
            "layout": None,
            "sensors": [],
            "context": [],
            "subject": settings.subject,
            "wearing": None,
            "hand": settings.hand,
            "simulated": self._is_simulated,
            "rate_hz": 0.0 if self._source is None else self._source.rate_hz,
            "computer": computer_id(),
            "commands": COMMANDS,
            "makes_poses": True,
            "run_id": f"{self._run_id:016x}",
            "started_wall_ns": self._status.started_wall_ns,
            "software": f"glovecal-service {metadata.version('glovecal-service')}",
        }

    def _pose_meta(self) -> dict[str, Any]:
        """As the service's for a calibrated glove; ``model`` names what the poses are made with."""
        settings, setup = self._settings, self._setup
        return {
            "glove": settings.glove,
            "state": "uncalibrated" if setup is None else "calibrated",
            "sentence": self._status.sentence if setup is None else "",
            "subject": settings.subject,
            "wearing": None,
            "layout": None,
            "run_id": f"{self._run_id:016x}",
            "glove_latency_s": None,
            "glove_latency_sd_s": None,
            "delay_ms": 0,
            "model": None if setup is None else setup.name(self._stage),
            "method": f"colour_glove_{self._stage}",
            "model_simulated": False,
            "effects": [],
            "rotations": [] if setup is None else list(FINGER_ROTATIONS),
            "hand": settings.hand,
            "skeleton": None if setup is None else skeleton_document(setup.hand.skin.skeleton),
        }

    @property
    def _is_simulated(self) -> bool:
        return self._settings.source == "rendered" or bool(self._source and self._source.simulated)

    def _summary(self) -> CameraSummary:
        health, kept = self.health, self._kept
        what = f"kept {_KEPT[kept.keep]}"
        if kept.keep != "nothing":
            what += f": {kept.pictures} in {kept.file or Path('no file')}"
        if kept.failed:
            what += f", {kept.failed} could not be kept ({kept.problem})"
        return CameraSummary(
            self._run_id, self._status.frames, health.tracked, health.without_hand, self._newest.skipped,
            health.unusable, self._status.duplicates,
            0 if self._reader is None else self._reader.missing.dropped,
            self._status.reconnects, what, self._ended_with,
        )  # fmt: skip


_KEPT = {
    "pictures": "every picture as it came (FFV1)",
    "labels": "the labels of every picture tracked, no picture",
    "nothing": "nothing of the pictures",
}


def _view(health: Mapping[str, Any]) -> str:
    if health["findings"]:
        return " ".join(health["findings"].values())
    if health["sees"] != HAND:
        return "no hand in view"
    return " ".join(["the hand is tracked", *(["but", health["advice"]] if health["advice"] else [])])
