"""Gloves, layouts, recordings, cards and cameras as REST gives them."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import Field, FiniteFloat

from glovecal_models.hand.rotations import Handedness, known_hand
from glovecal_models.takes.tap_latency import FEWEST_TAPS
from glovecal_service.plain import Row
from glovecal_service.request_types import StrictBody
from glovecal_service.store.gloves import MOST_DELAY_MS
from glovecal_service.store.records import RecordingState


class LayoutView(Row):
    name: str
    title: str
    sensors: list[str]
    rotations: list[str]
    document: dict[str, Any] = Field(description="As in a layout file, every rotation spelled out.")
    built_in: bool
    created_at: datetime | None

    @property
    def read_from(self) -> dict[str, list[str]]:
        """The sensors that each rotation is read from."""
        return self.document["rotations"]


class Latency(StrictBody):
    """What ``glovecal take latency`` measured."""

    latency_s: Annotated[FiniteFloat, Field(ge=-0.1, le=1.0)]
    sd_s: Annotated[FiniteFloat, Field(ge=0, le=0.1, description="Standard deviation of `latency_s`.")]
    taps: Annotated[int, Field(ge=FEWEST_TAPS, le=100_000)]
    used: Annotated[int, Field(ge=FEWEST_TAPS, le=100_000, description="Taps that were alike.")]
    key_latency_s: Annotated[FiniteFloat, Field(ge=0, le=0.2, description="Taken for the key's own.")] = 0.0


class LatencyView(Latency):
    measured_at: str = Field(description="ISO 8601.")


class Delay(StrictBody):
    """How long live poses wait."""

    delay_ms: Annotated[int, Field(ge=0, le=MOST_DELAY_MS, description="0: they are live.")]


class GloveView(Row):
    name: str
    layout: str | None
    subject: str | None
    wearing: str | None
    hand: str
    simulated: bool
    meta: dict[str, Any]
    first_seen_at: datetime
    last_seen_at: datetime
    assigned_at: datetime | None
    latency: LatencyView | None = Field(None, description="How late it is, as taps on a key showed.")
    delay_ms: int = Field(0, description="How long its live poses wait for the frames after them.")

    @property
    def known_hand(self) -> Handedness | None:
        """Which one it is for; None where its capture does not know."""
        return known_hand(self.hand)


class Gloves(Row):
    layouts: list[LayoutView]
    seen: list[GloveView]


class Warning(Row):
    """Something that is wrong, noticed within 10 s of motion."""

    part: str = Field(description='"wearer": wrong person, hand or model; "sensor": dead or stuck.')
    sentence: str
    advice: str


class LiveGlove(Row):
    glove: str
    state: Literal["calibrated", "uncalibrated"] | None
    subject: str | None
    wearing: str | None
    layout: str | None
    model: str | None
    sentence: str | None = Field(description="Why it is not served better, such as by a wrong hand.")
    warnings: list[Warning]
    on_for_s: float | None = Field(description="Since capture began; null where it does not answer.")
    warm_up_left_s: float | None = Field(description="Of 20 minutes; 0 for a warm glove.")


class PreRoll(Row):
    seconds: float = 0.0
    sentence: str = ""


class Account(Row):
    """What became of a recording's frames, as far as it is known."""

    take: str | None = None
    """Its id; None where none was made, or not yet."""
    sentence: str = ""
    sent: int = 0
    recorded: int | None = None
    repaired: int = 0
    missing: Sequence[tuple[int, int]] = ()
    """First and last sequence number of each gap."""
    missing_frames: int = 0
    pre_roll: PreRoll = PreRoll()


class Recording(Row):
    id: str
    glove: str
    name: str
    subject: str | None
    wearing: str | None
    state: RecordingState
    facts: dict[str, Any] = Field(
        description="`sent`, `recorded`, `repaired`, `missing`, `pending`, `pre_roll`, `take`, `sentence` ..."
    )
    requested_at: datetime
    updated_at: datetime

    @property
    def account(self) -> Account:
        return Account.model_validate(self.facts)


class Film(Row):
    source: str
    file: str = Field(description="In the folder `films` of the data folder: lossless, with time stamps.")
    is_on: bool
    pictures: int
    problem: str = Field(description="Why it ended early; empty where it did not.")
    sentences: list[str] = Field(default_factory=list, description="Beside which takes it is shown.")


class CardClock(Row):
    """Against that of the computer."""

    ahead_s: float
    sd_s: float
    is_consistent: bool


class Card(Row):
    """What a glove with a memory card answers."""

    battery_v: float | None = None
    clock: CardClock | None = None
    active_file: str | None = None
    files: list[str] | None = None
    free_mb: int | None = None


