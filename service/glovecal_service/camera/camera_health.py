"""How a camera does: what became of each picture, how late poses are, what is wrong with the view."""

from __future__ import annotations

import threading
import time
from collections import Counter, deque
from collections.abc import Mapping
from typing import Any

import numpy as np

from glovecal_models.colour_glove.hand_state import FINGER_ROTATIONS
from glovecal_models.colour_glove.pose_estimate import PoseEstimate

LAST_POSES = 300
"""Over which latencies and shares are told: 10 s at 30 Hz."""
SILENT_AFTER_S = 2.0
Sees = str
NOTHING_YET, HAND, NO_HAND = "nothing yet", "hand", "no hand"


class CameraHealth:
    """Written by the thread that tracks, read by others through ``document``."""

    def __init__(self) -> None:
        self.tracked = self.without_hand = self.unusable = 0
        self.sees: Sees = NOTHING_YET
        self.problem = ""
        """Why the last picture could not be used; empty where it could."""
        self.findings: Counter[str] = Counter()
        """Pictures checked in which each kind was found."""
        self.present: dict[str, str] = {}
        """Sentences of the newest picture that was checked, by kind."""
        self._lock = threading.Lock()
        self._latencies_ms: deque[float] = deque(maxlen=LAST_POSES)
        self._spent_ms: deque[float] = deque(maxlen=LAST_POSES)
        self._poses_at: deque[float] = deque(maxlen=LAST_POSES)
        self._accepted: deque[np.ndarray] = deque(maxlen=LAST_POSES)
        self._disagreeing: deque[float] = deque(maxlen=LAST_POSES)
        self._newest: PoseEstimate | None = None

    @property
    def decided(self) -> int:
        """Pictures that were taken and dealt with."""
        return self.tracked + self.without_hand + self.unusable

    def forget_poses(self) -> None:
        """What latencies and shares are told from begins anew."""
        with self._lock:
            self._forget_poses()

    def _forget_poses(self) -> None:
        for each in (
            self._latencies_ms, self._spent_ms, self._poses_at, self._accepted, self._disagreeing
        ):  # fmt: skip
            each.clear()

    def note_findings(self, found: Mapping[str, str]) -> None:
        """Sentences by kind."""
        with self._lock:
            self.present = dict(found)
            self.findings.update(self.present.keys())

    def note_pose(self, estimate: PoseEstimate, latency_ms: float, spent_ms: float) -> None:
        """``latency_ms`` from the picture's stamp to publication, ``spent_ms`` of it on labels and pose."""
        with self._lock:
            if self._newest is not None and estimate.stage != self._newest.stage:
                self._forget_poses()
            self.tracked += 1
            self.sees, self.problem = HAND, ""
            self._latencies_ms.append(latency_ms)
            self._spent_ms.append(spent_ms)
            self._poses_at.append(time.monotonic())
            self._accepted.append(estimate.accepted)
            self._disagreeing.append(estimate.disagreeing)
            self._newest = estimate

    def note_no_hand(self) -> None:
        with self._lock:
            self.without_hand += 1
            self.sees, self.problem = NO_HAND, ""

    def note_unusable(self, problem: str) -> None:
        with self._lock:
            self.unusable += 1
            self.problem = problem

    def document(self) -> dict[str, Any]:
        """Part of the status: counts, latencies in milliseconds, shares of the last poses."""
        with self._lock:
            newest = self._newest if self.sees == HAND else None
            accepted = np.array(self._accepted, dtype=bool).reshape(-1, len(FINGER_ROTATIONS))
            share = accepted.mean(axis=0) if len(accepted) else np.zeros(len(FINGER_ROTATIONS))
            return {
                "sees": self.sees,
                "problem": self.problem,
                "tracked": self.tracked,
                "without_hand": self.without_hand,
                "unusable": self.unusable,
                "findings": dict(self.present),
                "findings_counted": dict(self.findings),
                "pose_rate_hz": self._pose_rate_hz(),
                "latency_ms": _percentiles(self._latencies_ms),
                "computing_ms": _percentiles(self._spent_ms),
                "accepted_share": round(float(share.mean()), 3) if len(accepted) else None,
                "disagreeing": round(float(np.mean(self._disagreeing)), 3) if self._disagreeing else None,
                "position_mm": None if newest is None else newest.state.position_mm.round(1).tolist(),
                "position_sd_mm": None
                if newest is None
                else newest.standard_deviation[23:].round(1).tolist(),
                "patches": None if newest is None else list(newest.patches),
                "rotations": [] if newest is None else _rotations(newest, share),
            }

    def _pose_rate_hz(self) -> float:
        times = self._poses_at
        if len(times) < 2 or time.monotonic() - times[-1] > SILENT_AFTER_S:
            return 0.0
        return round((len(times) - 1) / max(times[-1] - times[0], 1e-9), 2)


def _rotations(estimate: PoseEstimate, share: np.ndarray) -> list[dict[str, Any]]:
    return [
        {
            "name": name,
            "degrees": round(float(degrees), 2),
            "sd_deg": round(float(sd), 2),
            "accepted": bool(accepted),
            "accepted_share": round(float(often), 3),
        }
        for name, degrees, sd, accepted, often in zip(
            FINGER_ROTATIONS, estimate.state.angles_deg, estimate.standard_deviation[:20],
            estimate.accepted, share, strict=True,
        )
    ]  # fmt: skip


def _percentiles(values: deque[float]) -> dict[str, float] | None:
    if not values:
        return None
    half, most, worst = np.percentile(np.array(values), (50, 95, 100))
    return {"p50": round(half, 2), "p95": round(most, 2), "max": round(worst, 2)}
