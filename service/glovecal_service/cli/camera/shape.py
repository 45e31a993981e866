"""``glovecal camera shape``: bone lengths and radii of a gloved hand, from a recording of it."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Annotated

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
    SubjectOption,
    worn_by,
)
from glovecal_service.cli.terminal.options import AsJson
from glovecal_service.cli.terminal.printing import out, print_json, print_table
from glovecal_service.cli.terminal.refusal import Refusal
from glovecal_service.cli.terminal.waiting import progress_bar
from glovecal_service.operating_system import as_typed

SUFFIX = ".json"


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
    colours: ColoursOption = None,
    calibration: CalibrationOption = None,
    subject: SubjectOption = None,
    hand: HandOption = None,
    entries: EntriesOption = 20_000,
    clips: ClipsOption = 36,
    data: DataOption = Path("glovecal-data"),
    as_json: AsJson = False,
) -> None:
    """Fit the hand's shape to 50 frames of a recording, for --shape of the verbs that track it.

    One camera cannot tell a large hand from a near one: measure the hand's length (glovecal subject), or use
    two calibrated cameras.
    """
    with camera_extra():
        from glovecal_client.signals import stopped_by_signals
        from glovecal_models.colour_glove.pose.hand_shape_fit import (
            MEASURED_SIZE_SD,
            SIZE_SD,
            fitted_hand_shape,
        )
        from glovecal_models.colour_glove.shape_file import ShapeOnFile, write_shape
        from glovecal_service.camera.camera_settings import TrackingSettings
        from glovecal_service.camera.recorded_estimates import Recordings
        from glovecal_service.camera.tracking_setup import tracking_setup

    if file.suffix != SUFFIX or not file.absolute().parent.is_dir():
        raise Refusal(f"{file} cannot be written: a shape ends in {SUFFIX}, in a folder that exists")
    sizes_mm, worn_on = worn_by(subject, hand)
    settings = TrackingSettings(
        data=data, hand=worn_on, colours=colours, calibration=calibration, entries=entries, clips=clips,
        sizes_mm=sizes_mm,
    )  # fmt: skip
    stop = threading.Event()
    with stopped_by_signals(stop):
        try:
            recorded = Recordings(recordings)
            with progress_bar(quiet=as_json) as report:
                setup = tracking_setup(settings, recorded.sources, report, stop.is_set)
            with progress_bar(quiet=as_json) as report:
                found = fitted_hand_shape(
                    setup.first, recorded.spread_labels(setup),
                    size_sd=MEASURED_SIZE_SD if "hand_length" in sizes_mm else SIZE_SD,
                    report=report, cancelled=stop.is_set,
                )  # fmt: skip
        except Cancelled as cancelled:
            raise Refusal(f"stopped; nothing was written to {file}") from cancelled
    kept = ShapeOnFile(
        setup.hand.skin.skeleton.hand, found.sizes_mm, found.radii_mm, found.size_sd, found.bones_sd
    )
    write_shape(file, kept)
    if as_json:
        print_json(
            {
                "file": str(file), "frames": len(found.used), "disagreeing_before": found.disagreeing_before,
                "disagreeing": found.disagreeing, **vars(kept),
            }
        )  # fmt: skip
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
    out.print(
        f"{len(found.used)} frames; colours that disagree: {100 * found.disagreeing_before:.1f} % of the "
        f"glove's pixels before, {100 * found.disagreeing:.1f} % with the shape."
    )
    if len(recorded.sources) == 1:
        out.print(
            f"One camera leaves the size open by {100 * found.size_sd:.0f} %: distances from the camera are "
            "as uncertain, angles are not."
        )
    out.print(f"Wrote {file}. Next: glovecal camera track SOURCE --glove GLOVE --shape {as_typed(file)}")
