"""One glove's poses for a control loop: the newest one, its rotations' names, and how old it is."""

from __future__ import annotations

import time
from contextlib import ExitStack
from types import TracebackType

from glovecal_client import Pose, PoseSubscriber
from glovecal_client.errors import NoAnswer
from glovecal_client.session import open_client
from lerobot_teleoperator_glovecal.joint_actions import GloveNotUsable, JointActions

ASK_FOR_S = 0.05


class GloveLink:
    """``connect``, then ``get_action`` in a loop; knows nothing of LeRobot."""

    def __init__(self, actions: JointActions, *, site: str, endpoint: str, timeout_s: float = 5.0) -> None:
        self._actions, self._site, self._endpoint, self._timeout_s = actions, site, endpoint, timeout_s
        self._open = ExitStack()
        self._subscriber: PoseSubscriber | None = None
        self._names: tuple[str, ...] = ()
        self._named_model: str | None = None

    @property
    def is_connected(self) -> bool:
        return self._subscriber is not None

    def connect(self) -> None:
        """Wait for poses that can move a robot. Raises GloveNotUsable, NoAnswer without a service."""
        if self.is_connected:
            return
        session = self._open.enter_context(open_client([self._endpoint], wait_s=self._timeout_s))
        self._subscriber = self._open.enter_context(
            PoseSubscriber(session, self._site, self._actions.glove, stale_after_s=self._actions.hold_s / 2)
        )
        until = time.monotonic() + self._timeout_s
        while True:
            self._subscriber.wait(0.1)
            try:
                self._actions.begin(*self._newest(ask_for_s=1.0))
                return
            except GloveNotUsable:
                if time.monotonic() > until:
                    self.disconnect()
                    raise

    def disconnect(self) -> None:
        self._subscriber = None
        self._open.close()

    def get_action(self) -> dict[str, float]:
        """Never waits for a pose; for its names at most ``ASK_FOR_S``. Raises GloveNotUsable."""
        if not self.is_connected:
            raise GloveNotUsable(f"glove {self._actions.glove} is not connected; call connect first")
        return self._actions.at(time.monotonic(), *self._newest(ASK_FOR_S))

    def _newest(self, ask_for_s: float) -> tuple[Pose | None, tuple[str, ...], bool]:
        """The pose, the names of its rotations, and whether it is late; None where it cannot be read."""
        assert self._subscriber is not None
        pose = self._subscriber.latest
        if pose is None:
            return None, (), True
        if pose.model_sha256 != self._named_model or len(self._names) != len(pose.degrees):
            try:
                meta = self._subscriber.meta(pose, timeout_s=ask_for_s) if len(pose.degrees) else {}
                self._names = tuple(map(str, meta.get("rotations", ())))
                if meta:
                    self._actions.mapping.know(meta)
                self._named_model = pose.model_sha256
            except NoAnswer:
                return None, (), True
        return pose, self._names, self._subscriber.stale

    def __enter__(self) -> GloveLink:
        self.connect()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.disconnect()
