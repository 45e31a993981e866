"""Poses as Lab Streaming Layer streams, one a glove, each sample at the time of the hand.

Channels: every rotation in degrees, then its standard deviation (``I_PIP_sd``), then ``flags``, those of the
wire's pose. An angle that is too uncertain, or held because its sensor fails, is NaN, its standard deviation
stays. While poses are stale or uncalibrated a row of NaN comes with those flags, so that a recording shows
the gap.

LSL's clock is the computer's monotonic one, and so is the time of a hand captured on this computer: all its
gloves have one clock. Of a glove captured elsewhere a sample has the time of arrival, less the pose's age.
"""

from __future__ import annotations

from types import TracebackType
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from glovecal_client.clock import clock_s
from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean
from glovecal_service.bridges.bridge import Bridge, BridgeOptions
from glovecal_service.bridges.glove_pose import GlovePose
from glovecal_service.bridges.traffic import Traffic

if TYPE_CHECKING:
    import pylsl

SCOPES = ("machine", "link", "site")
FLAGS = "flags"


class LslBridge(Bridge):
    """Streams for LabRecorder and whatever else reads LSL."""

    about = "Lab Streaming Layer: LabRecorder, MNE, psychology and physiology labs"
    to_set_there = "nothing: the streams are `glovecal-GLOVE`, type MoCap"
    units = "degrees, times of the hand by LSL's clock"
    when_stale = "rows of NaN whose flags say why"
    options: ClassVar[dict[str, str]] = {
        "scope": "who can find the streams: machine (default, this computer), link (the local network), site",
    }
    needs = ("pylsl", "pylsl")

    def __init__(self, options: BridgeOptions, traffic: Traffic) -> None:
        super().__init__(options, traffic)
        self._scope = options.more.get("scope", SCOPES[0])
        if self._scope not in SCOPES:
            raise BadInput(f"option scope is {self._scope!r}; {did_you_mean(self._scope, SCOPES)}")
        self._streams: dict[str, _Stream] = {}
        self._ahead_s = 0.0

    @property
    def where(self) -> str:
        return f"LSL streams glovecal-GLOVE of type MoCap, found in scope {self._scope}."

    @property
    def receivers(self) -> int:
        """Streams that somebody reads."""
        return sum(stream.outlet.have_consumers() for stream in list(self._streams.values()))

    def send(self, hand: GlovePose) -> None:
        stream = self._streams.get(hand.glove)
        if hand.meaning.rotations and (stream is None or not stream.fits(hand)):
            stream = self._streams[hand.glove] = _Stream(hand, self._ahead_s)
        if stream is not None:
            stream.push(hand)
            self._traffic.note_departure(hand)

    def __enter__(self) -> LslBridge:
        try:
            import pylsl
        except (RuntimeError, OSError) as error:
            raise BadInput("LSL's library cannot be loaded; install the package pylsl again") from error
        pylsl.set_config_content(f"[multicast]\nResolveScope = {self._scope}\n[log]\nlevel = -3\n")
        self._ahead_s = _lsl_ahead_s()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._streams.clear()


class _Stream:
    """One glove's outlet: its channels are those of the rotations it was made for."""

    def __init__(self, hand: GlovePose, ahead_s: float) -> None:
        """``ahead_s``: LSL's clock less the monotonic one."""
        import pylsl

        self._ahead_s = ahead_s
        self._rotations, self._hand = hand.meaning.rotations, hand.meaning.hand
        labels = [*self._rotations, *(f"{name}_sd" for name in self._rotations), FLAGS]
        info = pylsl.StreamInfo(
            f"glovecal-{hand.glove}", "MoCap", len(labels), pylsl.IRREGULAR_RATE, pylsl.cf_float32,
            f"glovecal-{hand.glove}",
        )  # fmt: skip
        info.set_channel_labels(labels)
        info.set_channel_types(["Orientation"] * (len(labels) - 1) + ["Misc"])
        units: list[str | int] = [*["degrees"] * (len(labels) - 1), "bits"]
        info.set_channel_units(units)
        info.desc().append_child_value("hand", self._hand or "unknown")
        info.desc().append_child_value("subject", str(hand.meaning.document.get("subject") or ""))
        self.outlet: pylsl.StreamOutlet = pylsl.StreamOutlet(info)

    def fits(self, hand: GlovePose) -> bool:
        return (self._rotations, self._hand) == (hand.meaning.rotations, hand.meaning.hand)

    def push(self, hand: GlovePose) -> None:
        import pylsl

        count = len(self._rotations)
        row = np.full(2 * count + 1, np.nan, np.float32)
        time_s = pylsl.local_clock()
        if hand.state == "live":
            row[:count] = np.where(hand.pose.usable, hand.pose.degrees, np.nan)
            row[count:-1] = hand.pose.deviations
            time_s = self._ahead_s + _time_of_hand_s(hand)
        row[-1] = hand.pose.flags
        self.outlet.push_sample(row.tolist(), time_s)


def _time_of_hand_s(hand: GlovePose) -> float:
    """By this computer's monotonic clock."""
    pose = hand.pose
    return (pose.monotonic_ns if hand.is_of_this_computer else hand.arrived_ns - 1000 * pose.age_us) / 1e9


def _lsl_ahead_s() -> float:
    """LSL's clock less this computer's monotonic one: the same clock on most systems.

    Asked a few times, since a busy computer may do something else between two questions.
    """
    import pylsl

    asked = [(clock_s(), pylsl.local_clock(), clock_s()) for _ in range(50)]
    before, lsl_s, after = min(asked, key=lambda each: each[2] - each[0])
    return lsl_s - (before + after) / 2
