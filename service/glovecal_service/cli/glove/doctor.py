"""``glovecal doctor``: what is wrong with a glove that somebody wears."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any

import typer

from glovecal_client.errors import ClientError, NoAnswer
from glovecal_models.hand.rotations import HANDS, is_of_hand, known_hand
from glovecal_service.cli.glove.heard_frames import heard_frames, times_and_readings
from glovecal_service.cli.terminal.connection import connect, stored_models
from glovecal_service.cli.terminal.options import DEFAULT_ZENOH, AsJson, Glove, Site, Zenoh
from glovecal_service.cli.terminal.printing import NobodyThere, err, out, print_json, sentence_of
from glovecal_service.plain import read
from glovecal_service.rest.glove.answer import Gloves
from glovecal_service.rest.subject.answer import Subject

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient
    from glovecal_models.calibration.model import CalibrationModel
    from glovecal_models.diagnosis.worn_glove import GloveFinding

FOUND = 4
"""Exit code when something is wrong: 1 to 3 mean that nothing could be said."""
WAIT_S = 5.0
FEWEST_FRAMES = 20


def doctor(
    glove: Glove,
    seconds: Annotated[float, typer.Option(min=2.0, max=60.0, help="How long to listen.")] = 5.0,
    connect_to: Zenoh = DEFAULT_ZENOH,
    site: Site = "lab",
    as_json: AsJson = False,
) -> None:
    """Find what is wrong with a worn glove: sensor, cable, supply, wearing, model. Exit code 4: something is.

    Move the whole hand meanwhile: a sensor that is stuck only shows then.
    """
    try:
        found, frames = _findings(glove, seconds, connect_to, site)
    except NoAnswer as error:
        raise NobodyThere(str(error)) from error
    if as_json:
        print_json({"glove": glove, "frames": frames, "findings": [asdict(one) for one in found]})
    else:
        for one in found:
            out.print(f"{one.part}: {one.sentence} {one.advice}")
        if not found:
            out.print(f"Nothing is wrong with {glove}: {frames} frames in {seconds:g} s.")
    if found:
        raise typer.Exit(FOUND)


def _findings(glove: str, seconds: float, endpoint: str, site: str) -> tuple[list[GloveFinding], int]:
    """And how many frames came. Raises NoAnswer without a service."""
    from glovecal_client.keys import GloveKeys
    from glovecal_client.session import ask_json, open_client
    from glovecal_models.diagnosis.worn_glove import GloveFinding, worn_glove_findings
    from glovecal_models.takes.take import Take

    wire = GloveKeys(site, glove)
    with open_client([endpoint], wait_s=WAIT_S) as session:
        try:
            meta, before = (ask_json(session, key, timeout_s=2.0) for key in (wire.meta, wire.status))
        except NoAnswer:
            gone = f"Nothing is heard of glove {glove} at site {site}."
            start = f"Start it where it is plugged in: glovecal capture --device DEVICE --glove {glove}."
            return [GloveFinding("capture", gone, start)], 0
        err.print(f"Listening for {seconds:g} s: bend, spread and turn the whole hand.")
        with heard_frames(session, wire.raw) as heard:
            time.sleep(seconds)
        after = before
        with suppress(NoAnswer):
            after = ask_json(session, wire.status, timeout_s=2.0)
    found = list(_of_capture(before, after))
    model, of_model = _model(glove, meta)
    if len(heard) < FEWEST_FRAMES:
        if not found:
            few = f"{len(heard)} frames came in {seconds:g} s."
            found.append(GloveFinding("cable", few, "Unplug the glove and plug it in again."))
        return [*found, *of_model], len(heard)
    times, readings = times_and_readings(heard)
    sensors = tuple(map(str, meta.get("sensors", ())))
    take = Take("now", str(meta.get("wearing") or ""), sensors, times, readings)
    nominal = meta.get("rate_hz")
    nominal = float(nominal) if isinstance(nominal, int | float) else None
    return [*found, *worn_glove_findings(take, nominal, model), *of_model], len(times)


def _of_capture(before: Mapping[str, Any], after: Mapping[str, Any]) -> Iterator[GloveFinding]:
    from glovecal_models.diagnosis.worn_glove import GloveFinding

    if after.get("state") != "streaming":
        sentence = str(after.get("sentence") or f"The glove is {after.get('state')}.")
        yield GloveFinding("cable", sentence, "Plug it in, switch it on; the capture tries again by itself.")
    names = ("bad_frames", "damaged_frames")
    damaged = sum(int(after.get(name) or 0) - int(before.get(name) or 0) for name in names)
    if damaged > 0:
        advice = "Exchange the cable, or take it away from motors and power supplies."
        last = after.get("last_damaged")
        if last:
            advice = (
                "If every line looks like this, the glove's description or options do not fit it. " + advice
            )
        yield GloveFinding(
            "cable", f"{damaged} records refused{f', the last: {last}' if last else ''}.", advice
        )
    if after.get("disk") == "full":
        advice = "Free some space: frames are not in the log."
        yield GloveFinding("capture", "The disk of the capture computer is full.", advice)


def _model(glove: str, meta: Mapping[str, Any]) -> tuple[CalibrationModel | None, list[GloveFinding]]:
    """The one that is served, and what is wrong with that."""
    from glovecal_models.calibration.artifact import load
    from glovecal_models.diagnosis.worn_glove import GloveFinding

    try:
        with connect() as service:
            subject = _wearer(service, glove) or meta.get("subject")
            if not subject:
                put = f"Say who wears it: glovecal glove wear {glove} SUBJECT."
                return None, [GloveFinding("model", f"Nobody is known to wear {glove}.", put)]
            known = {row.name: row.hand for row in read(list[Subject], service.get("/subjects"))}
            if subject not in known:
                add = f"Add the subject, then sample or train: glovecal subject add {subject}."
                return None, [GloveFinding("model", f"{subject}, who wears {glove}, is no subject yet.", add)]
            hand, worn, found = known[subject], known_hand(meta.get("hand")), []
            models = stored_models(service, subject=subject, layout=str(meta.get("layout")))
            if worn and hand in HANDS and worn not in (hand, *(row.hand for row in models)):
                wrong = f"{glove} is a {worn} glove, {subject} is a {hand} hand."
                found.append(GloveFinding("model", wrong, "Exchange the gloves, or say who wears this one."))
            active = [row for row in models if row.active and is_of_hand(row.hand, worn)]
            if not active:
                none = f"No model of {subject} with layout {meta.get('layout')} is active."
                train = f"Train one, or choose one: glovecal train --subject {subject}."
                return None, [*found, GloveFinding("model", none, train)]
            return load(service.download(f"/models/{active[0].id}/export")), found
    except ClientError as error:
        said = f"The service does not say which model is served: {sentence_of(error)}."
        return None, [GloveFinding("model", said, "See what glovecal serve says.")]


def _wearer(service: RestClient, glove: str) -> str | None:
    seen = read(Gloves, service.get("/gloves")).seen
    return next((row.subject for row in seen if row.name == glove), None)
