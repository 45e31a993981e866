"""A loop of poses that stands still ends its process, so that another is started."""

from __future__ import annotations

import multiprocessing
from threading import Event
from types import SimpleNamespace
from typing import cast

from glovecal_service.realtime import process
from glovecal_service.realtime.pose_loop import PoseLoop

SPAWN = multiprocessing.get_context("spawn")


def stand_still() -> None:
    process.LOOKS_EVERY_S = 0.01
    process.end_if_it_stands_still(cast(PoseLoop, SimpleNamespace(turns=7)), Event())


def test_a_process_whose_loop_stands_still_ends() -> None:
    it = SPAWN.Process(target=stand_still)
    it.start()
    it.join(120)
    assert it.exitcode == 1


class Looked:
    """Asked before each look; the loop has made a turn before each tenth."""

    def __init__(self, loop: SimpleNamespace) -> None:
        self.loop, self.looks = loop, 0

    def wait(self, seconds: float) -> bool:
        self.looks += 1
        self.loop.turns += self.looks % process.LOOKS_IN_VAIN == 0
        return self.looks >= 100


def test_one_that_goes_on_does_not() -> None:
    loop = SimpleNamespace(turns=0)
    looked = Looked(loop)
    process.end_if_it_stands_still(cast(PoseLoop, loop), cast(Event, looked))
    assert looked.looks == 100
