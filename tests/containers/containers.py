"""``python3 do.py containers``: both images built, and what a user does with them done.

Demo, gloves served, a service killed while it records, and the data of the version before the newest
migration of the database taken over. Needs podman and, with --debootstrap, root and debootstrap (Debian:
apt-get install podman runc debootstrap). Everything is made in a folder below the temporary one, and goes
with it; in a --folder of yours images stay, and a second call builds what changed.

--arch arm64 builds both for another processor, which is emulated (Debian: apt-get install qemu-user-static
binfmt-support), looks into them, serves and kills while it records. Demo and upgrade, which would take
hours, are left out.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bare_system import Unavailable, refuse_where_impossible
from base_image import make_base
from container_files import base, problems
from engine import Engine, Failed

from glovecal_client.errors import ServiceError
from glovecal_client.rest import RestClient
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_models.takes.write_table import write_takes

ROOT = Path(__file__).resolve().parents[2]
SERVICE, CAPTURE, PREVIOUS = "glovecal-service", "glovecal-capture", "glovecal-service-previous"
CHANGED = "glovecal-changed"
PARTS = ("models", "client", "service")
OF_VERSION = re.compile(r'(\nversion = "|glovecal[a-z,\[\]-]*==)[0-9][0-9.a-z]*')
OWN_BASE = "localhost/glovecal-base:bookworm"
"""In place of that of the Dockerfiles, where no image registry is reached."""
MOST_MOVED_MB = 40.0
MIGRATIONS = "service/glovecal_service/store/migrations/versions"
UID = "10001"
NOT_INSIDE = ("uv", "cc", "gcc", "g++", "make", "ld")
EMULATED = {"arm64": Path("/proc/sys/fs/binfmt_misc/qemu-aarch64")}
"""Where Linux says that it runs another processor's programs."""
READY_WITHIN_S = 180.0
EMULATED_SLOWER = 10
RECORDED_S = 4.0
CAMERA = """
import cv2, numba, skimage.measure
import glovecal_models.colour_glove.rasterise, glovecal_service.camera.process
print(numba.njit(lambda x: x + 1)(1))
"""


@dataclass
class Table:
    """Rows are printed as they are found."""

    wrong: list[str] = field(default_factory=list)

    def row(self, what: str, found: str) -> None:
        print(f"| {what} | {found} |", flush=True)

    def expect(self, right: bool, what: str, found: str) -> None:
        self.row(what, found if right else f"WRONG: {found}")
        if not right:
            self.wrong.append(what)


def main() -> int:
    parser = argparse.ArgumentParser(prog="do.py containers", description=__doc__)
    parser.add_argument("--debootstrap", action="store_true", help="make the base image, pull nothing")
    parser.add_argument("--folder", type=Path, help="keep images here for the next call")
    parser.add_argument("--arch", choices=EMULATED, help="build for another processor, which is emulated")
    parser.add_argument("--previous", metavar="COMMIT", help="default: before the newest migration")
    parser.add_argument("--smoke", action="store_true", help="look at the files only, build nothing")
    given = parser.parse_args()
    for problem in (found := problems(ROOT)):
        print(problem, file=sys.stderr)
    if given.smoke or found:
        print(f"Container files: {len(found)} problems.")
        return 1 if found else 0
    os.environ["PATH"] += ":/usr/sbin:/sbin"  # not everywhere in root's, and debootstrap and runc are there
    if shutil.which("podman") is None:
        print("podman is not installed (Debian: apt-get install podman runc)", file=sys.stderr)
        return 2
    if given.arch and not EMULATED[given.arch].is_file():
        remedy = "Debian: apt-get install qemu-user-static binfmt-support"
        print(f"this computer does not emulate {given.arch} ({remedy})", file=sys.stderr)
        return 2
    table = Table()
    with _folder(given.folder) as folder:
        try:
            Trial(folder, table, given).run()
        except (Failed, Unavailable, ServiceError, subprocess.CalledProcessError) as error:
            print(f"containers: {error}", file=sys.stderr)
            return 1
    print(f"{len(table.wrong)} wrong." if table.wrong else "All as it should be.")
    return 1 if table.wrong else 0


