"""``glovecal camera estimates`` and ``shape``: what recordings of the colour glove give.

Angles for a take's reference; and bone lengths and radii of the gloved hand.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from glovecal_models.errors import BadInput, Cancelled
from glovecal_service.cli.camera.tracking_options import TrackingOptions, camera_extra
from glovecal_service.cli.terminal.options import AsJson
from glovecal_service.cli.terminal.printing import Refusal, err, out, print_json, print_table
from glovecal_service.cli.terminal.waiting import progress_bar
from glovecal_service.operating_system import as_typed

if TYPE_CHECKING:
    from glovecal_models.colour_glove.pose.hand_shape_fit import FittedShape
    from glovecal_models.progress import Cancel
    from glovecal_service.camera.camera_settings import TrackingSettings
    from glovecal_service.camera.recorded_estimates import Recordings, TrackedRecordings
    from glovecal_service.camera.tracking_setup import TrackingSetup

    _SetUp = tuple[TrackingSettings, Recordings, TrackingSetup, Cancel]

ESTIMATES = ("a file of estimates", ".npz")
SHAPE = ("a shape", ".json")


def estimates(
    recordings: Annotated[
        list[Path],
        typer.Argument(
            help="A recording, or those of two cameras before the same hand: videos (.mkv, or a phone's .mp4 "
            "or .mov) or files of label images (.labels).",
            exists=True,
            dir_okay=False,
            show_default=False,
        ),
    ],
    file: Annotated[Path, typer.Option("--out", help="File of estimates to write (.npz).", dir_okay=False)],
    tracking: TrackingOptions,
    as_json: AsJson = False,
) -> None:
    """Track every frame of a recording and write what glovecal take camera makes a take's reference of.

    The hand's shape in its glove is fitted to the recording first, unless --shape gives it. Frames of two
    cameras are matched by their times; --calibration then holds both. Ctrl-C writes nothing.
    """
    with camera_extra():
        from glovecal_models.takes.camera_estimates import write_estimates

    fit, sentence = dict[str, Any](), ""
    with _set_up(recordings, file, ESTIMATES, tracking, quiet=as_json) as given:
        settings, recorded, setup, cancelled = given
        if not setup.is_calibrated:
            err.print(
                "The camera is not calibrated: focal length and distortion are assumed; "
                "glovecal camera calibrate measures them."
            )
        if settings.shape is None and settings.stage == "dense":
            try:
                fitted = _fitted(given, quiet=as_json)
                setup = setup.fitted(fitted.shape)
                fit, sentence = _agreement(fitted), f"The hand's shape was fitted to {_agreed(fitted)}"
            except BadInput as refused:
                fit = {"refused": str(refused)}
                sentence = f"The hand's shape was not fitted, and stays as its sizes say: {refused}."
        with progress_bar(quiet=as_json) as report:
            found = recorded.tracked(setup, tracking.stage.value, report, cancelled)
        write_estimates(found.estimates, file)
    if as_json:
        print_json({**_document(found, file), "shape": fit})
    else:
        if sentence:
            out.print(sentence)
        _print(found, file)


def _fitted(given: _SetUp, *, quiet: bool) -> FittedShape:
    settings, recorded, setup, cancelled = given
    with progress_bar(quiet=quiet) as report:
        return recorded.fitted_shape(
            setup, is_measured="hand_length" in settings.sizes_mm, report=report, cancelled=cancelled
        )


def _agreement(fitted: FittedShape) -> dict[str, Any]:
    return {
        "frames": len(fitted.used),
        "disagreeing_before": fitted.disagreeing_before,
        "disagreeing": fitted.disagreeing,
    }


def _agreed(fitted: FittedShape) -> str:
    return (
        f"{len(fitted.used)} frames; colours that disagree: {100 * fitted.disagreeing_before:.1f} % of the "
        f"glove's pixels before, {100 * fitted.disagreeing:.1f} % with the shape."
    )


def _print(found: TrackedRecordings, file: Path) -> None:
    for each in found.counts:
        left_out = {
            "stamped twice": each.stamped_twice,
            "without a frame of the other camera": each.unmatched,
            "unreadable": each.unreadable,
        }
        said = "".join(f", {count} {what}" for what, count in left_out.items() if count)
        out.print(f"{each.name}: {each.frames} frames at {each.rate_hz:.1f} Hz ({each.times}){said}.")
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
    if found.advice:
        out.print(found.advice)
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
        "advice": found.advice,
        "seconds": found.took_s,
        "accepted_share": float(said.accepted.mean()),
        "rotations": _rotations(found),
    }


@contextmanager
def _set_up(
    recordings: list[Path], file: Path, kind: tuple[str, str], tracking: TrackingOptions, *, quiet: bool
) -> Iterator[_SetUp]:
    """What the recordings are tracked with. ``kind``: what ``file`` is to be, and how its name ends.

    Raises Refusal for a file that cannot be written, and once Ctrl-C has stopped it.
    """
    with camera_extra():
        from glovecal_client.program import stopped_by_signals
        from glovecal_service.camera.camera_settings import TrackingSettings
        from glovecal_service.camera.recorded_estimates import Recordings
        from glovecal_service.camera.tracking_setup import tracking_setup

    what, suffix = kind
    if file.suffix != suffix or not file.absolute().parent.is_dir():
        raise Refusal(f"{file} cannot be written: {what} ends in {suffix}, in a folder that exists")
    settings = TrackingSettings(**tracking.settings())
    stop = threading.Event()
    with stopped_by_signals(stop):
        try:
            recorded = Recordings(recordings)
            with progress_bar(quiet=quiet) as report:
                setup = tracking_setup(settings, recorded.sources, report, stop.is_set)
            yield settings, recorded, setup, stop.is_set
        except Cancelled as cancelled:
            raise Refusal(f"stopped; nothing was written to {file}") from cancelled


def prepare(tracking: TrackingOptions) -> None:
    """Build what tracking needs before any picture is there: while the sheets are printed and sewn.

    The pose database of this hand, and the glove's colours. Kept in the data folder; then a start of glovecal
    camera track takes seconds.
    """
    with camera_extra():
        from glovecal_client.program import stopped_by_signals
        from glovecal_service.camera.camera_settings import TrackingSettings
        from glovecal_service.camera.tracking_setup import prepared

    settings, stop = TrackingSettings(**tracking.settings()), threading.Event()
    began = time.monotonic()
    with stopped_by_signals(stop):
        try:
            with progress_bar() as report:
                folder = prepared(settings, report, stop.is_set)
        except Cancelled as cancelled:
            raise Refusal("stopped; what was finished is kept") from cancelled
    out.print(f"Ready after {time.monotonic() - began:.0f} s, in {as_typed(folder)}.")
    out.print("Next: glovecal camera track SOURCE --glove GLOVE")


def shape(
    recordings: Annotated[
        list[Path],
        typer.Argument(
            help="A recording, or those of two cameras before the same hand: at least 20 different poses, "
            "slowly, the whole glove in view.",
            exists=True,
            dir_okay=False,
            show_default=False,
        ),
    ],
    file: Annotated[Path, typer.Option("--out", help="File of the shape to write (.json).", dir_okay=False)],
    tracking: TrackingOptions,
    as_json: AsJson = False,
) -> None:
    """Fit the hand's shape to 50 frames of a recording, for --shape of the verbs that track it.

    One camera cannot tell a large hand from a near one: measure the hand's length (glovecal subject), or use
    two calibrated cameras.
    """
    with camera_extra():
        from glovecal_models.colour_glove.hand_shape import write_shape

    with _set_up(recordings, file, SHAPE, tracking, quiet=as_json) as given:
        recorded, setup = given[1:3]
        fitted = _fitted(given, quiet=as_json)
    found = fitted.shape
    write_shape(file, found)
    if as_json:
        print_json({"file": str(file), **_agreement(fitted), **vars(found)})
        return
    before = setup.hand.skin.skeleton.dimensions.sizes_mm
    rows = [
        {
            "length": name,
            "before": f"{before[name]:.1f}",
            "found": f"{found.sizes_mm[name]:.1f}",
            "sd": f"{sd * found.sizes_mm[name]:.1f}",
        }
        for name, sd in {"hand_length": found.size_sd, **found.bones_sd}.items()
    ]
    heads = {"length": "length", "before": "before, mm", "found": "found, mm", "sd": "standard deviation, mm"}
    print_table(rows, heads, empty="")
    out.print(_agreed(fitted))
    if len(recorded.sources) == 1:
        out.print(
            f"One camera leaves the size open by {100 * found.size_sd:.0f} %: distances from the camera are "
            "as uncertain, angles are not."
        )
    out.print(f"Wrote {file}. Next: glovecal camera track SOURCE --glove GLOVE --shape {as_typed(file)}")
