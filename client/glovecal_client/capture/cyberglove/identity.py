"""What a CyberGlove says about itself, and which of its sensors is which in cyberglove18 and cyberglove22.

The box sends its sensors in the order of a 24-bit mask: finger by finger, the abduction sensor last of each.
The layouts use the order of Wang & Neff 2013, Figure 2 (the four DIP sensors of the larger glove at the end).
Seven independent public drivers and the vendor's manual agree on the 22-sensor order, four on the 18.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from glovecal_client.capture.cyberglove.box import ControlBox, Unanswered
from glovecal_client.errors import DeviceError

SENSOR_OF_BIT: dict[int, str] = {
    0: "T_TMC", 1: "T_MCP", 2: "T_IP", 3: "TI_ABD",
    4: "I_MCP", 5: "I_PIP", 6: "I_DIP",
    8: "M_MCP", 9: "M_PIP", 10: "M_DIP", 11: "IM_ABD",
    12: "R_MCP", 13: "R_PIP", 14: "R_DIP", 15: "MR_ABD",
    16: "P_MCP", 17: "P_PIP", 18: "P_DIP", 19: "RP_ABD",
    20: "PALM_ARCH", 21: "W_FLEX", 22: "W_ABD",
}  # fmt: skip
"""Bit 0 is the thumb's roll, bit 3 thumb-index abduction; bits 7 and 23 carry no sensor."""

HARDWARE_MASK = {18: 0x7BBB3F, 22: 0x7FFF7F}

_LAYOUT18 = (
    "T_TMC", "TI_ABD", "T_MCP", "T_IP", "I_MCP", "I_PIP", "IM_ABD", "M_MCP", "M_PIP",
    "R_MCP", "R_PIP", "MR_ABD", "P_MCP", "P_PIP", "RP_ABD", "PALM_ARCH", "W_FLEX", "W_ABD",
)  # fmt: skip
SENSORS: dict[str, tuple[str, ...]] = {
    "cyberglove18": _LAYOUT18,
    "cyberglove22": (*_LAYOUT18, "I_DIP", "M_DIP", "R_DIP", "P_DIP"),
}
LAYOUT_OF_COUNT = {18: "cyberglove18", 22: "cyberglove22"}


def hardware_order(count: int) -> tuple[str, ...]:
    """The sensor names in the order a box with ``count`` sensors (18 or 22) sends them."""
    return tuple(name for bit, name in SENSOR_OF_BIT.items() if HARDWARE_MASK[count] >> bit & 1)


def layout_index(count: int) -> list[int]:
    """``readings_of_layout = readings_of_hardware[layout_index(count)]``."""
    order = hardware_order(count)
    return [order.index(name) for name in SENSORS[LAYOUT_OF_COUNT[count]]]


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