@contextmanager
def _folder(kept: Path | None) -> Iterator[Path]:
    if kept is not None:
        kept.mkdir(parents=True, exist_ok=True)
        yield kept.resolve()
        return
    with tempfile.TemporaryDirectory(prefix="glovecal-containers-") as folder:
        try:
            yield Path(folder)
        finally:
            Engine(Path(folder))("rmi", "--all", "--force", check=False)


class Trial:
    def __init__(self, folder: Path, table: Table, given: argparse.Namespace) -> None:
        self.folder, self.table, self.given = folder, table, given
        self.engine = Engine(folder, given.arch)
        self.takes = folder / "takes"
        self.takes.mkdir(exist_ok=True)
        self.port, self.zenoh = _free_port(), f"tcp/127.0.0.1:{_free_port()}"

    def run(self) -> None:
        try:
            if self.given.debootstrap and not self.engine("images", "--quiet", OWN_BASE).strip():
                refuse_where_impossible()
                seconds = _timed(lambda: make_base(self.engine, OWN_BASE, self.folder))
                self.table.row("base image from Debian's packages", f"{seconds:.0f} s")
            for image in (SERVICE, CAPTURE):
                self.build(image, ROOT)
                self.change_code(image)
            self.look_inside()
            self.kill_while_recording()
            if not self.given.arch:
                self.upgrade()
                self.demo()
        finally:
            self.engine("rm", "--all", "--force", check=False)

    def build(self, image: str, context: Path, name: str = "") -> None:
        from_base = OWN_BASE if self.given.debootstrap else base(context)
        built = self.engine.build(name or image, context, _dockerfile(image), from_base)
        self.table.row(
            f"{name or image} built",
            f"{built.seconds:.0f} s, {built.disk_mb:.0f} MB, of which its base {built.base_mb:.0f} MB",
        )

    def change_code(self, image: str) -> None:
        """What has to be moved to a computer that has the image, for another version of our code."""
        with tempfile.TemporaryDirectory(dir=self.folder) as folder:
            context = Path(folder)
            for name in (
                "pyproject.toml",
                "uv.lock",
                "docker",
                "models",
                "client",
                "service",
                ".dockerignore",
            ):
                copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy2
                copy(ROOT / name, context / name)
            changed = context / "client" / "glovecal_client" / "clock.py"
            changed.write_text(changed.read_text(encoding="utf-8") + "\n# changed\n", encoding="utf-8")
            for name in ("pyproject.toml", *(f"{part}/pyproject.toml" for part in PARTS)):
                text = (context / name).read_text(encoding="utf-8")
                (context / name).write_text(OF_VERSION.sub(r"\g<1>99.0.0", text), encoding="utf-8")
            self.build(image, context, CHANGED)
        before, after = self.engine.layers_mb(image), self.engine.layers_mb(CHANGED)
        moved = sum(size for layer, size in after.items() if layer not in before)
        self.table.expect(
            moved < MOST_MOVED_MB, f"{image}: moved for another version of our code",
            f"{moved:.1f} of {sum(after.values()):.0f} MB, unpacked",
        )  # fmt: skip
        self.engine("rmi", CHANGED)

    def look_inside(self) -> None:
        for image in (SERVICE, CAPTURE):
            found = self.once(
                image, "sh", "-c", f"id -u; for p in {' '.join(NOT_INSIDE)}; do command -v $p; done; true"
            )
            self.table.expect(found.split() == [UID], f"{image}: user, no compiler, no uv", found.strip())
        found = self.once(SERVICE, "python", "-c", CAMERA)
        self.table.expect(
            found.split()[-1:] == ["2"], "camera's packages load and compile", found.strip()[-60:]
        )

    def demo(self) -> None:
        started = time.monotonic()
        said = self.once(SERVICE, "glovecal", "demo", "--seed", "1")
        verdict = next(
            (line for line in said.splitlines() if line.startswith(("Right", "Wrong"))), "no verdict"
        )
        self.table.expect(
            verdict.startswith("Right"), "demo", f"{verdict} {time.monotonic() - started:.0f} s"
        )

    def kill_while_recording(self) -> None:
        """Twice: the service while it records, then in the middle of nothing; frames and models stay."""
        with self.volume("data") as data, self.serving(SERVICE, data) as client:
            model = self.teach(client)
            asked = client.get(f"/models/{model}")
            with self.capturing():
                recording = self.record(client)
                time.sleep(RECORDED_S)
                self.kill()
                started = time.monotonic()
                self.engine("start", SERVICE)
                self.wait_ready(client)
                self.table.row("ready after kill -9", f"{time.monotonic() - started:.1f} s")
                time.sleep(RECORDED_S)
                client.post(f"/recordings/{recording}/stop")
                facts = client.finish_recording(recording, patience_s=600)["facts"]
                self.healthy(CAPTURE)
            kept = facts["recorded"] == facts["sent"] and facts["missing_frames"] == 0
            self.table.expect(
                kept, "frames of a recording over a kill -9",
                f"{facts['recorded']} of {facts['sent']}, {facts['repaired']} fetched from capture's log",
            )  # fmt: skip
            self.table.expect(client.get(f"/models/{model}") == asked, "model after a kill -9", model[:12])
            self.healthy(SERVICE)

    def upgrade(self) -> None:
        """What the previous version stored is read and used by this one."""
        commit = self.given.previous or _before_newest_migration()
        if not commit:
            self.table.row("upgrade", "not tried: no earlier schema, or no history of it in this clone")
            return
        archive = subprocess.run(["git", "archive", commit], cwd=ROOT, check=True, capture_output=True).stdout
        with tempfile.TemporaryDirectory(dir=self.folder) as context:
            subprocess.run(["tar", "-x", "-C", context], input=archive, check=True)
            self.build(SERVICE, Path(context), PREVIOUS)
        with self.volume("old") as data:
            with self.serving(PREVIOUS, data) as client:
                model = self.teach(client)
                before = _stored(client, model)
            with self.serving(SERVICE, data) as client:
                after = _stored(client, model)
                self.table.expect(
                    after == before, f"upgrade from {commit[:7]}",
                    f"{len(after['takes'])} takes, model {model[:12]} predicts as before",
                )  # fmt: skip

    def teach(self, client: RestClient) -> str:
        """A model of a small simulated session; its id."""
        session = record_session(SessionPlan(3, sensors=("I_MCP", "I_PIP"), take_s=12, wearings=1), [])
        write_takes(list(session.takes), self.takes / "takes.csv")
        self.takes.chmod(0o755)
        (self.takes / "takes.csv").chmod(0o644)
        client.post("/subjects", {"name": "anna"})
        client.upload_takes(self.takes / "takes.csv", subject="anna")
        layout = client.get("/takes")[0]["layout"]
        job = client.post("/models/train", {"subject": "anna", "layout": layout, "method": "linear"})
        return client.wait_for_job(job["id"], patience_s=1800)["result"]["model"]

    def record(self, client: RestClient) -> str:
        """The id of a recording that goes on."""
        self.until(
            lambda: any(glove["name"] == "right" for glove in client.get("/gloves")["seen"]), "a glove"
        )
        id = client.post("/recordings", {"glove": "right", "name": "killed", "subject": "anna"})["id"]
        self.until(lambda: client.get(f"/recordings/{id}")["state"] == "recording", "the recorder")
        return id

    def once(self, image: str, *command: str) -> str:
        entry = ["--entrypoint", command[0]] if image == CAPTURE else []
        return self.engine(
            "run",
            "--rm",
            "--read-only",
            *self.engine.platform,
            *entry,
            image,
            *(command[1:] if entry else command),
            timeout_s=1800,
        )

    @contextmanager
    def volume(self, name: str) -> Iterator[str]:
        self.engine("volume", "create", name)
        try:
            yield name
        finally:
            self.engine("volume", "rm", "--force", name, check=False)

    @contextmanager
    def serving(self, image: str, data: str) -> Iterator[RestClient]:
        settings = {"GLOVECAL_HOST": "127.0.0.1", "GLOVECAL_PORT": self.port, "GLOVECAL_ZENOH": self.zenoh}
        options = ["--volume", f"{data}:/data", *(f"--env={key}={value}" for key, value in settings.items())]
        with (
            self.engine.running(image, image, options=options),
            RestClient(f"http://127.0.0.1:{self.port}") as client,
        ):
            started = time.monotonic()
            self.wait_ready(client)
            self.table.row(f"{image} ready, root read-only", f"{time.monotonic() - started:.1f} s")
            yield client

    @contextmanager
    def capturing(self) -> Iterator[None]:
        """The capture image plays the takes to the service."""
        with self.volume("log") as log:
            options = ["--volume", f"{log}:/data", "--volume", f"{self.takes}:/takes:ro"]
            glove = ("--device", "replay:/takes/takes.csv", "--glove", "right", "--subject", "anna")
            rest = ("--option", "loop=yes", "--connect", self.zenoh)
            with self.engine.running(CAPTURE, CAPTURE, *glove, *rest, options=options):
                yield

    def kill(self) -> None:
        self.engine("kill", "--signal", "KILL", SERVICE)
        self.engine("wait", SERVICE)

    def healthy(self, name: str) -> None:
        """As the engine sees it, by the image's own health check."""
        self.engine("healthcheck", "run", name, check=False)
        state = self.engine("inspect", "--format", "{{.State.Health.Status}}", name, check=False)
        self.table.expect(state.split()[-1:] == ["healthy"], f"health check of {name}", state.strip())

    def until(self, true: Callable[[], bool], what: str) -> None:
        _until(true, what, READY_WITHIN_S * (EMULATED_SLOWER if self.given.arch else 1))

    def wait_ready(self, client: RestClient) -> None:
        def ready() -> bool:
            try:
                client.get("/health/ready")
            except ServiceError:
                return False
            return True

        try:
            self.until(ready, "the service")
        except Failed as error:
            raise Failed(f"{error}\n{self.engine.log(SERVICE)}") from error


