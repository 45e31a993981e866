"""Results that are there already, so that a part is not computed twice.

One JSON file a job, with the state of the programs it was computed by: a result of older programs is not
shown beside newer ones. The page may be changed without computing anew.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from pathlib import Path

from paper_job import PaperResult

import glovecal_models

MODELS = Path(glovecal_models.__file__).resolve().parent
HERE = Path(__file__).resolve().parent


def programs_hash() -> str:
    """Of all that a figure depends on: glovecal_models and the files beside this one."""
    digest = hashlib.sha256()
    files = [*MODELS.rglob("*.py"), *MODELS.rglob("*.toml"), *HERE.glob("*.py")]
    for path in sorted(files):
        digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


class KeptResults:
    """In ``folder``, of one state of the programs."""

    def __init__(self, folder: Path, programs: str) -> None:
        self._folder, self._programs = folder, programs
        folder.mkdir(parents=True, exist_ok=True)

    def get(self, job: str, seed: int, quick: bool) -> PaperResult | None:
        """None where there is none, or one of other programs."""
        path = self._path(job, seed, quick)
        if not path.is_file():
            return None
        try:
            document = json.loads(path.read_text(encoding="utf-8"))
        except ValueError:
            return None  # stopped while it was written
        if document.pop("programs") != self._programs:
            return None
        return PaperResult(**document)

    def keep(self, result: PaperResult) -> None:
        document = {"programs": self._programs} | asdict(result)
        path = self._path(result.job, result.seed, result.quick)
        path.write_text(json.dumps(document, indent=1), encoding="utf-8")

    def _path(self, job: str, seed: int, quick: bool) -> Path:
        return self._folder / f"{job}-seed-{seed}{'-quick' if quick else ''}.json"
