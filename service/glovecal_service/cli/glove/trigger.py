"""``glovecal trigger``: recordings that begin and end with those of other systems."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from queue import Empty
from typing import TYPE_CHECKING, Annotated

import typer

from glovecal_client.errors import ServiceError
from glovecal_models.errors import BadInput
from glovecal_models.takes.time_code import RATES, Counting
from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import identifier
from glovecal_service.cli.terminal.printing import err, out

if TYPE_CHECKING:
    from glovecal_service.recorder.triggers.listener import Listener
    from glovecal_service.recorder.triggers.triggered_recordings import TriggeredRecordings

LOOK_EVERY_S = 0.1
AGAIN_AFTER_S, GIVE_UP_AFTER_S = 0.5, 10.0


def trigger(
    glove: Annotated[list[str], typer.Argument(help="The gloves' names.")],
    listen: Annotated[
        list[str] | None,
        typer.Option(
            help="vicon, motive, qualisys, natnet or osc, also with a port or HOST:PORT: vicon:1512. "
            "Repeatable. Only this computer can send to it, unless a host is given."
        ),
    ] = None,
    senders: Annotated[
        list[str] | None,
        typer.Option("--from", help="Address or network that may send, as 192.168.1.0/24. Repeatable."),
    ] = None,
    send: Annotated[
        list[str] | None,
        typer.Option(help="Send when a recording begins or ends here: PROTOCOL:HOST:PORT. Repeatable."),
    ] = None,
    ltc: Annotated[
        str | None,
        typer.Option(
            help="Sound of a time code (LTC) as a WAV stream: - for standard input, or a FIFO. Takes get "
            "the time code that runs at their start, and packets that are sent tell it."
        ),
    ] = None,
    rate: Annotated[
        str | None,
        typer.Option(
            help=f"Frames a second of triggers' time codes: {', '.join(RATES)}. Of --ltc it is measured."
        ),
    ] = None,
    pre_roll: Annotated[
        float, typer.Option(min=0, max=600, help="Seconds before each take, for effects with memory.")
    ] = 60.0,
) -> None:
    """Record when another system does (UDP triggers), and tell others of recordings. Ctrl-C ends it."""
    from glovecal_service.ltc_line import ListeningLine
    from glovecal_service.recorder.triggers.announcements import Announcements
    from glovecal_service.recorder.triggers.formats import Endpoint
    from glovecal_service.recorder.triggers.listener import Listener, senders_of
    from glovecal_service.recorder.triggers.open_recordings import OpenRecordings, TimeCodedRecordings
    from glovecal_service.recorder.triggers.triggered_recordings import TriggeredRecordings

    if not listen and not send and ltc is None:
        raise typer.BadParameter(
            "say what to listen for (--listen vicon), where to send (--send ...), or which time code to take "
            "(--ltc -)"
        )
    gloves = [str(identifier("glove")(each)) for each in dict.fromkeys(glove)]
    try:
        endpoints = [Endpoint.of_text(each) for each in listen or ()]
        targets = [Endpoint.of_text(each, host=None) for each in send or ()]
        may_send = senders_of(senders or ())
        if rate is not None:
            Counting(rate)
        line = None if ltc is None else ListeningLine(ltc, rate, tell=_tell)
    except BadInput as error:
        raise typer.BadParameter(str(error)) from error
    with connect() as service:
        open_ones = OpenRecordings(service, gloves)
        recordings = TriggeredRecordings(service, gloves, tell=_tell, rate=rate, pre_roll_s=pre_roll)
        announcements = Announcements(
            open_ones,
            targets,
            time_code=lambda: (line and line.time_code) or recordings.time_code,
            tell=_tell,
        )
        looks = [announcements.look]
        if line is not None:
            coded = TimeCodedRecordings(open_ones, lambda: line.time_code, tell=_tell)
            looks = [line.look, *looks, coded.look]
        listener = Listener(endpoints, may_send, is_own=announcements.is_own, tell=_tell)
        for endpoint, port in zip(endpoints, listener.ports, strict=True):
            out.print(f"Listening for {endpoint.form.title} on {endpoint.host}, UDP port {port}.")
        for target in targets:
            out.print(f"Sending {target.form.title} to {target.host}, UDP port {target.port}.")
        out.print(f"Gloves: {', '.join(gloves)}. Ctrl-C ends this.")
        try:
            while True:
                _work(listener, recordings, looks)
        except KeyboardInterrupt:
            pass
        finally:
            listener.close()
            announcements.close()
            if line is not None:
                line.close()
            out.print(f"{listener.counts.sentence[:1].upper()}{listener.counts.sentence[1:]}.")


def _work(listener: Listener, recordings: TriggeredRecordings, looks: Sequence[Callable[[], None]]) -> None:
    with suppress(Empty):
        arrival = listener.arrivals.get(timeout=LOOK_EVERY_S)
        is_done = _once_it_answers(lambda: recordings.carry_out(arrival), arrival.trigger.action == "stop")
        arrival.answer(bool(is_done))
    for look in looks:
        _once_it_answers(look, True)


def _once_it_answers(work: Callable[[], bool | None], is_urgent: bool) -> bool | None:
    """What ``work`` gives; False where the service refuses it. While the service does not answer, try on:
    what is not urgent (a recording that would begin late) for ``GIVE_UP_AFTER_S``."""
    from glovecal_service.recorder.triggers.open_recordings import is_away

    until, is_known = time.monotonic() + GIVE_UP_AFTER_S, False
    while True:
        try:
            return work()
        except ServiceError as error:
            if not is_away(error):
                _tell(f"The service refused: {error.detail or error.title}")
                return False
            if not is_known:
                _tell(f"The service does not answer ({error.title}); trying on.")
                is_known = True
            if not is_urgent and time.monotonic() > until:
                _tell(f"No recording began: the service did not answer for {GIVE_UP_AFTER_S:g} s.")
                return False
            time.sleep(AGAIN_AFTER_S)


def _tell(sentence: str) -> None:
    err.print(sentence, markup=False, highlight=False)
