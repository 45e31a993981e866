"""The account of a recording: every frame between its begin and its end, and what became of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from glovecal_service.recorder.pre_roll_request import PreRollRequest
from glovecal_service.recorder.reconciliation import Outcome
from glovecal_service.recorder.run_ledger import CAPTURE, RunLedger
from glovecal_service.store.recordings import PRE_ROLL


@dataclass(frozen=True)
class Settlement:
    """What the end of a recording, or an attempt to repair it, came to."""

    account: dict[str, Any]
    outcome: Outcome

    @classmethod
    def of(cls, file: RunLedger, outcome: Outcome, **told: Any) -> Settlement:
        """Of a file that was closed; ``told`` is as in ``recording_account``."""
        if file.lost_records:
            outcome = Outcome(False, "the disk is full")
        return cls(recording_account(file, complete=outcome.complete, **told), outcome)

    def given_up(self) -> Settlement:
        """What is pending is missing."""
        missing = {"missing": self.account["pending"], "missing_frames": self.account["pending_frames"]}
        account = self.account | missing | {"complete": True, "pending": [], "pending_frames": 0}
        return Settlement(account, Outcome(True, self.outcome.why))


def recording_account(
    file: RunLedger, *, complete: bool, refused: int = 0, why_shorter: str | None = None
) -> dict[str, Any]:
    """Facts for the recording's row; ``sent`` = ``recorded`` + ``missing_frames`` + ``pending_frames``.

    ``missing`` are ranges that no log has, known once the account is ``complete``; until then what is not
    recorded is ``pending``: it may still be fetched. The pre-roll is counted apart, and nothing of it is ever
    missing; ``why_shorter`` is a clause on why it is shorter than asked for.
    """
    wish = PreRollRequest.of_document(file.meta.get(PRE_ROLL))
    if why_shorter is None:
        why_shorter = "the recording was interrupted" if file.pre_roll_s < wish.most_s - 1.0 else ""
    runs = [books.document() for books in file.runs.values()]
    gaps = [gap for run in runs for gap in run["missing"]]
    frames = sum(last - first + 1 for first, last in gaps)
    said_later = {} if CAPTURE in file.meta or not file.capture else {CAPTURE: file.capture}
    return said_later | {
        "complete": complete,
        "first_sequence": runs[0]["first_sequence"] if runs else None,
        "last_sequence": runs[-1]["last_sequence"] if runs else None,
        "sent": sum(run["sent"] for run in runs),
        "recorded": sum(run["recorded"] for run in runs),
        "repaired": sum(run["repaired"] for run in runs),
        "missing": gaps if complete else [],
        "missing_frames": frames if complete else 0,
        "pending": [] if complete else gaps,
        "pending_frames": 0 if complete else frames,
        "refused": refused,
        PRE_ROLL: wish.account(len(file.pre_roll), file.pre_roll_s, why_shorter),
        "runs": runs,
        "file": file.path.name,
    }
