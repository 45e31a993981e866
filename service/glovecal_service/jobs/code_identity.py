"""What decides a result beside its data: our source, and the versions of the packages that compute.

A worker elsewhere with other code would give other results without a word, so service and worker compare.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from functools import cache
from importlib.metadata import entry_points, version
from importlib.resources import files
from pathlib import Path

_JOBS = Path(__file__).parent
_SOURCE = Path(str(files("glovecal_models"))), _JOBS.parent / "questions", _JOBS
_PACKAGES = "numpy", "scipy", "distributed"
_LONGEST, _MOST_SHOWN = 60, 4


@cache
def code_identity() -> Mapping[str, str]:
    """By part: ``glovecal`` (its version), ``source`` (a hash), packages, and those with effects of a user's
    own."""
    from glovecal_models.effects.catalogue import GROUP  # slow to load, and most commands have no workers

    own = {each.dist.name: each.dist.version for each in entry_points(group=GROUP) if each.dist is not None}
    packages = {name: version(name) for name in _PACKAGES}
    return {"glovecal": version("glovecal-service"), "source": _source_hash()} | packages | own


def difference(service: Mapping[str, str], worker: Mapping[str, str]) -> str | None:
    """What is not the same in both, for a person; None where everything is."""
    names = [name for name in {**service, **worker} if service.get(name) != worker.get(name)]
    shown = (
        f"{name} {_shown(service, name)} at the service and {_shown(worker, name)} at the worker"
        for name in names[:_MOST_SHOWN]
    )
    return "; ".join(shown) or None


def _shown(identity: Mapping[str, str], name: str) -> str:
    return identity.get(name, "none")[:_LONGEST]


def _source_hash() -> str:
    """Of files by name and content, however their lines end."""
    digest = hashlib.sha256()
    for folder in _SOURCE:
        for file in sorted(folder.rglob("*"), key=lambda file: file.relative_to(folder).as_posix()):
            if file.suffix in (".py", ".toml") and file.is_file():
                content = file.read_bytes().replace(b"\r\n", b"\n")
                digest.update(f"{file.relative_to(folder).as_posix()} {len(content)} ".encode() + content)
    return digest.hexdigest()[:16]
