"""A sampling in the terminal: what is said, a bar that shows how still the hand is, and the user's keys."""

from __future__ import annotations

import time
from contextlib import nullcontext
from typing import TYPE_CHECKING, Any

from rich.live import Live
from rich.text import Text

from glovecal_client.errors import ServiceError
from glovecal_service.cli.terminal.printing import err, out
from glovecal_service.operating_system import single_keys

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient

LOOK_EVERY_S = 0.12
TAKES_WITHIN_S = 60.0
BAR = 20
KEYS = {" ": "go", "r": "redo", "u": "undo", "s": "skip", "q": "pause"}
HELP = "space: start   r: repeat   u: undo   s: skip   q: pause"


def walk(service: RestClient, view: dict[str, Any], *, quiet: bool = False) -> dict[str, Any]:
    """Follow the sampling to its end, or until the user pauses; the last view of it."""
    path, said = f"/sampling/{view['id']}", 0
    shown = Live(console=out, auto_refresh=False, transient=True) if out.is_terminal and not quiet else None
    with shown or nullcontext(), single_keys() as key:
        try:
            while view["phase"] not in ("done", "stopped", "paused"):
                if view["say_number"] > said and not quiet:
                    out.print(view["say"])
                said = max(said, view["say_number"])
                if shown is not None:
                    shown.update(_picture(view), refresh=True)
                event = KEYS.get(key(LOOK_EVERY_S))
                view = service.get(path) if event is None else _send(service, path, event)
        except KeyboardInterrupt:
            return service.post(f"{path}/pause")
    if not quiet:
        out.print(view["say"])
    return view if view["phase"] == "paused" else _with_takes(service, path)


def _send(service: RestClient, path: str, event: str) -> dict[str, Any]:
    try:
        return service.post(f"{path}/{event}")
    except ServiceError as error:
        if error.status != 409:
            raise
        err.print(error.detail)
        return service.get(path)


def _with_takes(service: RestClient, path: str) -> dict[str, Any]:
    until = time.monotonic() + TAKES_WITHIN_S
    while (view := service.get(path))["open"] and time.monotonic() < until:
        time.sleep(LOOK_EVERY_S)
    return view


def _picture(view: dict[str, Any]) -> Text:
    step = view["step"] or {"place": 0, "name": ""}
    spent = f"{view['capture_s']:.0f} of about {view['capture_of_s']:.0f} s"
    line = f"[{step['place']}/{len(view['steps'])}] {step['name']}: {view['phase']}{_left(view)}   {spent}\n"
    return Text(f"{line}{_steadiness(view)}\n{view['problem'] or HELP}")


def _left(view: dict[str, Any]) -> str:
    if view["phase_of_s"] is None:
        return ""
    return f" {max(0.0, view['phase_of_s'] - view['phase_s']):.1f} s"


def _steadiness(view: dict[str, Any]) -> str:
    """The bar is full at four times what is still."""
    percent, still = view["steadiness_percent"], view["still_percent"]
    if percent is None:
        return "no frames yet"
    blocks = min(BAR, round(BAR * percent / (4 * still)))
    word = "still" if percent <= still else "moving"
    drawn = "█" * blocks + "·" * (BAR - blocks)
    return f"{drawn} {word}: {percent:.1f} % of a sensor's range (still: below {still:g} %)"
