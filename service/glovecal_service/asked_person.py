"""A simulated person who looks at the page of the service: does what the open sampling asks, else rests."""

from __future__ import annotations

import threading
import time
import weakref
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from glovecal_client.errors import ClientError
from glovecal_client.rest import RestClient
from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_models.sampling.protocol import Step
from glovecal_models.simulation.asked_hand import AskedHand
from glovecal_models.simulation.simulated_hand import DRIVEN, ROTATIONS, SimulatedHand
from glovecal_models.simulation.touching import PreparedTouches, RealTouches

DEFAULT_SERVICE = "http://127.0.0.1:8600"
LOOK_EVERY_S = 0.15
RESTING = ("paused", "done", "stopped")


class AskedPerson:
    """Rotations as a function of time that only goes on; what is asked is looked up in a thread.

    The newest open sampling counts. While the service does not answer, the person goes on with the last step.
    The hand is a usual one, 190 mm long.
    """

    def __init__(
        self, hand: SimulatedHand, rotations: Sequence[str], seed: int, wearing: int, service: str
    ) -> None:
        """Raises BadName for an address that is none."""
        RestClient(service).close()
        self._rules = hand
        number = seed + 1_000_003 * wearing
        self.touches = PreparedTouches(RealTouches(hand, hand_skeleton()), number)
        self._hand = AskedHand(number, self.touches)
        self._order = [ROTATIONS.index(rotation) for rotation in rotations]
        self.asked: Step | None = None
        threading.Thread(target=_look, args=(weakref.ref(self), service), daemon=True).start()

    def at(self, time_s: np.ndarray) -> tuple[np.ndarray, tuple[str, ...]]:
        """Angles, shape (N, len(rotations)), degrees, and pose names at increasing times (N,)."""
        step = self.asked
        self._hand.ask(step, float(time_s[0]))
        driven = self._hand.driven(time_s)
        angles = self._rules.complete(dict(zip(DRIVEN, driven.T, strict=True)))
        return angles[:, self._order], (step.pose if step else "",) * len(time_s)


def _look(person: weakref.ref[AskedPerson], service: str) -> None:
    """As long as the person is there."""
    with RestClient(service, patience_s=5.0) as client:
        while (there := person()) is not None:
            with suppress(ClientError):  # the service may be starting; look again
                asked = _asked(client.get("/sampling", {"only_open": True}))
                if asked is not None:
                    there.touches.prepare(asked)
                there.asked = asked
            del there
            time.sleep(LOOK_EVERY_S)


def _asked(samplings: list[dict[str, Any]]) -> Step | None:
    if not samplings or samplings[0]["step"] is None or samplings[0]["phase"] in RESTING:
        return None
    asked = {name: value for name, value in samplings[0]["step"].items() if name != "place"}
    return Step.from_document({**asked, "part": ""})
