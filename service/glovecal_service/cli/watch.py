"""``glovecal watch``: the live poses of a glove in the terminal."""

from __future__ import annotations

import json
import os
import sys
import time
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.live import Live
from rich.table import Table

from glovecal_service.cli.options import AsJson
from glovecal_service.cli.printing import out

if TYPE_CHECKING:
    from glovecal_client.pose_subscriber import PoseSubscriber
    from glovecal_client.wire.pose import Pose

REDRAW_S = 0.1
WAIT_S = 5.0


def watch(
    glove: Annotated[str, typer.Argument(help="The glove's name.")],
    seconds: Annotated[float | None, typer.Option(help="Stop after so many seconds.")] = None,
    connect: Annotated[str | None, typer.Option(help="The service's zenoh endpoint.")] = None,
    site: Annotated[str, typer.Option(envvar="GLOVECAL_SITE")] = "lab",
    as_json: AsJson = False,
) -> None:
    """Show a glove's calibrated rotations as they come; with --json one line a pose."""
    from glovecal_client.pose_subscriber import PoseSubscriber
    from glovecal_client.session import DEFAULT_ENDPOINT, open_client

    endpoint = connect or os.environ.get("GLOVECAL_ZENOH", DEFAULT_ENDPOINT)
    until = None if seconds is None else time.monotonic() + seconds
    with open_client([endpoint], wait_s=WAIT_S) as session, PoseSubscriber(session, site, glove) as poses:
        if as_json:
            _print_lines(poses, until)
        else:
            _draw(poses, glove, until)


def _print_lines(poses: PoseSubscriber, until: float | None) -> None:
    while until is None or time.monotonic() < until:
        pose = poses.wait(REDRAW_S)
        if pose is not None:
            sys.stdout.write(json.dumps(_document(poses, pose)) + "\n")
            sys.stdout.flush()


def _draw(poses: PoseSubscriber, glove: str, until: float | None) -> None:
    with Live(console=out, refresh_per_second=10) as live:
        while until is None or time.monotonic() < until:
            pose = poses.wait(REDRAW_S)
            live.update(_table(poses, pose or poses.latest, glove))


def _document(poses: PoseSubscriber, pose: Pose) -> dict[str, Any]:
    names = poses.rotations(pose) if len(pose.degrees) else ()
    return {
        "sequence": pose.sequence,
        "state": _state(poses, pose),
        "model": pose.model_sha256,
        "age_ms": pose.age_us / 1000,
        "skipped": pose.skipped,
        "degrees": dict(zip(names, (round(float(v), 3) for v in pose.degrees), strict=True)),
        "sd_deg": dict(zip(names, (round(float(v), 3) for v in pose.deviations), strict=True)),
    }


def _table(poses: PoseSubscriber, pose: Pose | None, glove: str) -> Table:
    if pose is None:
        return Table(title=f"{glove}: no pose yet. Is it captured, and is the service running?")
    model = pose.model_sha256[:12] if pose.model_sha256 else "none"
    table = Table(
        title=f"{glove}: {_state(poses, pose)}, model {model}, age {pose.age_us / 1000:.1f} ms", box=None
    )
    for heading in ("rotation", "degrees", "± sd", ""):
        table.add_column(heading, justify="left" if heading in ("rotation", "") else "right")
    if len(pose.degrees):
        for index, name in enumerate(poses.rotations(pose)):
            bar = "█" * max(0, min(40, round(float(pose.degrees[index]) / 3)))
            table.add_row(name, f"{pose.degrees[index]:.1f}", f"{pose.deviations[index]:.1f}", bar)
    return table


def _state(poses: PoseSubscriber, pose: Pose) -> str:
    from glovecal_client.wire.pose import PoseFlag

    words = {
        PoseFlag.UNCALIBRATED: "uncalibrated",
        PoseFlag.EXTRAPOLATING: "extrapolating",
        PoseFlag.TOO_UNCERTAIN: "too uncertain",
        PoseFlag.SIMULATED: "simulated glove",
    }
    said = [word for flag, word in words.items() if pose.flags & flag]
    return ", ".join((["stale"] if poses.stale else []) + said) or "ok"
