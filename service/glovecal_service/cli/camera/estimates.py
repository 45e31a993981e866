"""``glovecal camera estimates``: recorded pictures of the colour glove to angles, for a take's reference."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from glovecal_models.errors import Cancelled
from glovecal_service.cli.camera.extra import camera_extra
from glovecal_service.cli.camera.tracking_options import (
    CalibrationOption,
    ClipsOption,
    ColoursOption,
    DataOption,
    EntriesOption,
    HandOption,
    ShapeOption,
    Stage,
    StageOption,
    SubjectOption,
    worn_by,
)
from glovecal_service.cli.terminal.options import AsJson
from glovecal_service.cli.terminal.printing import err, out, print_json, print_table
from glovecal_service.cli.terminal.refusal import Refusal
from glovecal_service.cli.terminal.waiting import progress_bar
from glovecal_service.operating_system import as_typed

if TYPE_CHECKING:
    from glovecal_service.camera.recorded_estimates import TrackedRecordings

SUFFIX = ".npz"


def estimates(
    recordings: Annotated[
        list[Path],
        typer.Argument(
            help="A recording, or those of two cameras before the same hand: videos (.mkv with its times "
            "beside it) or files of label images (.labels).",
            exists=True,
            dir_okay=False,
            show_default=False,
        ),
    ],
    file: Annotated[Path, typer.Option("--out", help="File of estimates to write (.npz).", dir_okay=False)],
    stage: StageOption = Stage.dense,
    colours: ColoursOption = None,
    calibration: CalibrationOption = None,
    shape: ShapeOption = None,
    subject: SubjectOption = None,
    hand: HandOption = None,
    entries: EntriesOption = 20_000,
    clips: ClipsOption = 36,
    data: DataOption = Path("glovecal-data"),
    as_json: AsJson = False,
) -> None:
    """Track every frame of a recording and write what glovecal take camera makes a take's reference of.

    Frames of two cameras are matched by their times; --calibration then holds both. Ctrl-C writes nothing.
    """
    with camera_extra():
        from glovecal_client.signals import stopped_by_signals
        from glovecal_models.takes.camera_reference.estimates import write_estimates
        from glovecal_service.camera.camera_settings import TrackingSettings
        from glovecal_service.camera.recorded_estimates import Recordings
        from glovecal_service.camera.tracking_setup import tracking_setup

    if file.suffix != SUFFIX or not file.absolute().parent.is_dir():
        raise Refusal(
            f"{file} cannot be written: a file of estimates ends in {SUFFIX}, in a folder that exists"
        )
    sizes_mm, worn_on = worn_by(subject, hand)
    settings = TrackingSettings(
        data=data, hand=worn_on, stage=stage.value, colours=colours, calibration=calibration, shape=shape,
        entries=entries, clips=clips, sizes_mm=sizes_mm,
    )  # fmt: skip
    stop = threading.Event()
    with stopped_by_signals(stop):
        try:
            recorded = Recordings(recordings)
            with progress_bar(quiet=as_json) as report:
                setup = tracking_setup(settings, recorded.sources, report, stop.is_set)
            if not setup.is_calibrated:
                err.print(
                    "The camera is not calibrated: focal length and distortion are assumed; "
                    "glovecal camera calibrate measures them."
                )
            with progress_bar(quiet=as_json) as report:
                found = recorded.tracked(setup, settings.stage, report, stop.is_set)
        except Cancelled as cancelled:
            raise Refusal(f"stopped; nothing was written to {file}") from cancelled
        write_estimates(found.estimates, file)
    if as_json:
        print_json(_document(found, file))
    else:
        _print(found, file)


def _print(found: TrackedRecordings, file: Path) -> None:
    for each in found.counts:
        left_out = {
            "stamped twice": each.stamped_twice,
            "without a frame of the other camera": each.unmatched,
            "unreadable": each.unreadable,
        }
        said = "".join(f", {count} {what}" for what, count in left_out.items() if count)
        out.print(f"{each.name}: {each.frames} frames at {each.rate_hz:.1f} Hz{said}.")
        if each.ended:
            out.print(f"  {each.ended}.")
    said = found.estimates
    frames = len(said.time_s)
    out.print(
        f"{frames} frames tracked in {found.took_s:.0f} s ({frames / found.took_s:.1f} frames/s): "
        f"{found.without_hand} without a hand, {found.none_accepted} with a hand of which no rotation is "
        f"accepted, {found.unusable} unusable{': ' + found.problem if found.problem else ''}."
    )
    for kind, count in found.findings.items():
        out.print(f"{kind}: {count} frames, no rotation is accepted of them.")
    columns = {
        "rotation": "rotation",
        "accepted": "accepted, % of frames",
        "sd_accepted": "mean SD of accepted, degrees",
        "sd": "mean SD of all, degrees",
    }
    rows = [
        {
            "rotation": row["rotation"],
            "accepted": f"{100 * row['accepted_share']:.0f}",
            "sd_accepted": _degrees(row["mean_sd_accepted_deg"]),
            "sd": _degrees(row["mean_sd_deg"]),
        }
        for row in _rotations(found)
    ]
    print_table(rows, columns, empty="")
    drawn = " The pictures were rendered: the estimates are marked as simulated." if said.simulated else ""
    out.print(f"{100 * said.accepted.mean():.0f} % of all angles are accepted. Wrote {file}.{drawn}")
    out.print(f"Next: glovecal take camera TAKE {as_typed(file)}")


def _degrees(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"


def _rotations(found: TrackedRecordings) -> list[dict[str, Any]]:
    """Accepted share of all frames, and mean standard deviations in degrees; None: of no frame."""
    said = found.estimates
    rows = []
    for column, name in enumerate(said.rotations):
        sd, accepted = said.sd_deg[:, column], said.accepted[:, column]
        known = sd[np.isfinite(sd)]
        rows.append(
            {
                "rotation": name,
                "accepted_share": float(accepted.mean()),
                "mean_sd_accepted_deg": float(sd[accepted].mean()) if accepted.any() else None,
                "mean_sd_deg": float(known.mean()) if len(known) else None,
            }
        )
    return rows


def _document(found: TrackedRecordings, file: Path) -> dict[str, Any]:
    said = found.estimates
    return {
        "file": str(file),
        "frames": len(said.time_s),
        "simulated": said.simulated,
        "recordings": [vars(each) for each in found.counts],
        "without_hand": found.without_hand,
        "none_accepted": found.none_accepted,
        "unusable": found.unusable,
        "problem": found.problem,
        "findings": found.findings,
        "seconds": found.took_s,
        "accepted_share": float(said.accepted.mean()),
        "rotations": _rotations(found),
    }
