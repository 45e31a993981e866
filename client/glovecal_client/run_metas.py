"""What a glove's capture daemons say of their runs: within a run, sensors, wearer and hand do not change.

The first ``meta`` of a run counts. One that says otherwise later is another publisher's, and is refused and
counted; what a run had not said yet, such as the hand of a glove that was not open, may still be said.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

OF_A_RUN = (
    "layout",
    "sensors",
    "context",
    "subject",
    "wearing",
    "hand",
    "simulated",
    "makes_poses",
    "computer",
)
RUNS_KEPT = 4
_UNKNOWN = (None, "unknown", [])
_SHOWN = 60


class RunMetas:
    """Of one glove. For one thread; ``refused`` and ``sentence`` may be read by others."""

    def __init__(self) -> None:
        self.refused: int = 0
        """Documents that contradicted an earlier one of their run."""
        self.sentence: str = ""
        """About the last of them; "" before the first."""
        self.contradicted: str = ""
        """The run of the last of them."""
        self._runs: dict[str, dict[str, Any]] = {}

    def of(self, run_id: str) -> dict[str, Any] | None:
        """What the run said of itself, ``run_id`` as 16 hexadecimal digits."""
        return self._runs.get(run_id)

    @property
    def newest(self) -> dict[str, Any] | None:
        """Of the run heard of last for the first time."""
        return next(reversed(self._runs.values()), None)

    def note(self, meta: Mapping[str, Any], *, keep: str = "") -> bool:
        """Take in a document; False where it contradicts its run. ``keep``: a run not to be forgotten."""
        run_id = str(meta.get("run_id") or "")
        earlier = self._runs.get(run_id)
        if earlier is None:
            self._make_room(keep)
            self._runs[run_id] = dict(meta)
            return True
        fixed = {name: earlier[name] for name in OF_A_RUN if earlier.get(name) not in _UNKNOWN}
        for name, value in fixed.items():
            if meta.get(name) not in (*_UNKNOWN, value):
                self._refuse(run_id, name, value, meta[name])
                return False
        self._runs[run_id] = {**meta, **fixed}
        return True

    def _make_room(self, keep: str) -> None:
        if len(self._runs) >= RUNS_KEPT:
            del self._runs[next(run for run in self._runs if run != keep)]

    def _refuse(self, run_id: str, name: str, before: Any, now: Any) -> None:
        self.refused += 1
        self.contradicted = run_id
        self.sentence = (
            f"another publisher says of run {run_id[:16]} that its {name} is {_short(now)}, "
            f"not {_short(before)}: refused"
        )


def _short(value: Any) -> str:
    text = ", ".join(map(str, value)) if isinstance(value, list) else str(value)
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]} ..."
