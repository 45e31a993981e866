"""``glovecal take latency``: how late a glove is, from taps of a finger on a key."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from glovecal_client.clock import clock_ns, clock_s
from glovecal_client.errors import NoAnswer
from glovecal_service.cli.glove.heard_frames import heard_frames, times_and_readings
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import DEFAULT_ZENOH, AsJson, Glove, Site, Zenoh
from glovecal_service.cli.terminal.printing import NobodyThere, Refusal, err, out, print_json
from glovecal_service.operating_system import single_keys

if TYPE_CHECKING:
    from glovecal_models.takes.tap_latency import TapLatency

FEWEST = 20
WAIT_S = 5.0
AFTERWARDS_S = 1.0
"""The last tap's frames come so much later."""
PATIENCE_S = 60.0
OTHER_COMPUTER_S = 2.0
QUITS = ("q", "\x1b", "")


def latency(
    glove: Glove,
    taps: Annotated[int, typer.Option(min=FEWEST, max=1000, help="How many taps.")] = 30,
    key_latency_ms: Annotated[
        float | None,
        typer.Option(
            "--key-latency-ms",
            min=0,
            max=200,
            help="What the key takes to report; not given: any time from 5 to 20. 0 for an LED or a clap.",
        ),
    ] = None,
    frames: Annotated[
        Path | None,
        typer.Option("--frames", exists=True, dir_okay=False, help="A take table instead of the live glove."),
    ] = None,
    keys: Annotated[
        Path | None,
        typer.Option("--keys", exists=True, dir_okay=False, help="Its key times: seconds, one a line."),
    ] = None,
    store: Annotated[bool, typer.Option(help="Keep it with the glove.")] = True,
    connect_to: Zenoh = DEFAULT_ZENOH,
    site: Site = "lab",
    as_json: AsJson = False,
) -> None:
    """Measure a glove's own latency: tap a key with one finger, on the computer that captures the glove.

    Strike fast, once a second, lift slowly. With --frames and --keys other events serve too: a clap, an LED.
    """
    from glovecal_models.takes.tap_latency import tap_latency, usual_key

    if (frames is None) != (keys is None):
        raise typer.BadParameter("--frames and --keys go together")
    if frames is not None and keys is not None:
        times, readings, sensors, pressed = _recorded(frames, keys)
    else:
        times, readings, sensors, pressed = _live(glove, taps, connect_to, site)
    key_s = None if key_latency_ms is None else key_latency_ms / 1000
    found = tap_latency(times, readings, sensors, pressed, key_latency_s=key_s)
    answer = {
        "latency_s": found.seconds,
        "sd_s": found.sd_s,
        "taps": found.taps,
        "used": found.used,
        "key_latency_s": usual_key()[0] if key_s is None else key_s,
    }
    if store:
        with connect() as service:
            service.put(f"/gloves/{glove}/latency", answer)
    if as_json:
        print_json(answer | {"tap_sd_s": found.tap_sd_s, "sensors": list(found.sensors), "stored": store})
    else:
        _print(found, key_s, store)


Times = tuple[np.ndarray, np.ndarray, tuple[str, ...], np.ndarray]
"""Frame times (N,), readings (N, S), sensors, key times (K,); seconds of one clock."""


def _recorded(frames: Path, keys: Path) -> Times:
    from glovecal_models.takes.table import read_takes

    found = read_takes(frames)
    if len(found) != 1:
        raise Refusal(f"{frames} holds {len(found)} takes; give a file with one")
    return found[0].time_s, found[0].readings, found[0].sensors, _key_times(keys)


def _key_times(path: Path) -> np.ndarray:
    """Seconds, the first column of each line; a heading is left out. Raises Refusal."""
    lines = [line.split(",")[0].strip() for line in path.read_text(encoding="utf-8").splitlines()]
    lines = [line for line in lines if line]
    if lines and not _is_number(lines[0]):
        lines = lines[1:]
    wrong = next((line for line in lines if not _is_number(line)), None)
    if wrong is not None:
        raise Refusal(f"{path}: {wrong[:40]!r} is no time in seconds")
    return np.array([float(line) for line in lines])


def _is_number(text: str) -> bool:
    try:
        return bool(np.isfinite(float(text)))
    except ValueError:
        return False


def _live(glove: str, taps: int, endpoint: str, site: str) -> Times:
    """Raises Refusal, NobodyThere."""
    from glovecal_client.keys import GloveKeys
    from glovecal_client.session import ask_json, open_client

    wire = GloveKeys(site, glove)
    try:
        with open_client([endpoint], wait_s=WAIT_S) as session:
            meta = ask_json(session, wire.meta, timeout_s=WAIT_S)
            with heard_frames(session, wire.raw) as heard:
                _require_here(glove, heard)
                pressed = _pressed(taps)
                time.sleep(AFTERWARDS_S)
    except NoAnswer as error:
        raise NobodyThere(str(error)) from error
    times, readings = times_and_readings(heard)
    return times, readings, tuple(map(str, meta.get("sensors", ()))), np.array(pressed)


def _require_here(glove: str, heard: list) -> None:
    """Frames come, stamped by this computer's clock. Raises Refusal."""
    until = time.monotonic() + WAIT_S
    while not heard and time.monotonic() < until:
        time.sleep(0.05)
    if not heard:
        raise Refusal(
            f"glove {glove} sends no frames; start it: glovecal capture --device DEVICE --glove {glove}"
        )
    apart_s = abs(clock_ns() - heard[-1].monotonic_ns) / 1e9
    if apart_s > OTHER_COMPUTER_S:
        raise Refusal(
            f"glove {glove} is captured on another computer, whose clock does not stamp these keys; run this"
            " command there"
        )


def _pressed(taps: int) -> list[float]:
    """When keys were pressed, seconds of the monotonic clock. Raises Refusal for too few."""
    err.print(f"Tap any key {taps} times with one finger: strike fast, lift slowly, once a second; q ends.")
    found: list[float] = []
    with single_keys() as key:
        while len(found) < taps:
            pressed = key(PATIENCE_S)
            at = clock_s()
            if pressed in QUITS:
                break
            found.append(at)
            err.print(f"{len(found)} of {taps}")
    if len(found) < FEWEST:
        raise Refusal(f"{len(found)} taps; {FEWEST} are needed")
    return found


def _print(found: TapLatency, key_s: float | None, stored: bool) -> None:
    out.print(found.sentence)
    out.print(f"Sensors that follow the taps: {', '.join(found.sensors)}.")
    if key_s is None:
        err.print(
            "Keyboards report a key 5 to 20 ms after it was hit: 12.5 ms are added, and most of the standard"
            " deviation is the key's. If you know what yours takes, give --key-latency-ms."
        )
    if stored:
        out.print("Kept with the glove: it is taken off the time of live poses and added to their age.")
