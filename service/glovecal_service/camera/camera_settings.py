"""What pictures are tracked with, and what a camera is started with: on the command line and over REST."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal, get_args

from glovecal_client.errors import BadName
from glovecal_client.keys import GloveKeys
from glovecal_models.colour_glove.pose_estimate import STAGES
from glovecal_models.errors import BadInput

Keep = Literal["pictures", "labels", "nothing"]
KEEPS: tuple[Keep, ...] = get_args(Keep)
DEFAULT_KEEP: Keep = "labels"
"""Half a gigabyte an hour in place of tens, can be tracked again at any stage, and shows no face."""
DEFAULT_STAGE = "dense"
HANDS = ("right", "left")


@dataclass(frozen=True, kw_only=True)
class TrackingSettings:
    """What a hand is tracked with, live or in recordings. Raises BadInput for what is none of the known."""

    data: Path
    hand: str = "right"
    stage: str = DEFAULT_STAGE
    colours: Path | None = None
    """Colour table; None: one that is learned on rendered photographs of the printed colours."""
    calibration: Path | None = None
    """Each camera's focal length, centre and distortion, and where the second stands; None: those of an
    assumed camera, which is said."""
    entries: int = 20_000
    """Of the pose database."""
    sizes_mm: Mapping[str, float] = field(default_factory=dict)
    """Of the subject's hand, as measured; what is missing follows from them, or is assumed."""
    shape: Path | None = None
    """Of the hand in its glove, as ``glovecal camera shape`` finds it; None: by ``sizes_mm``."""
    clips: int = 36
    """Rendered ones of other hands, from which the tracker's errors are learned."""

    def __post_init__(self) -> None:
        _require("stage", self.stage, STAGES)
        _require("hand", self.hand, HANDS)

    @property
    def folder(self) -> Path:
        """Of everything that cameras keep."""
        return self.data / "cameras"


@dataclass(frozen=True)
class CameraSettings(TrackingSettings):
    """Raises BadInput for what no camera can be started with."""

    source: str
    """``camera:0``, ``video:FILE.mkv``, ``labels:FILE.labels`` or ``rendered``."""
    glove: str
    """Under which its poses are published."""
    site: str = "lab"
    zenoh: str = "tcp/127.0.0.1:7447"
    subject: str | None = None
    keep: Keep = DEFAULT_KEEP

    def __post_init__(self) -> None:
        super().__post_init__()
        try:
            GloveKeys(self.site, self.glove)
        except BadName as error:
            raise BadInput(str(error)) from error
        _require("keep", self.keep, KEEPS)

    @property
    def keys(self) -> GloveKeys:
        return GloveKeys(self.site, self.glove)

    def text(self) -> str:
        """As JSON, for a process of its own."""
        return json.dumps(asdict(self), default=str)

    @classmethod
    def from_text(cls, text: str) -> CameraSettings:
        """From what ``text`` gave."""
        given: dict[str, Any] = json.loads(text)
        for name in ("data", "colours", "calibration", "shape"):
            given[name] = None if given[name] is None else Path(given[name])
        return cls(**given)


def _require(name: str, value: str, known: Sequence[str]) -> None:
    if value not in known:
        raise BadInput(f"{name} {value!r} is none of {', '.join(known)}")
