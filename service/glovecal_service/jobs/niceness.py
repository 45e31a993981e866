"""Training steps back behind the live stream: the system gives it what time others leave."""

from __future__ import annotations

import os
import sys
import threading

NICENESS = 10


def step_back() -> None:
    """For this process, or on Linux for this thread alone: the others of a command answer its user."""
    if sys.platform == "linux":
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), NICENESS)
    elif hasattr(os, "nice"):
        os.nice(NICENESS - os.nice(0))
