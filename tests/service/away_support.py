"""``glovecal serve`` on a real PostgreSQL and S3 server, asked for everything while poses are counted."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import zenoh
from lawful_answers import REMEDY, sentences_of
from realtime_support import WireGlove, eventually, free_endpoint, store_model
from s3_server import BUCKET, S3Server
from stored_service import StoredService, fill
from wild_requests import Operation, Samples, operations

from glovecal_client.keys import GloveKeys
from glovecal_client.session import open_client
from glovecal_client.wire.pose import decode_pose
from glovecal_service.rest.app import create_app
from glovecal_service.settings import Settings
from glovecal_service.store import Store

DOCUMENT = create_app(Settings()).openapi()
WITHIN_S = 5.0
FRAMES_HZ = 50
ENDS = ("DELETE /v1/subjects/{name}", "POST /v1/erasures")
"""After all others: nothing of the subject is left then."""
FILE_OF = {"/v1/models/import": "model", "/v1/takes/{id}/camera-reference": "estimates"}
"""Which file a route takes that takes any bytes; a table elsewhere."""


def in_order() -> list[Operation]:
    """What removes something comes last."""

    def rank(operation: Operation) -> int:
        return 2 + ENDS.index(str(operation)) if str(operation) in ENDS else operation.method == "DELETE"

    return sorted(operations(DOCUMENT), key=rank)


@dataclass
class Poses:
    """One glove's frames go out at a steady rate; which of them came back as poses."""

    sent: int = 0
    came: set[int] = field(default_factory=set)
    skipped: int = 0
    """Counted by the service: on a computer that does too much else it leaves frames out, to stay current."""

    @property
    def missing(self) -> list[int]:
        """But for those on their way, and those before the first."""
        first = min(self.came, default=0)
        return sorted(set(range(first, self.sent - FRAMES_HZ)) - self.came)


@dataclass
class ServedSite:
    http: httpx.Client
    doomed: StoredService
    """What is changed and removed while something is away."""
    kept: StoredService
    poses: Poses
    objects: S3Server
    log: Path
    slowest_s: float = 0.0

    def ask(self, operation: Operation, of: StoredService) -> tuple[httpx.Response, float]:
        """With right values of everything; the answer, or its first line, and how long it took."""
        samples, sent = Samples(DOCUMENT, of.known), dict[str, Any]()
        query = {
            item["name"]: of.known.get(item["name"]) for item in operation.parameters if item["in"] == "query"
        }
        sent["params"] = {name: value for name, value in query.items() if value is not None}
        if operation.body is not None:
            sent["json"] = samples.value(operation.body)
        elif operation.media_types:
            kind = operation.media_types[0]
            sent |= {"content": of.files[FILE_OF.get(operation.path, "table")]}
            sent |= {"headers": {"Content-Type": kind}}
        began = time.monotonic()
        url = samples.path(operation)[3:]
        if operation.path.endswith("/events"):
            with self.http.stream(operation.method, url, **sent) as answer:
                first = next(answer.iter_raw(), b"")
                took = time.monotonic() - began
                return httpx.Response(answer.status_code, headers=answer.headers, content=first), took
        answer = self.http.request(operation.method, url, **sent)
        return answer, time.monotonic() - began

    def complaints(self, chosen: list[Operation], of: StoredService, *allowed: int) -> list[str]:
        """Whatever has no sentence or takes too long, a line each; 500 and above but for ``allowed``."""
        found = []
        for operation in chosen:
            try:
                answer, took = self.ask(operation, of)
                sentences = sentences_of(answer) if answer.status_code >= 400 else []
                if answer.status_code >= 500:
                    assert answer.status_code in allowed, answer.text[:300]
                    assert all(map(REMEDY.search, sentences)), sentences
            except (AssertionError, httpx.HTTPError) as error:
                found.append(f"{operation}: {error!r:.300}")
                continue
            self.slowest_s = max(self.slowest_s, took)
            if took > WITHIN_S:
                found.append(f"{operation}: {answer.status_code} after {took:.1f} s")
        return found

    def failures(self) -> list[str]:
        """In the log; but for streams that a listener left."""
        lines = self.log.read_text().splitlines()
        return [line for line in lines if "request failed" in line and "/events" not in line]

    def states(self, asked: list[Operation]) -> dict[str, int]:
        """How those of them that only read are answered."""
        reads = [each for each in asked if each.method == "GET" and str(each) != "GET /v1/health/ready"]
        return {str(each): self.ask(each, self.kept)[0].status_code for each in reads}


