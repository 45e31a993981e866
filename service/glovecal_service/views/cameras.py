"""A camera as REST gives it: what it says of itself, or what became of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import BaseModel, Field, ValidationError

from glovecal_service.camera.started_cameras import StartedCamera

State = Literal["opening", "streaming", "lost", "stopped"]
Stage = Literal["nearest", "blend", "ik", "dense"]
Kept = Literal["pictures", "labels", "nothing"]


class Percentiles(BaseModel):
    """Milliseconds."""

    p50: float
    p95: float
    max: float


class TrackedRotation(BaseModel):
    name: str
    degrees: float
    sd_deg: float = Field(description="Standard deviation as the tracker states it.")
    accepted: bool = Field(description="Sure enough to be a reference.")
    accepted_share: float = Field(description="Of the last 300 poses.")


class CameraHealthView(BaseModel):
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


class CameraView(BaseModel):
    glove: str = Field(description="Under which its poses are published.")
    source: str
    state: State
    sentence: str
    is_simulated: bool
    started_here: bool = Field(description="By this service, not on a command line.")
    health: CameraHealthView | None = Field(description="Null before it said anything, and after its end.")


def said_of_itself(glove: str, status: Mapping[str, Any], *, started_here: bool) -> CameraView | None:
    """None for what is no camera's status."""
    if not isinstance(status.get("camera"), dict):
        return None
    try:
        health = CameraHealthView.model_validate(status["camera"])
        return CameraView(
            glove=glove, source=health.source, state=status.get("state"),  # type: ignore[arg-type]
            sentence=status.get("sentence"), is_simulated=health.simulated,  # type: ignore[arg-type]
            started_here=started_here, health=health,
        )  # fmt: skip
    except ValidationError:
        return None


def silent(camera: StartedCamera) -> CameraView:
    """One that was started here and does not answer: it begins, or has ended."""
    return CameraView(
        glove=camera.glove, source=camera.source, state="opening" if camera.is_on else "stopped",
        sentence=camera.sentence or ("starting" if camera.is_on else "stopped"),
        is_simulated=camera.source == "rendered", started_here=True, health=None,
    )  # fmt: skip
