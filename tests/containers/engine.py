"""Podman with images, containers and settings of its own in a folder, which goes with it.

Podman, because it needs no engine that runs already: what builds (buildah's library) and what runs (runc or
crun) are processes of this command. Containers use the network of this computer: no bridge has to be set up.
"""

from __future__ import annotations

import json
import os
import resource
import shutil
import subprocess
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

SETTINGS = """[containers]
default_ulimits = [{limits}]
cgroups = "no-conmon"
netns = "host"
log_driver = "k8s-file"
[engine]
cgroup_manager = "cgroupfs"
events_logger = "file"
runtime = "{runtime}"
"""
USED = {"nofile": resource.RLIMIT_NOFILE, "nproc": resource.RLIMIT_NPROC}
CLOSED = ("--read-only", "--cap-drop=ALL", "--security-opt=no-new-privileges")
FIT_IN = 1 << 12
"""Limits of a container; where this computer allows less, what it allows."""


class Failed(Exception):
    """A command of the engine ended with an error; ``str()`` names it and quotes its last lines."""


@dataclass(frozen=True)
class Built:
    """One image."""

    seconds: float
    disk_mb: float
    """Unpacked, its base included."""
    base_mb: float
    """Of that, its base."""


class Engine:
    def __init__(self, folder: Path, architecture: str | None = None) -> None:
        """``architecture``: Debian's and Docker's name of one that this computer emulates, such as arm64."""
        self.architecture = architecture
        self.platform = [f"--platform=linux/{architecture}"] if architecture else []
        runtime = next((name for name in ("runc", "crun") if shutil.which(name)), "runc")
        limits = (f'"{name}={_allowed(number)}:{_allowed(number)}"' for name, number in USED.items())
        (folder / "containers.conf").write_text(SETTINGS.format(limits=", ".join(limits), runtime=runtime))
        self._folder = folder
        self._podman = ["podman", "--root", str(folder / "images"), "--runroot", str(folder / "run")]

    def __call__(self, *arguments: str, check: bool = True, timeout_s: float = 4 * 3600.0) -> str:
        """What ``podman ARGUMENTS`` printed. Raises Failed unless ``check`` is off, or late."""
        try:
            done = subprocess.run(
                [*self._podman, *arguments],
                env=os.environ | {"CONTAINERS_CONF": str(self._folder / "containers.conf")},
                stdin=subprocess.DEVNULL,
                capture_output=True,
                text=True,
                timeout=timeout_s,
            )
        except subprocess.TimeoutExpired as error:
            raise Failed(f"podman {arguments[0]} did not end within {timeout_s:.0f} s") from error
        if check and done.returncode:
            raise Failed(f"podman {' '.join(arguments)[:200]}: exit code {done.returncode}\n{_last(done)}")
        return done.stdout

    def build(self, image: str, context: Path, dockerfile: str, base: str) -> Built:
        started = time.monotonic()
        options = ("--network", "host", "--format", "docker", "--build-arg", f"BASE={base}")
        self("build", *options, *self.platform, "-f", str(context / dockerfile), "-t", image, str(context))
        return Built(time.monotonic() - started, self._size_mb(image), self._size_mb(base))

    def _size_mb(self, image: str) -> float:
        [found] = json.loads(self("image", "inspect", image))
        return found["Size"] / 1e6

    def layers_mb(self, image: str) -> dict[str, float]:
        """Of each layer by its digest, unpacked."""
        [found] = json.loads(self("image", "inspect", image))
        steps = json.loads(self("history", "--format", "json", image))[::-1]
        made = [
            step["size"] / 1e6
            for step, told in zip(steps, found["History"], strict=True)
            if not told.get("empty_layer")
        ]
        return dict(zip(found["RootFS"]["Layers"], made, strict=True))

    def log(self, name: str) -> str:
        """The last lines of a container."""
        logs = [*self._podman, "logs", "--tail", "15", name]
        return _last(subprocess.run(logs, capture_output=True, text=True))

    @contextmanager
    def running(self, image: str, name: str, *command: str, options: Sequence[str] = ()) -> Iterator[str]:
        """A container in the background, closed as the Dockerfiles say; gone at the end of the block."""
        self("run", "--detach", "--name", name, *CLOSED, *self.platform, *options, image, *command)
        try:
            yield name
        finally:
            self("rm", "--force", "--time", "10", name, check=False)


def _last(done: subprocess.CompletedProcess[str]) -> str:
    return "\n".join((done.stdout + done.stderr).strip().splitlines()[-15:])


def _allowed(number: int) -> int:
    hard = resource.getrlimit(number)[1]
    return FIT_IN if hard == resource.RLIM_INFINITY else min(FIT_IN, hard)
