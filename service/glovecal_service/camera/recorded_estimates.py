"""Recordings of a hand become the estimates that a take's reference is made from: every frame, none skipped.

One video or label file, or those of two cameras before the same hand, whose frames are matched by their
times. What is broken is left out, counted and said; nothing is written before all is tracked.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from glovecal_client.errors import DeviceFinished, DeviceLost
from glovecal_client.pictures.label_file import SUFFIX as LABELS
from glovecal_client.pictures.label_file import LabelFilePictures, read_label_times
from glovecal_client.pictures.source import Picture, PictureSource
from glovecal_client.pictures.video_file import OF_COMPUTER, VideoFilePictures
from glovecal_client.pictures.video_file import SUFFIXES as VIDEOS
from glovecal_models.colour_glove.hand_state import PoseEstimate, camera_estimates
from glovecal_models.colour_glove.pictures.picture_check import light_advice, shadowed
from glovecal_models.colour_glove.pose.both_ways import Follows, followed_both_ways
from glovecal_models.colour_glove.pose.hand_shape_fit import (
    MEASURED_SIZE_SD,
    MOST_PICTURES,
    SIZE_SD,
    FittedShape,
    fitted_hand_shape,
)
from glovecal_models.errors import BadInput
from glovecal_models.progress import Cancel, Report, stop_if
from glovecal_models.takes.camera_estimates import MOST_FRAMES, CameraEstimates, without_repeats
from glovecal_service.camera.tracking_setup import TrackingSetup
from glovecal_service.plain import reason_of

CHECK_EVERY_S = 0.2
"""Of the recording: a check takes as long as looking the hand up, and counts until the next."""
NO_HAND = "no hand"


@dataclass(frozen=True)
class RecordingCount:
    """What became of one recording's frames; the rest was tracked."""

    name: str
    frames: int
    """That have a time."""
    stamped_twice: int
    """No later than one before."""
    unmatched: int
    """Without a frame of the other camera within half a frame's time."""
    unreadable: int
    """The file ends before them, or the other camera's does."""
    ended: str
    """How its end was met; empty where it is whole."""
    rate_hz: float
    """Of its frames, from the median of their intervals."""
    times: str
    """Where its frames' times come from."""


@dataclass(frozen=True, eq=False)
class TrackedRecordings:
    """Estimates, and what became of each frame."""

    estimates: CameraEstimates
    counts: tuple[RecordingCount, ...]
    without_hand: int
    unusable: int
    """That the tracker could not use."""
    problem: str
    """What was wrong with the last of them."""
    none_accepted: int
    """With a hand, of which no rotation was sure enough."""
    findings: dict[str, int]
    """Frames during which each thing was wrong with the view, such as two hands: no rotation is accepted."""
    took_s: float
    advice: str
    """What to change of the light; empty where nothing is."""


