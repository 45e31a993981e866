"""Takes as REST gives them, what is seen of them, and their videos."""

from __future__ import annotations

from datetime import datetime
from typing import Any, Literal

from pydantic import Field

from glovecal_models.hand.rotations import Handedness
from glovecal_models.presentation.document import counted
from glovecal_models.takes.camera_estimates import CoveredRange
from glovecal_models.takes.hand_clocks import How
from glovecal_models.takes.take import ReferenceJump, Stretch
from glovecal_models.takes.take_check import RotationRange, SensorRange
from glovecal_models.takes.time_code import TimeCode
from glovecal_service.exports.hand_motion import Content
from glovecal_service.file_kinds import FileKind
from glovecal_service.plain import Row


class Take(Row):
    id: str
    name: str
    subject: str
    layout: str
    wearing: str
    source: str
    artifact: str = Field(description="sha256 of the stored arrays.")
    original_sha256: str | None = Field(description="sha256 of the uploaded file, which is kept.")
    sensors: list[str]
    rotations: list[str] = Field(description="Rotations with a reference.")
    context: list[str]
    frames: int
    reference_rows: int
    teaches: bool = Field(description="Whether a calibration can learn from it.")
    known_hand: Handedness | None = Field(description="Which hand its glove is for; null: nobody said it.")
    hand_shape: str | None = Field(
        description="The session's shape that is held; methods template and two_shapes learn from it."
    )
    duration_s: float
    left_out: list[Stretch] = Field(
        description="By a person, from training, comparison and diagnosis: from and to in seconds since its "
        "first frame, the newest last."
    )
    note: str = Field(description="What people want to remember of it.")
    time_code: TimeCode | None = Field(
        None, description="SMPTE time code `label` begins at `time_s` of the take's clock; null: not known."
    )
    simulated: bool
    recording: str | None
    state: Literal["complete", "repairing"] = Field(
        description="`repairing`: frames of its recording may still be fetched from the capture log."
    )
    accounting: dict[str, Any] | None
    facts: dict[str, Any]
    created_at: datetime | None

    @property
    def line(self) -> str:
        """Its name, wearing and length, for a list."""
        return ", ".join(filter(None, (self.name, self.wearing, f"{self.duration_s:.0f} s")))

    @property
    def sent(self) -> int | None:
        """Frames that the glove sent, where it was recorded here."""
        return (self.accounting or {}).get("sent")


class HandOverTime(Row):
    """What a take's hand is seen to do in a part of it."""

    source: Literal["reference", "model", "raw"] = Field(
        description="Measured angles, a model's, or readings alone."
    )
    model: str | None
    from_s: float = Field(description="Seconds since the take's first frame, as all times here.")
    to_s: float = Field(description="Where the next part begins; the take's end in the last one.")
    names: list[str] = Field(description="Rotations; sensors where the source is raw.")
    time_s: list[float]
    values: list[list[float | None]] = Field(
        description="Degrees frame by frame, counts where the source is raw; null where nothing is known."
    )
    spans: list[Stretch] = Field(
        description="Least and greatest reading of each sensor in the whole take; empty unless raw."
    )
    sentence: str


class CheckView(Row):
    take: Take
    rate_hz: float | None = Field(description="By the median interval between frames.")
    gaps: int = Field(description="Intervals in which frames are missing.")
    longest_interval_s: float | None
    repeated_frames: float = Field(description="Share of frames that are the same as the one before.")
    frames_with_reference: float = Field(
        description="Share of frames with at least one reference angle; the pre-roll is not counted."
    )
    pre_roll_frames: int = Field(description="Frames before the take was asked for.")
    pre_roll_s: float
    time_codes: list[str] = Field(
        description="SMPTE time code of the first and the last frame asked for; empty where not known."
    )
    sensors: list[SensorRange]
    rotations: list[RotationRange]
    jumps: list[ReferenceJump] = Field(description="Where the reference jumps while the sensors do not.")
    sentences: list[str] = Field(description="What looks wrong.")


class ImportedTakes(Row):
    takes: list[Take] = Field(description="All takes of the file, in its order.")
    imported: list[str] = Field(description="Ids of those that are new.")
    existing: list[str] = Field(description="Ids of those that the same file had brought before.")
    replaced: list[str] = Field(description="Ids of those whose reference and names are now the file's.")
    layout: str
    original_sha256: str
    warnings: list[str] = Field(description="What `check` says of the takes; like sentences once.")
    subject_created: bool = Field(description="Whether the subject was not there before.")


class UploadedFile(Row):
    sha256: str = Field(description="The name to give where an upload is asked for.")
    size: int = Field(description="Bytes.")


class UploadKind(Row):
    kind: FileKind


class CardTable(UploadedFile):
    """A recording of a memory card, now a take table of this name."""

    layout: str = Field(description="Of the glove that recorded it.")
    records: int
    seconds: float
    damaged: int = Field(description="Records that were cut short, or out of range.")
    skipped_bytes: int = Field(description="Between records, of none.")

    @property
    def sentence(self) -> str:
        return (
            f"Memory card of a CyberGlove III, {self.layout}: {self.records} records over "
            f"{self.seconds:.1f} s, {self.damaged} damaged, {self.skipped_bytes} bytes between records."
        )