class GloveAnswer(Row):
    glove: str
    answer: dict[str, Any] | None = Field(description="The device's document; null where it was refused.")
    problem: str | None = Field(description="Why it was refused, or that nobody answered.")

    @property
    def card(self) -> Card:
        """What is known of its memory card; empty for a device without one."""
        return Card.model_validate(self.answer or {})


class GloveAnswers(Row):
    answers: list[GloveAnswer]
    sentences: list[str] = Field(description="How far the gloves' clocks are apart, where they told them.")


State = Literal["opening", "streaming", "lost", "stopped"]


Stage = Literal["nearest", "blend", "ik", "dense"]


Kept = Literal["pictures", "labels", "nothing"]


class Percentiles(Row):
    """Milliseconds."""

    p50: float
    p95: float
    max: float


class TrackedRotation(Row):
    name: str
    degrees: float
    sd_deg: float = Field(description="Standard deviation as the tracker states it.")
    accepted: bool = Field(description="Sure enough to be a reference.")
    accepted_share: float = Field(description="Of the last 300 poses.")


class CameraHealthView(Row):
    """Each picture is tracked, without_hand, unusable, skipped or waiting; of those stamped twice one."""

    source: str
    simulated: bool
    stage: Stage
    pictures: int = Field(description="Read in this run, with a stamp later than the one before.")
    tracked: int
    without_hand: int
    unusable: int = Field(description="Such as of another size than the camera was calibrated for.")
    skipped: int = Field(description="Left out because newer ones were there.")
    waiting: int
    stamped_twice: int = Field(description="Not later than the one before; not tracked.")
    dropped: int = Field(description="By the camera, as the times of its pictures tell.")
    reconnects: int
    gains: dict[str, float] = Field(
        description="Of red, green and blue: a picture's light is multiplied by them first."
    )
    calibrated: bool = Field(description="Whether focal length and distortion are known, not assumed.")
    sees: str = Field(description="hand, no hand, or nothing yet.")
    problem: str = Field(description="Why the last picture was unusable; empty where it was not.")
    findings: dict[str, str] = Field(
        description="What is wrong with the view now: sentences by kind, such as `two hands`. While there is "
        "any, no rotation is accepted."
    )
    findings_counted: dict[str, int] = Field(
        description="Pictures in which each kind was found; five a second are checked."
    )
    advice: str = Field(description="What to change of the light; empty where it will do.")
    pose_rate_hz: float
    latency_ms: Percentiles | None = Field(
        description="From the picture's stamp to publication, last 300 poses. A camera stamps a picture when "
        "it has arrived: its exposure and transfer are not in it."
    )
    computing_ms: Percentiles | None = Field(description="Of it, on labels and pose.")
    accepted_share: float | None = Field(description="Of all rotations of the last 300 poses.")
    disagreeing: float | None = Field(
        description="Share of the glove's pixels that the model gets wrong; last 300 poses."
    )
    position_mm: tuple[float, float, float] | None = Field(description="Of the wrist, before the camera.")
    position_sd_mm: tuple[float, float, float] | None
    patches: list[int] | None = Field(description="Of the pattern, that are seen.")
    rotations: list[TrackedRotation]
    kept: Kept
    kept_pictures: int
    not_kept: int = Field(description="That should have been kept and were not.")
    kept_file: str | None = Field(description="In the folder `cameras/kept` of the data folder.")
    kept_problem: str


class CameraView(Row):
    glove: str = Field(description="Under which its poses are published.")
    source: str
    state: State
    sentence: str
    is_simulated: bool
    started_here: bool = Field(description="By this service, not on a command line.")
    health: CameraHealthView | None = Field(description="Null before it said anything, and after its end.")


class CameraFileNames(Row):
    colours: list[str] = Field(description="Made by `glovecal camera colours`.")
    calibrations: list[str] = Field(description="Made by `glovecal camera calibrate`.")


class CameraVideo(Row):
    """A video of a phone or a camera that was imported."""

    name: str
    pictures: int
    seconds: float = Field(description="From its first picture to its last.")
    times: str = Field(description="Where the times of its pictures come from, and how even they are.")


class SerialPort(Row):
    """A serial port of the service's computer."""

    path: str
    kind: Literal["cyberglove", "silent", "echo", "text", "unreadable", "unusable"]
    sentence: str = Field(description="What answered, in words.")
    description: str = Field(description="What the operating system says about the port.")
    device: str | None = Field(description="For `glovecal capture --device`; null where no glove answered.")


class GloveDevice(Row):
    """A kind of glove that capture reads."""

    name: str
    sentence: str
    command: str = Field(description="With PORT, FILE, GLOVE and SUBJECT in the place of what differs.")
