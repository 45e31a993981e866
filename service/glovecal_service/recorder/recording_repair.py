"""Repairing a recording whose file is closed, from the capture log."""

from __future__ import annotations

from pathlib import Path
from threading import Event

from glovecal_client.errors import NoAnswer
from glovecal_service.recorder.capture_log import CaptureLog
from glovecal_service.recorder.reconciliation import Patience, reconcile
from glovecal_service.recorder.recording_account import Settlement
from glovecal_service.recorder.run_ledger import RunLedger

REPAIR_WITHIN_S = 60.0


def repair(
    path: Path,
    log: CaptureLog,
    stop_wall_ns: int | None,
    *,
    refused: int,
    stopped: Event,
    last_try: bool,
) -> Settlement | None:
    """One attempt; None while capture does not answer. Raises DamagedLog, OSError.

    ``refused`` is what was counted while it was recorded; the rest is as in ``reconcile``. What the
    ``last_try`` does not bring is missing.
    """
    try:
        log.standing()
    except NoAnswer:
        if not last_try:
            return None
    found = settle(path, log, stop_wall_ns, refused=refused, patience=Patience(REPAIR_WITHIN_S, stopped))
    return found.given_up() if last_try else found


def settle(
    path: Path,
    log: CaptureLog,
    stop_wall_ns: int | None,
    *,
    refused: int,
    patience: Patience,
) -> Settlement:
    """The account of a closed file, repaired as far as ``patience`` allows."""
    file = RunLedger.resume(path)
    try:
        outcome = reconcile(file, log, stop_wall_ns, patience)
    finally:
        file.close()
    return Settlement.of(file, outcome, refused=refused)
