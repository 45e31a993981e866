"""``glovecal watch``: the live poses of a glove in the terminal."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from glovecal_client.errors import NoAnswer
from glovecal_service.cli.terminal.options import DEFAULT_ZENOH, AsJson, Glove, Site, Zenoh
from glovecal_service.cli.terminal.printing import NobodyThere, Refusal, err, out, show

if TYPE_CHECKING:
    import zenoh

    from glovecal_client.pose_subscriber import PoseSubscriber
    from glovecal_client.wire.pose import Pose

REDRAW_S = 0.1
WAIT_S = 5.0
HINT_AFTER_S = 3.0
WIDEST_BAR, DEGREES_A_BLOCK = 30, 4.0


def watch(
    glove: Glove,
    seconds: Annotated[float | None, typer.Option(min=0.1, help="Stop after this many seconds.")] = None,
    connect: Zenoh = DEFAULT_ZENOH,
    site: Site = "lab",
    as_json: AsJson = False,
) -> None:
    """Show a glove's calibrated rotations live; with --json one line per pose. Ctrl-C stops it."""
    from glovecal_client.pose_subscriber import PoseSubscriber
    from glovecal_client.session import open_client

    try:
        with open_client([connect], wait_s=WAIT_S) as session, PoseSubscriber(session, site, glove) as poses:
            until = None if seconds is None else time.monotonic() + seconds
            with suppress(KeyboardInterrupt):
                _follow(poses, _Counts(session, site, glove), glove, until, as_json)
            came = poses.latest is not None
    except NoAnswer as error:
        raise NobodyThere(str(error)) from error
    if not came:
        raise Refusal(f"no pose of glove {glove} received; {_HINT}")


_HINT = "check that it is captured (glovecal glove list shows the gloves seen) and at this site"


class _Counts:
    """What the service says became of the glove's frames, once a second."""

    def __init__(self, session: zenoh.Session, site: str, glove: str) -> None:
        import zenoh

        from glovecal_client.session import ask
        from glovecal_service.realtime.service_status import all_service_statuses

        self.newest: dict[str, int] | None = None
        self.warnings: list[str] = []
        self._glove = glove
        handler = zenoh.handlers.Callback(self._hear, indirect=True)
        self._subscriber = session.declare_subscriber(all_service_statuses(site), handler)
        with suppress(NoAnswer):
            for answer in ask(session, all_service_statuses(site), timeout_s=1.0):
                self._hear(answer)

    def _hear(self, sample: zenoh.Sample) -> None:
        from glovecal_client.session import json_object

        self._note(json_object(sample.payload.to_bytes()) or {})

    def _note(self, status: dict[str, Any]) -> None:
        counts = status.get("gloves", {}).get(self._glove)
        if counts is None:  # another process has the glove
            return
        self.warnings = [f"{one['sentence']} {one['advice']}" for one in counts.get("warnings", [])]
        if "sent" in counts:
            names = ("sent", "received", "missing", "predicted", "skipped")
            refused = sum(counts["refused"].values())
            self.newest = {**{name: counts[name] for name in names}, "refused": refused}


def _follow(poses: PoseSubscriber, counts: _Counts, glove: str, until: float | None, as_json: bool) -> None:
    if not as_json and out.is_terminal:
        with Live(console=out, auto_refresh=False) as live:
            for pose in _poses(poses, until, glove):
                live.update(_picture(poses, counts, pose, glove), refresh=True)
        return
    last = None
    for pose in _poses(poses, until, glove):
        if pose is None:
            continue
        last = pose
        if as_json and (document := _document(poses, counts, pose)) is not None:
            sys.stdout.write(json.dumps(document) + "\n")
            sys.stdout.flush()
    if last is not None and not as_json:
        show(_picture(poses, counts, last, glove))


def _poses(poses: PoseSubscriber, until: float | None, glove: str) -> Iterator[Pose | None]:
    """The newest pose whenever there is one, None when nothing came for a moment."""
    hint_at = time.monotonic() + HINT_AFTER_S
    while until is None or time.monotonic() < until:
        yield poses.wait(REDRAW_S)
        if time.monotonic() > hint_at and poses.latest is None:
            err.print(f"No pose of glove {glove} yet; {_HINT}")
            hint_at = float("inf")


def _names(poses: PoseSubscriber, pose: Pose) -> tuple[str, ...] | None:
    """Names of the pose's rotations; None for the moment in which the service changes to another model."""
    if not len(pose.degrees):
        return ()
    try:
        return poses.rotations(pose)
    except NoAnswer:
        return None


def _document(poses: PoseSubscriber, counts: _Counts, pose: Pose) -> dict[str, Any] | None:
    names = _names(poses, pose)
    if names is None:
        return None
    return {
        "sequence": pose.sequence,
        "state": _state(poses, pose),
        **({} if pose.model_sha256 else {"why": poses.explanation()}),
        "model": pose.model_sha256,
        "age_ms": pose.age_us / 1000,
        "skipped": pose.skipped,
        "frames": counts.newest,
        "warnings": counts.warnings,
        "degrees": dict(zip(names, (round(float(v), 3) for v in pose.degrees), strict=True)),
        "sd_deg": dict(zip(names, (round(float(v), 3) for v in pose.deviations), strict=True)),
    }


def _picture(poses: PoseSubscriber, counts: _Counts, pose: Pose | None, glove: str) -> Group:
    """A line on the whole pose, one on the glove's frames, then a table with a line for each rotation."""
    pose = pose or poses.latest
    if pose is None:
        return Group(Text(f"{glove}: no pose yet", style="bold"))
    why = f": {poses.explanation()}" if poses.explanation() else ""
    model = f"model {pose.model_sha256[:12]}" if pose.model_sha256 else "no model is active"
    title = f"{glove}: {_state(poses, pose)}; {model}{why}; age {pose.age_us / 1000:.1f} ms"
    names = _names(poses, pose)
    frames = ", ".join(f"{name} {count}" for name, count in (counts.newest or {}).items())
    lines = [Text(f"frames: {frames}")] if frames else []
    lines += [Text(warning, style="yellow") for warning in counts.warnings]
    return Group(Text(title, style="bold"), *lines, *([_rotations(names, pose)] if names else []))


def _rotations(names: tuple[str, ...], pose: Pose) -> Table:
    table = Table(box=None, pad_edge=False)
    for heading in ("rotation", "degrees", "± sd", ""):
        table.add_column(heading, justify="right" if heading in ("degrees", "± sd") else "left")
    for name, degrees, deviation in zip(names, pose.degrees, pose.deviations, strict=True):
        blocks = max(0, min(WIDEST_BAR, round(float(degrees) / DEGREES_A_BLOCK)))
        table.add_row(name, f"{degrees:.1f}", f"{deviation:.1f}", "█" * blocks)
    return table


def _state(poses: PoseSubscriber, pose: Pose) -> str:
    said = [word for word in pose.words if word not in ("stale", "state reset")]
    return ", ".join((["stale"] if poses.stale else []) + said) or "ok"
