"""``glovecal bridge``: live poses of gloves, sent on to another tool."""

from __future__ import annotations

import json
import sys
import threading
import time
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand

from glovecal_service.cli.terminal.options import DEFAULT_ZENOH, AsJson, Site, Zenoh
from glovecal_service.cli.terminal.printing import NobodyThere, err, out, print_table

if TYPE_CHECKING:
    from glovecal_service.bridges.bridge import Bridge
    from glovecal_service.bridges.traffic import Traffic

_EVERY_S = 1.0
_WAIT_S = 5.0


class WithBridgeOptions(TyperCommand):
    """Its help ends with the options of every bridge."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        from glovecal_service.bridges.catalogue import BRIDGES

        lines = []
        for name, kind in BRIDGES.items():
            explained = "; ".join(f"{option}: {text}" for option, text in kind.options.items())
            lines.append(f"{name} ({kind.about}). {explained}.")
        self.epilog = "\n\n".join(lines)
        super().format_help(ctx, formatter)


def bridge(
    name: Annotated[str | None, typer.Argument(help="Which, see below. Without it: a list.")] = None,
    glove: Annotated[
        list[str] | None, typer.Option("--glove", help="Glove to send on; repeatable. Default: all.")
    ] = None,
    to: Annotated[str | None, typer.Option(help="Where to send to, of bridges that send.")] = None,
    port: Annotated[
        int | None, typer.Option(min=0, max=65535, help="Port to listen on, of bridges that listen.")
    ] = None,
    option: Annotated[
        list[str] | None, typer.Option(help="KEY=VALUE for the bridge, see below; repeatable.")
    ] = None,
    seconds: Annotated[float | None, typer.Option(min=0.1, help="Default: until Ctrl-C.")] = None,
    connect: Zenoh = DEFAULT_ZENOH,
    site: Site = "lab",
    as_json: AsJson = False,
) -> None:
    """Send gloves' live poses on to another tool. Ctrl-C stops it.

    Once a second it prints rate, poses left out, reconnects and added delay; with --json as a line of JSON.
    """
    from glovecal_client.capture.command import parse_options
    from glovecal_client.errors import NoAnswer
    from glovecal_client.program import stopped_by_signals
    from glovecal_client.session import open_client
    from glovecal_service.bridges.bridge import GIL_SWITCH_S, BridgeOptions, LiveGloves
    from glovecal_service.bridges.catalogue import bridge_class
    from glovecal_service.bridges.traffic import Traffic
    from glovecal_service.operating_system import go_first

    if name is None:
        _list_bridges(as_json)
        return
    kind = bridge_class(name)
    options = BridgeOptions(to, port, parse_options(option or []))
    options.check(name, kind.options)
    traffic, stop = Traffic(), threading.Event()
    made = kind(options, traffic)
    sys.setswitchinterval(GIL_SWITCH_S)
    go_first()
    try:
        with (
            stopped_by_signals(stop),
            open_client([connect], wait_s=_WAIT_S, cancelled=stop.is_set) as session,
            made as opened,
            LiveGloves(session, site, glove or [], opened, traffic),
        ):
            err.print(f"{opened.where} When poses are stale or uncalibrated: {kind.when_stale}.")
            _report(opened, traffic, stop, seconds, as_json)
            whole = {**traffic.document(), "receivers": opened.receivers}
    except NoAnswer as error:
        raise NobodyThere(str(error)) from error
    if as_json:
        _print_line({"summary": whole})
    else:
        out.print(f"Since the start: {_sentence(whole)}.")


def _list_bridges(as_json: bool) -> None:
    from glovecal_service.bridges.catalogue import BRIDGES

    rows = [
        {"name": name, "about": kind.about, "when_stale": kind.when_stale, "options": kind.options}
        for name, kind in BRIDGES.items()
    ]
    if as_json:
        _print_line(rows)
        return
    print_table(
        rows, {"name": "bridge", "about": "for", "when_stale": "when stale or uncalibrated"}, empty=""
    )
    out.print("\nglovecal bridge NAME --glove right --glove left; glovecal bridge --help tells the options.")


def _report(
    opened: Bridge, traffic: Traffic, stop: threading.Event, seconds: float | None, as_json: bool
) -> None:
    """One line a second until it is over."""
    until = float("inf") if seconds is None else time.monotonic() + seconds
    while not stop.wait(max(0.0, min(_EVERY_S, until - time.monotonic()))) and time.monotonic() < until:
        recent = {**traffic.recent(), "receivers": opened.receivers}
        if as_json:
            _print_line(recent)
        elif out.is_terminal:
            out.print(_sentence(recent))


def _print_line(document: Any) -> None:
    sys.stdout.write(json.dumps(document) + "\n")
    sys.stdout.flush()


def _sentence(document: dict[str, Any]) -> str:
    gloves = document["gloves"]
    parts = [_of_glove(name, each) for name, each in gloves.items()] or ["no pose yet"]
    if document["receivers"] is not None:
        parts.append(f"receivers {document['receivers']}")
    for key, what in (("added_ms", "added"), ("finger_to_wire_ms", "finger to wire")):
        if document[key] is not None:
            parts.append(f"{what} {document[key]['p50']:.2f} ms (p99 {document[key]['p99']:.2f})")
    return "; ".join(parts)


def _of_glove(name: str, counts: dict[str, Any]) -> str:
    rate = f"{counts['rate_hz']:.0f} Hz" if "rate_hz" in counts else f"{counts['received']} poses"
    state = counts["state"] or "no pose yet"
    lost = counts["lost"] + counts["overtaken"]
    return (
        f"{name} {rate}, {state}, sent {counts['sent']}, lost {lost}, "
        f"left out {counts['left_out']}, reconnects {counts['reconnects']}"
    )
