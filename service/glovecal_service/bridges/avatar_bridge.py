"""Bridges to characters: each pose is one datagram of finger bones, turned from the T-pose.

Such a bridge says only what its datagram looks like; address, bones of each glove and counting are here.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from types import TracebackType
from typing import ClassVar, Self

from glovecal_service.bridges.bridge import Bridge, BridgeOptions
from glovecal_service.bridges.datagrams import DatagramSender
from glovecal_service.bridges.glove_pose import BonesInMotion, GlovePose
from glovecal_service.bridges.t_pose import FingerBone, finger_bones
from glovecal_service.bridges.traffic import Traffic


class AvatarBridge(Bridge):
    """Sends to ``to``, whoever may be listening there."""

    form: ClassVar[str]
    """What is sent, a noun: ``VMC by OSC``."""
    default_address: ClassVar[str]

    def __init__(self, options: BridgeOptions, traffic: Traffic) -> None:
        super().__init__(options, traffic)
        self._host, self._port = options.address(self.default_address)
        self._sender: DatagramSender | None = None
        self._motions: dict[str, BonesInMotion] = {}

    @abstractmethod
    def datagram(self, hand: GlovePose, bones: Sequence[FingerBone] | None) -> bytes:
        """``bones``: the fifteen; None while the pose is not live, or it is not known which hand it is of.
        b"" where nothing is to be sent."""

    @property
    def where(self) -> str:
        return f"{self.form} to {self._host}:{self._port}."

    def send(self, hand: GlovePose) -> None:
        if self._sender is None:
            return
        bones = self._bones(hand) if hand.state == "live" else None
        datagram = self.datagram(hand, bones)
        is_sent = not datagram or self._sender.send(datagram)
        if not is_sent or (bones is None and hand.state == "live"):
            self._traffic.note_left_out(hand.glove)
        else:
            self._traffic.note_departure(hand)

    def _bones(self, hand: GlovePose) -> list[FingerBone] | None:
        turned = self._motions.setdefault(hand.glove, BonesInMotion()).turned(hand)
        return None if turned is None else list(finger_bones(*turned))

    def __enter__(self) -> Self:
        self._sender = DatagramSender(self._host, self._port)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._sender is not None:
            self._sender.close()
            self._sender = None
