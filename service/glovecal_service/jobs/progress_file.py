"""How far a single task is: one small file that its worker writes and the job's watcher reads.

Workers may be other processes on other computers; what they share with the service is the fits folder.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

from glovecal_client.operating_system import move_over, remove

NOTHING: Mapping[str, Any] = MappingProxyType({})


@dataclass(frozen=True)
class TaskProgress:
    """What a task said last."""

    sentence: str
    share: float
    """Of this task, 0 to 1."""
    detail: dict[str, Any]


class ProgressFile:
    """Written whole or not at all; progress that cannot be written is lost, the work goes on."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def write(self, sentence: str, share: float, detail: Mapping[str, Any] = NOTHING) -> None:
        unfinished = self._path.with_suffix(f".{os.getpid()}.part")
        with suppress(OSError):
            unfinished.write_text(json.dumps([sentence, float(share), dict(detail)]))
            move_over(unfinished, self._path)

    def read(self) -> TaskProgress | None:
        """None before the first word and after the task's end."""
        with suppress(OSError, ValueError, TypeError):
            sentence, share, detail = json.loads(self._path.read_text())
            return TaskProgress(str(sentence), min(max(float(share), 0.0), 1.0), dict(detail))
        return None

    def remove(self) -> None:
        remove(self._path)