class Recordings:
    """Files whose frames have been matched, not yet tracked."""

    def __init__(self, files: Sequence[Path]) -> None:
        """Raises BadInput for files that cannot be tracked together, DeviceLost for one that is none."""
        if not 1 <= len(files) <= 2:
            raise BadInput(f"{len(files)} recordings; those of one camera or of two are tracked")
        if len({file.resolve() for file in files}) < len(files):
            raise BadInput(f"{files[0]} is named twice; two cameras have a recording each")
        self.sources = tuple(_source(file) for file in files)
        self.times_s = tuple(_times_s(source, file) for source, file in zip(self.sources, files, strict=True))
        if len(files) > 1:
            _require_one_clock(files, self.sources)
        later = [np.flatnonzero(without_repeats(times)) for times in self.times_s]
        self._usable = [len(rows) for rows in later]
        if len(later) > 1:
            first, second = matched(*(times[rows] for times, rows in zip(self.times_s, later, strict=True)))
            later = [later[0][first], later[1][second]]
        self.rows = tuple(later)
        """Of each file, the frames that are tracked; as many of each."""
        if not 0 < len(self.rows[0]) <= MOST_FRAMES:
            together = " that were taken at the same time by both cameras" if len(files) > 1 else ""
            raise BadInput(
                f"{' and '.join(file.name for file in files)}: {len(self.rows[0])} frames{together}; "
                f"1 to {MOST_FRAMES} are tracked"
            )

    def tracked(
        self, setup: TrackingSetup, stage: str, report: Report | None = None, cancelled: Cancel | None = None
    ) -> TrackedRecordings:
        """All of them, followed forwards and backwards. Raises BadInput where nothing can be read,
        Cancelled."""
        began, wanted = time.perf_counter(), len(self.rows[0])
        forwards, backwards = _Way(setup.tracker(stage)), _Way(setup.tracker(stage))
        poses: list[PoseEstimate | None] = []
        found, views, shadows = Counter[str](), list[tuple[str, ...]](), list[float]()
        at_s = np.mean([times[rows] for times, rows in zip(self.times_s, self.rows, strict=True)], axis=0)
        readers = [_Reader(source, rows) for source, rows in zip(self.sources, self.rows, strict=True)]

        def moments() -> Iterator[tuple[Sequence[np.ndarray], float]]:
            checked_s, present = -np.inf, ()
            for frame, pictures in enumerate(zip(*readers, strict=False)):
                stop_if(cancelled, "tracking the recording")
                labels: list[np.ndarray] = []
                try:
                    seen = [setup.seen(pixels, number) for number, pixels in enumerate(pictures)]
                    labels = [setup.labels(each) for each in seen]
                    if at_s[frame] - checked_s >= CHECK_EVERY_S:
                        checked_s, present = at_s[frame], _findings(setup, seen, labels)
                        shadows.extend(_shadows(seen, labels))
                except UNUSABLE as error:
                    forwards.note(float(at_s[frame]), error)
                views.append(present)
                if report is not None:
                    report(f"tracking: frame {frame + 1} of {wanted}", (frame + 1) / wanted)
                yield labels, float(at_s[frame])

        try:
            for pose, present in zip(followed_both_ways(forwards, backwards, moments()), views, strict=False):
                found.update(present)
                if pose is not None and present:
                    pose = replace(pose, accepted=np.zeros_like(pose.accepted))
                poses.append(pose)
            for reader in readers:
                reader.finish()
        finally:
            for source in self.sources:
                source.close()
        if not poses:
            raise BadInput(f"no frame can be read: {'; '.join(reader.ended for reader in readers)}")
        unusable = len(forwards.unusable)
        return TrackedRecordings(
            camera_estimates(at_s[: len(poses)], poses, simulated=any(s.simulated for s in self.sources)),
            tuple(self._count(number, len(poses), reader.ended) for number, reader in enumerate(readers)),
            sum(pose is None for pose in poses) - unusable, unusable, forwards.problem,
            sum(pose is not None and not pose.accepted.any() for pose in poses),
            dict(found), time.perf_counter() - began, light_advice(shadows),
        )  # fmt: skip

    def fitted_shape(
        self, setup: TrackingSetup, *, is_measured: bool, report: Report | None = None,
        cancelled: Cancel | None = None,
    ) -> FittedShape:  # fmt: skip
        """Of the hand in its glove, from moments spread over the whole recording. ``is_measured``: somebody
        measured the hand's length. Raises BadInput where no shape is sure, Cancelled."""
        size_sd = MEASURED_SIZE_SD if is_measured else SIZE_SD
        return fitted_hand_shape(
            setup.first, self._spread_labels(setup), size_sd=size_sd, report=report, cancelled=cancelled
        )

    def _spread_labels(self, setup: TrackingSetup) -> list[list[np.ndarray]]:
        """Label images of as many moments as a shape is fitted to, one of each camera."""
        frames = len(self.rows[0])
        wanted = np.unique(np.linspace(0, frames - 1, min(MOST_PICTURES, frames)).astype(int))
        readers = [
            _Reader(source, rows[wanted]) for source, rows in zip(self.sources, self.rows, strict=True)
        ]
        try:
            return [
                [setup.labels(setup.seen(pixels, number)) for number, pixels in enumerate(pictures)]
                for pictures in zip(*readers, strict=False)
            ]
        finally:
            for source in self.sources:
                source.close()

    def _count(self, number: int, tracked: int, ended: str) -> RecordingCount:
        times = self.times_s[number]
        matched_frames = len(self.rows[number])
        return RecordingCount(
            self.sources[number].name.partition(":")[2], len(times), len(times) - self._usable[number],
            self._usable[number] - matched_frames, matched_frames - tracked, ended, 1.0 / _interval_s(times),
            _whose_times(self.sources[number]),
        )  # fmt: skip