class ReferenceRotation(Row):
    rotation: str
    made_of: list[str] = Field(description="Markers, bones or the column of the file that tell it.")
    low_deg: float
    high_deg: float
    seen_share: float = Field(description="Of the rows in which it was measured.")


class PossibleTake(Row):
    """A take that the reference may belong to."""

    id: str
    name: str
    is_matched: bool = Field(description="Whether movement tells that it belongs here, and when.")
    offset_s: float = Field(description="Reference time = frame time + offset.")
    has_reference: bool = Field(description="Attached before; it stays on file.")
    sentence: str


class ReferencePreview(Row):
    """What a file of another measuring system tells, and of which take it is."""

    title: str = Field(description="What kind of file it is.")
    hand: Handedness | None = Field(description="Whose angles they are; null: a table does not say it.")
    hands: list[Handedness] = Field(description="That the file holds.")
    rows: int
    rate_hz: float | None = Field(description="By the mean interval between rows.")
    duration_s: float
    rotations: list[ReferenceRotation]
    left_out: dict[str, str] = Field(description="Rotations that it does not tell, and why.")
    odd: list[str] = Field(description="What looks wrong in it.")
    takes: list[PossibleTake] = Field(description="Of the subject, the likeliest first.")
    problem: str | None = Field(description="Why it belongs to none of them.")

    @property
    def sentence(self) -> str:
        rate = "" if self.rate_hz is None else f" at {self.rate_hz:.1f} Hz"
        of_hand = f" of the {self.hand} hand" if self.hand else ""
        return (
            f"{self.title}: {counted(len(self.rotations), 'rotation')}{of_hand}, {self.rows} rows{rate}, "
            f"{self.duration_s:.1f} s."
        )


class CameraReferenceView(Row):
    take: Take
    clock_offset_s: float = Field(description="Camera time less glove time; the reference is moved by it.")
    clock_offset_sd_s: float = Field(description="Its standard deviation.")
    accepted_share: float = Field(description="Of the camera's estimates.")
    camera_ranges: list[CoveredRange] = Field(description="Angles outside of them are not judged.")
    sentences: list[str]


class SessionDriftView(Row):
    shapes: list[str]
    rms_deg: float | None = Field(description="Over shapes and rotations; null without a model.")
    mean_deg: dict[str, float] = Field(description="By rotation, the mean over shapes, end less start.")
    mean_counts: dict[str, float] = Field(description="By sensor.")
    left_out: dict[str, str] = Field(description="Shapes that were not held, or not in both, and why.")
    sentence: str


class OwnClockView(Row):
    """A glove's own clock against the capture computer's."""

    kind: str = Field(description='"own" or "ltc".')
    drift_ppm: float
    drift_sd_ppm: float
    sd_s: float
    span_s: float


class HandAlignmentView(Row):
    how: How
    shift_s: float = Field(description="Added to the second take's times at `at_s`, seconds.")
    drift_ppm: float = Field(description="And so many millionths of the time since `at_s`.")
    at_s: float
    sd_s: float | None = Field(
        description="Standard deviation of the shift; null where nothing was measured."
    )
    own_clocks: list[OwnClockView | None] = Field(description="Of each take, first and second.")
    sentence: str


class Video(Row):
    take: str = Field(description="Id.")
    name: str
    source: str
    simulated: bool = Field(description="Its pictures were drawn, not taken.")
    times_s: list[float] = Field(description="Of each picture, by the take's clock.")
    sentence: str


class HandBeside(Row):
    rotations: list[str]
    degrees: list[list[float] | None] = Field(
        description="Of the whole hand at each picture; null where the take has no frame within 0.1 s."
    )


class MotionFormat(Row):
    format: str = Field(description="The end of a file's name, without its dot.")
    name: str
    contents: list[Content] = Field(description="What it can hold.")
    unit: str
    axes: str
    times: str
    accuracy: str = Field(description="What it holds of the angles' standard deviations and flags.")
    read_by: str
    characters: bool = Field(description="Whether it can hold a character of your own that moves.")
    robots: list[str] = Field(description="Robot hands whose joint angles it can hold.")


class CharacterHand(Row):
    """How well the hand of a character or a robot shows a motion."""

    hand: Handedness
    bones: dict[str, str] = Field(
        description="The character's bone, or the robot's link, by the hand's bone."
    )
    missing: list[str] = Field(description="Bones of the hand that it lacks.")
    choices: list[str] = Field(description="Names of its bones or links, of which others can be chosen.")
    fingertip_mm: float = Field(
        description="Root mean square over frames and fingers: how far its fingertips are from "
        "the hand's, both seen from the wrist, in the hand's size."
    )
    touches: int = Field(description="Frames, of 500 at most, in which the thumb touches a finger.")
    lost: int = Field(description="Of these, in which the other's does not.")
    picture: str = Field(description="SVG: the hand, and how it is shown: flat, as a fist, and touching.")
