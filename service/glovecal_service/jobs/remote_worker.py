"""``glovecal worker``: training processes for a service on another computer.

This process speaks to the service's entrance (``worker_entrance.py``), keeps as many processes of
``worker_process.py`` as it was told to, and passes their bytes on. It computes nothing, so it hears at once
what happens, and says it.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import re
import ssl
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from glovecal_client.errors import NotAdmitted
from glovecal_client.site.certificates import check_certificate, client_context
from glovecal_client.site.login import why_refused
from glovecal_client.site.member import ENDPOINT, Member, read_member
from glovecal_models.errors import BadInput
from glovecal_service.jobs.code_identity import code_identity
from glovecal_service.jobs.worker_process import OTHER_CODE, SCHEDULER_LOST
from glovecal_service.jobs.worker_talk import GREETED_WITHIN_S, SCHEDULER, WORK, Gone, Line, pass_on

CONNECTED_WITHIN_S = 3.0
STARTED_WITHIN_S = 120.0
AGAIN_AFTER_S = 1.0
ENDS_WITHIN_S = 5.0


class RemoteWorker:
    """``run()`` until it is interrupted. ``say`` takes sentences for the person at the terminal."""

    def __init__(self, file: Path, processes: int, say: Callable[[str], None]) -> None:
        """Raises BadSiteFile, NotAdmitted, BadInput."""
        self._file = file
        self._processes = processes
        self._say = say
        self._spoken = ""
        self._code = dict(code_identity())
        self._read()

    def run(self) -> None:
        """Raises NotAdmitted: the service refuses this worker, and will do so until somebody changes
        something."""
        asyncio.run(self._serve())

    def _read(self) -> Member:
        """The file as it is now: it may have been renewed."""
        member = read_member(self._file)
        if member.training is None:
            raise BadInput(
                f"{self._file} is the file of a {member.kind}; a worker needs one of its own, made at the "
                "service: glovecal site add NAME --as worker"
            )
        check_certificate(member)
        return member

    def _tell(self, sentence: str) -> None:
        """What was said last is not said again."""
        if sentence != self._spoken:
            self._spoken = sentence
            self._say(sentence)

    async def _serve(self) -> None:
        while True:
            member = self._read()
            try:
                line = await self._knock(member, wants=WORK)
                try:
                    await self._work(member, line)
                finally:
                    line.close()
                self._tell(f"The service at {_place(member)} went away. Trying again.")
            except Gone as gone:
                self._tell(str(gone))
            await asyncio.sleep(AGAIN_AFTER_S)

    async def _knock(self, member: Member, **words: str) -> Line:
        """A connection on which this worker has said who it is. Raises Gone, with a sentence."""
        host, port = _address(member)
        context = client_context(member)
        try:
            opening = asyncio.open_connection(
                host, port, ssl=context, server_hostname=host, ssl_handshake_timeout=GREETED_WITHIN_S
            )
            line = Line(*await asyncio.wait_for(opening, CONNECTED_WITHIN_S + GREETED_WITHIN_S))
        except ssl.SSLError as error:
            raise Gone(await self._why(member, "refuses this certificate")) from error
        except TimeoutError as error:
            raise Gone(f"No answer from {_place(member)}. Trying again.") from error
        except OSError as error:
            raise Gone(
                f"No service lets workers in at {_place(member)}: is it running with GLOVECAL_SITE_FILE, and "
                "is that port open in its firewall? Trying again."
            ) from error
        await line.say(code=self._code, **words)
        return line

    async def _why(self, member: Member, otherwise: str) -> str:
        """What is wrong with the certificate of either side; if nothing is, then ``otherwise``."""
        why = await asyncio.to_thread(why_refused, member, member.training or "")
        return f"{why or f'The service at {_place(member)} {otherwise}'}. Trying again."

    async def _hear(self, member: Member, line: Line, within_s: float) -> dict[str, Any]:
        """Raises Gone, NotAdmitted."""
        until = asyncio.get_running_loop().time() + within_s
        while asyncio.get_running_loop().time() < until:
            try:
                words = dict(await line.hear())
            except Gone as gone:
                raise Gone(await self._why(member, "went away")) from gone
            if "refused" in words:
                raise NotAdmitted(str(words["refused"]))
            if "later" in words:
                raise Gone(f"The service cannot take workers now: {words['later']}. Trying again.")
            if words != {"alive": True}:
                return words
        raise Gone(f"The service at {_place(member)} does not get ready. Trying again.")

    async def _work(self, member: Member, line: Line) -> None:
        """Until the service is gone. Raises Gone, NotAdmitted."""
        saying = asyncio.create_task(_live(line))
        try:
            words = await self._hear(member, line, STARTED_WITHIN_S)
            guest, keys = str(words.get("guest")), words.get("keys")
            forward = await asyncio.start_server(
                lambda reader, writer: self._forward(member, guest, Line(reader, writer)), "127.0.0.1", 0
            )
            async with forward:
                port = forward.sockets[0].getsockname()[1]
                begin = json.dumps({"port": port, "name": member.name, "keys": keys, "code": self._code})
                await self._keep_processes(member, f"{begin}\n".encode(), line)
        finally:
            saying.cancel()

    async def _keep_processes(self, member: Member, begin: bytes, line: Line) -> None:
        ready = [asyncio.Event() for _ in range(self._processes)]
        processes = [asyncio.create_task(self._keep(begin, each)) for each in ready]
        listening = asyncio.create_task(self._listen(line))
        telling = asyncio.create_task(self._tell_ready(member, ready))
        try:
            ended, _ = await asyncio.wait([listening, *processes], return_when=asyncio.FIRST_COMPLETED)
            for each in ended:
                each.result()
        finally:
            for each in (listening, telling, *processes):
                each.cancel()
            await asyncio.gather(listening, telling, *processes, return_exceptions=True)

    async def _listen(self, line: Line) -> None:
        """Raises NotAdmitted."""
        with contextlib.suppress(Gone):
            while True:
                words = await line.hear()
                if "refused" in words:
                    raise NotAdmitted(str(words["refused"]))

    async def _tell_ready(self, member: Member, ready: list[asyncio.Event]) -> None:
        for each in ready:
            await each.wait()
        count = f"{self._processes} processes" if self._processes > 1 else "1 process"
        self._tell(f"{member.name} works for the service at {_place(member)}, with {count}. Ctrl-C stops it.")

    async def _keep(self, begin: bytes, ready: asyncio.Event) -> None:
        """One training process, and another when it dies."""
        while True:
            process = await asyncio.create_subprocess_exec(
                sys.executable, "-P", "-m", "glovecal_service.jobs.worker_process",
                stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE,
            )  # fmt: skip
            assert process.stdin is not None
            assert process.stdout is not None
            try:
                process.stdin.write(begin)
                if await process.stdout.readline():
                    ready.set()
                code = await process.wait()
            finally:
                await _end(process)
            if code == OTHER_CODE:
                raise BadInput(
                    "Glovecal was changed on this computer since this command began: start it again"
                )
            if code not in (0, SCHEDULER_LOST):
                how = f"was killed by signal {-code}" if code < 0 else f"ended with exit code {code}"
                self._say(f"A training process {how}; starting another.")
            await asyncio.sleep(AGAIN_AFTER_S)

    async def _forward(self, member: Member, guest: str, local: Line) -> None:
        """A connection of a process here to the scheduler, which takes it for one on its own computer."""
        try:
            line = await self._knock(member, wants=SCHEDULER, guest=guest)
            try:
                if (await line.hear()).get("connected"):
                    await pass_on(local, line)
            finally:
                line.close()
        except (Gone, asyncio.CancelledError):  # the latter at the end: asyncio would log it
            pass
        finally:
            local.close()


async def _live(line: Line) -> None:
    with contextlib.suppress(Gone):
        await line.say_alive()


async def _end(process: asyncio.subprocess.Process) -> None:
    if process.returncode is None:
        assert process.stdin is not None
        process.stdin.close()  # it ends with that
        try:
            await asyncio.wait_for(process.wait(), ENDS_WITHIN_S)
        except TimeoutError:
            process.kill()
            await process.wait()


def _address(member: Member) -> tuple[str, int]:
    match = re.match(ENDPOINT, member.training or "")
    assert match is not None
    return match[1].strip("[]"), int(match[2])


def _place(member: Member) -> str:
    return (member.training or "").removeprefix("tls/")