def matched(first_s: np.ndarray, second_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(P,) and (P,): rows of frames of two cameras that were taken together; both times increase.

    Each frame is the other's nearest, no farther than half the time between frames of the quicker camera.
    """
    if not len(first_s) or not len(second_s):
        return np.zeros((2, 0), dtype=int)[0], np.zeros(0, dtype=int)
    to_second, to_first = _nearest(first_s, second_s), _nearest(second_s, first_s)
    rows = np.flatnonzero(to_first[to_second] == np.arange(len(first_s)))
    within = 0.5 * min(_interval_s(first_s), _interval_s(second_s))
    rows = rows[np.abs(first_s[rows] - second_s[to_second[rows]]) <= within]
    return rows, to_second[rows]


def _nearest(times: np.ndarray, others: np.ndarray) -> np.ndarray:
    after = np.clip(np.searchsorted(others, times), 1, max(len(others) - 1, 1))
    if len(others) == 1:
        return np.zeros(len(times), dtype=int)
    return np.where(times - others[after - 1] <= others[after] - times, after - 1, after)


def _interval_s(times: np.ndarray) -> float:
    """Usual time between frames; that of 30 a second where there is but one frame."""
    steps = np.diff(times)
    return float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0 / 30.0


UNUSABLE = (BadInput, ArithmeticError, ValueError, np.linalg.LinAlgError)
"""What a picture may be refused with."""


class _Way:
    """A tracker that goes on after a picture that it cannot use."""

    def __init__(self, tracker: Follows) -> None:
        self.unusable: set[float] = set()
        self.problem = ""
        self._tracker = tracker

    def track(self, label_images: Sequence[np.ndarray], seconds: float) -> PoseEstimate | None:
        if not label_images:
            return None
        try:
            return self._tracker.track(label_images, seconds)
        except UNUSABLE as error:
            self.note(seconds, error)
        return None

    def forget(self) -> None:
        self._tracker.forget()

    def note(self, seconds: float, error: Exception) -> None:
        self.unusable.add(seconds)
        self.problem = reason_of(error)


class _Reader:
    """Pixels of the wanted frames of a file, until it ends; ``ended`` says how, where that is too early."""

    def __init__(self, source: PictureSource, rows: np.ndarray) -> None:
        self.ended = ""
        self._source, self._rows = source, rows

    def __iter__(self) -> Iterator[np.ndarray]:
        number, picture = -1, None
        self._source.open()
        for row in self._rows.tolist():
            while number < row:
                picture, number = self._next(), number + 1
                if picture is None:
                    return
            assert picture is not None
            yield picture.pixels

    def finish(self) -> None:
        """What follows is not wanted, but a file that is cut says so."""
        while self._next() is not None:
            pass

    def _next(self) -> Picture | None:
        try:
            return self._source.read()
        except DeviceFinished as over:
            self.ended = str(over) if over.is_early else ""
        except DeviceLost as lost:
            self.ended = str(lost)
        return None


def _findings(
    setup: TrackingSetup, pictures: Sequence[np.ndarray], labels: Sequence[np.ndarray]
) -> tuple[str, ...]:
    """Kinds of what is wrong with the view; one of two cameras may see no hand. Labels alone are not
    checked."""
    kinds = [
        {finding.kind for finding in setup.check.findings(picture, label)}
        for picture, label in zip(pictures, labels, strict=True)
        if picture.ndim == 3
    ]
    if len(kinds) > 1 and not all(NO_HAND in each for each in kinds):
        kinds = [each - {NO_HAND} for each in kinds]
    return tuple(sorted(set().union(*kinds)))


def _shadows(pictures: Sequence[np.ndarray], labels: Sequence[np.ndarray]) -> list[float]:
    """Of the pictures in which a glove is seen."""
    both = zip(pictures, labels, strict=True)
    shares = [shadowed(picture, label) for picture, label in both if picture.ndim == 3]
    return [share for share in shares if share is not None]


def _source(file: Path) -> VideoFilePictures | LabelFilePictures:
    if file.suffix.lower() in VIDEOS:
        return VideoFilePictures(file)
    if file.suffix == LABELS:
        return LabelFilePictures(file)
    raise BadInput(
        f"{file} is no recording of a camera: a video ends in {', '.join(VIDEOS)}, a file of label images in "
        f"{LABELS}"
    )


def _times_s(source: VideoFilePictures | LabelFilePictures, file: Path) -> np.ndarray:
    stamps = source.stamps.times_ns if isinstance(source, VideoFilePictures) else read_label_times(file)
    return np.array([monotonic_ns for monotonic_ns, _ in stamps], dtype=float) / 1e9


def _whose_times(source: VideoFilePictures | LabelFilePictures) -> str:
    return source.stamps.sentence if isinstance(source, VideoFilePictures) else OF_COMPUTER


def _require_one_clock(
    files: Sequence[Path], sources: Sequence[VideoFilePictures | LabelFilePictures]
) -> None:
    """Times of two computers' clocks cannot be matched."""
    computers = []
    for file, source in zip(files, sources, strict=True):
        if isinstance(source, VideoFilePictures) and not source.stamps.of_this_computer:
            raise BadInput(
                f"{file.name} has no times of a computer's clock, so its frames cannot be matched with "
                "those of another camera: record both cameras with Glovecal on one computer"
            )
        source.open()
        computers.append(source.about.get("computer"))
        source.close()
    if None not in computers and len(set(computers)) > 1:
        raise BadInput(
            f"{files[0].name} and {files[1].name} were recorded on two computers, whose clocks differ: "
            "connect both cameras to one"
        )
