"""What a Compose file starts, read from it: the environment and command that a container would have, with
those of its image's Dockerfile, for a trial without containers."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

DOCKER = Path(__file__).resolve().parents[2] / "docker"


@dataclass(frozen=True)
class Container:
    hostname: str
    command: tuple[str, ...]
    health_check: tuple[str, ...]
    environment: dict[str, str]
    """Without PATH."""
    secrets: dict[str, Path]
    """Files below the Compose file's folder, by the path at which the container has them."""


def container(file: str, service: str, variables: Mapping[str, str]) -> Container:
    """Of ``service`` in ``docker/FILE``, which is of our image; ``variables``: those of ``.env``. Raises
    KeyError for one that is missing."""
    document: dict[str, Any] = yaml.safe_load((DOCKER / file).read_text(encoding="utf-8"))
    found = document["services"][service]
    image = (DOCKER / "service.Dockerfile").read_text(encoding="utf-8").replace("\\\n", " ")
    settings = re.findall(r"(\w+)=(\S+)", " ".join(re.findall(r"^ENV (.*)$", image, re.MULTILINE)))
    files = {name: Path(secret["file"]) for name, secret in document.get("secrets", {}).items()}
    return Container(
        _filled(found["hostname"], variables),
        tuple(json.loads(re.findall(r"^CMD (\[.*\])$", image, re.MULTILINE)[-1])),
        tuple(found["healthcheck"]["test"][1:]),
        {name: value for name, value in settings if name != "PATH"}
        | {name: _filled(value, variables) for name, value in found["environment"].items()},
        {f"/run/secrets/{name}": files[name] for name in found.get("secrets", ())},
    )


def _filled(text: str, variables: Mapping[str, str]) -> str:
    """As Compose puts variables in: ``${NAME}``, ``${NAME:?what it is}`` and ``${NAME:-}``."""

    def value(found: re.Match[str]) -> str:
        return variables.get(found[1], "") if found[2] == ":-" else variables[found[1]]

    return re.sub(r"\$\{(\w+)(:\?[^}]*|:-)?\}", value, text)


def first_steps(file: str) -> list[str]:
    """The commands in the first lines of ``docker/FILE``, those with ``$RUN``, in their order; what stands
    before them says where."""
    head = (DOCKER / file).read_text(encoding="utf-8").partition("\nname:")[0]
    lines = [line.removeprefix("#").strip() for line in head.splitlines()]
    return [line for line in lines if "$RUN " in line]
