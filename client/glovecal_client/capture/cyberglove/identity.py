"""What a CyberGlove says about itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from glovecal_client.capture.cyberglove.box import ControlBox, Unanswered
from glovecal_client.capture.cyberglove.order import HARDWARE_MASK, LAYOUT_OF_COUNT
from glovecal_client.errors import DeviceError

Hand = Literal["left", "right", "unknown"]


@dataclass(frozen=True)
class Identity:
    """A glove and its control box."""

    sensors: int
    hand: Hand
    plugged: bool
    """Whether the glove is plugged into the box."""
    firmware: str
    info: str
    """The box's own text, in whatever words its maker chose."""

    @property
    def layout(self) -> str:
        return LAYOUT_OF_COUNT[self.sensors]

    @property
    def simulated(self) -> bool:
        """True for an emulator that says so; real boxes have no such word."""
        return "simulated" in self.info.lower()

    def __str__(self) -> str:
        hand = f"{self.hand} hand" if self.hand != "unknown" else "hand unknown"
        simulated = ", simulated" if self.simulated else ""
        firmware = f"firmware {self.firmware or 'unknown'}"
        return f"CyberGlove with {self.sensors} sensors, {hand}, {firmware}{simulated}"


def identify(box: ControlBox, sensors: int) -> Identity:
    """Ask everything once the number of sensors is known. Raises DeviceError for a glove of another kind."""
    if sensors not in LAYOUT_OF_COUNT:
        raise DeviceError(f"the glove says it has {sensors} sensors; gloves with 18 and 22 are known")
    mask = int.from_bytes(box.query("K", 3), "little")
    if mask != HARDWARE_MASK[sensors]:
        raise DeviceError(
            f"the glove's hardware mask is 0x{mask:06X}; with {sensors} sensors it should be "
            f"0x{HARDWARE_MASK[sensors]:06X}, so the order of its sensors is not known"
        )
    return Identity(
        sensors=sensors,
        hand=_hand(box),
        # Bit 1 of the answer: glove plugged in. Bit 0, initialised, says nothing about the cable.
        plugged=bool(box.query("G", 1)[0] & 2),
        firmware=_firmware(box),
        info=box.query_text("i"),
    )


def _hand(box: ControlBox) -> Hand:
    try:
        return "right" if box.query("R", 1)[0] == 1 else "left"
    except Unanswered:
        return "unknown"


def _firmware(box: ControlBox) -> str:
    """Four bytes, of which one driver accepts just the first two; empty when neither comes."""
    try:
        return "{}.{}".format(*box.query("V", 4, reply_s=0.3, tries=1))
    except Unanswered as error:
        short = error.heard.startswith(b"?V") and len(error.heard) == 5
        return "{}.{}".format(*error.heard[2:4]) if short else ""