def _dockerfile(image: str) -> str:
    return f"docker/{image.removeprefix('glovecal-')}.Dockerfile"


def _stored(client: RestClient, model: str) -> dict[str, Any]:
    """What both versions show alike."""
    takes = client.get("/takes")
    angles = client.predict(model, [[60.0, 70.0], [120.0, 90.0]])["mean_deg"]
    return {
        "takes": sorted((take["id"], take["name"]) for take in takes),
        "degrees": [[round(degrees, 6) for degrees in frame] for frame in angles],
    }


def _before_newest_migration() -> str:
    """The commit before it; "" where there is only the first, or the history does not go so far."""
    if len(list((ROOT / MIGRATIONS).glob("0*.py"))) == 1:
        return ""
    log = ["git", "log", "-1", "--diff-filter=A", "--format=%P", "--", MIGRATIONS]
    found = subprocess.run(log, cwd=ROOT, capture_output=True, text=True)
    return found.stdout.strip() if re.fullmatch(r"[0-9a-f]{40}", found.stdout.strip()) else ""


def _until(true: Callable[[], bool], what: str, within_s: float) -> None:
    until = time.monotonic() + within_s
    while not true():
        if time.monotonic() > until:
            raise Failed(f"{what} was not there within {within_s:.0f} s")
        time.sleep(0.2)


def _timed(work: Callable[[], object]) -> float:
    started = time.monotonic()
    work()
    return time.monotonic() - started


def _free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as probe:
        return probe.getsockname()[1]


if __name__ == "__main__":
    sys.exit(main())