@contextmanager
def served_site(folder: Path, objects: S3Server, database: str) -> Iterator[ServedSite]:
    """Subjects anna and ben with something of everything; a glove of clara sends frames."""
    endpoint, port = free_endpoint(), free_endpoint().rpartition(":")[2]
    settings = Settings(
        data=folder / "data", database=database, artifacts=f"s3://{BUCKET}/{folder.name}", zenoh=endpoint
    )
    environment = {
        "GLOVECAL_DATA": str(settings.data), "GLOVECAL_DATABASE": database, "GLOVECAL_PORT": port,
        "GLOVECAL_ARTIFACTS": str(settings.artifacts), "GLOVECAL_ZENOH": endpoint,
        "GLOVECAL_WORKERS": "0",  # jobs that are begun wait
        **objects.environment,
    }  # fmt: skip
    log = folder / "log"
    with ExitStack() as stack:
        out = stack.enter_context(log.open("w"))
        command = [sys.executable, "-m", "glovecal_service.cli.command", "serve", "--no-studio"]
        process = subprocess.Popen(
            command, env=os.environ | environment, stdout=out, stderr=subprocess.STDOUT
        )
        stack.callback(process.communicate)
        stack.callback(process.kill)
        http = httpx.Client(base_url=f"http://127.0.0.1:{port}/v1", timeout=60.0)
        stack.enter_context(http)
        eventually(lambda: _is_up(process, http, log), "it serves")
        before = {name: os.environ.get(name) for name in objects.environment}
        os.environ.update(objects.environment)
        try:
            with Store.open(settings) as store:
                store_model(store, "clara", degrees_per_count=0.5)
                doomed = fill(store, http, folder)
                kept = fill(store, http, folder, subject="ben", glove="right")
        finally:
            for name, value in before.items():
                os.environ.pop(name) if value is None else os.environ.update({name: value})
        session = stack.enter_context(open_client([endpoint], wait_s=60))
        poses = stack.enter_context(_counted_poses(session, settings))
        yield ServedSite(http, doomed, kept, poses, objects, log)


def _is_up(process: subprocess.Popen[bytes], http: httpx.Client, log: Path) -> bool:
    assert process.poll() is None, log.read_text()
    try:
        return http.get("/health/ready").is_success
    except httpx.TransportError:
        return False


@contextmanager
def _counted_poses(session: zenoh.Session, settings: Settings) -> Iterator[Poses]:
    poses, stop = Poses(), threading.Event()
    glove = WireGlove(session, settings, "steady", subject="clara")

    def heard(sample: zenoh.Sample) -> None:
        pose = decode_pose(sample.payload.to_bytes())
        if not pose.stale and len(pose.degrees):
            poses.came.add(pose.sequence)
            poses.skipped = pose.skipped

    def send() -> None:
        due = time.monotonic()
        while not stop.wait(max(0.0, due - time.monotonic())):
            if poses.sent % FRAMES_HZ == 0:
                glove.say_meta()
            glove.send()
            poses.sent, due = glove.sequence, due + 1 / FRAMES_HZ

    hearing = session.declare_subscriber(GloveKeys(settings.site, "steady").pose, heard)
    sending = threading.Thread(target=send)
    sending.start()
    try:
        eventually(lambda: poses.came, "poses come")
        yield poses
    finally:
        stop.set()
        sending.join()
        hearing.undeclare()
