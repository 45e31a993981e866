"""``glovecal camera``: a file for each verb."""

from __future__ import annotations

import typer

from glovecal_service.cli.camera import calibrate, colours, estimates, patterns, shape, sheets, store, track

app = typer.Typer(help="A camera and the printed colour glove.", no_args_is_help=True)
app.command("sheets")(sheets.sheets)
app.command("calibrate")(calibrate.calibrate)
app.command("colours")(colours.colours)
app.command("store")(store.store)
app.command("patterns")(patterns.patterns)
app.command("shape")(shape.shape)
app.command("track")(track.track)
app.command("estimates")(estimates.estimates)
