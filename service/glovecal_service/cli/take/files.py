"""Takes in files: their reference tables, the subject they are imported under, warnings over all files."""

from __future__ import annotations

import difflib
import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from glovecal_client.errors import ServiceError
from glovecal_models.takes.take_check import kind_of
from glovecal_service.cli.take.rows import stored_takes
from glovecal_service.cli.terminal.connection import subject_names
from glovecal_service.cli.terminal.printing import Refusal, err, exit_code_of, sentence_of
from glovecal_service.plain import read
from glovecal_service.rest.take.answer import ImportedTakes, Take

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient

PREFIX = "improve-"
READ_BYTES = 1 << 20


@dataclass
class FileSubject:
    """The subject under which files are imported, and their layout once it is known."""

    service: RestClient
    name: str
    layout: str | None
    spread: bool = False
    """Whether frames stamped in batches are spread up to the next batch."""

    @classmethod
    def of(
        cls,
        service: RestClient,
        files: Sequence[Path],
        *,
        subject: str | None,
        layout: str | None,
        spread: bool = False,
    ) -> FileSubject:
        """``subject``, else whoever has one of the files already, else a new one named after the first."""
        hashes = [_sha256(file) for file in files]
        rows = [] if subject is not None else stored_takes(service)
        owners = [row.subject for row in rows if row.original_sha256 in hashes]
        name = subject or next(iter(owners), PREFIX + hashes[0][:8])
        if name not in subject_names(service):
            service.post("/subjects", {"name": name, "title": f"Takes of {files[0].name}"})
            if subject is not None:
                err.print(added_subject(service, subject), style="yellow")
        return cls(service, name, layout, spread)

    def take_ids(self, files: Sequence[Path]) -> list[str]:
        """Ids of the takes in ``files``, imported unless they were. Raises Refusal that names the file."""
        warnings = ImportWarnings()
        rows = [row for file in frames_among(files) for row in self._imported(file, warnings)]
        warnings.print()
        return [row.id for row in rows]

    def _imported(self, file: Path, warnings: ImportWarnings) -> list[Take]:
        from glovecal_models.takes.table import reference_beside

        self._require_layout(file)
        try:
            document = self.service.upload_takes(
                file,
                subject=self.name,
                layout=self.layout,
                reference=reference_beside(file),
                **({"equal_times": "spread"} if self.spread else {}),
            )
        except ServiceError as error:
            if exit_code_of(error) != 1:
                raise
            raise Refusal(f"{file}: {sentence_of(error)}") from error
        answer = read(ImportedTakes, document)
        self.layout = answer.layout
        warnings.add(file, answer.warnings)
        return answer.takes

    def _require_layout(self, file: Path) -> None:
        digest = _sha256(file)
        for row in stored_takes(self.service, subject=self.name):
            if row.original_sha256 == digest and self.layout not in (None, row.layout):
                raise Refusal(
                    f"{file} was imported before with layout {row.layout}, not {self.layout}; give that "
                    "one, or set GLOVECAL_DATA to another folder"
                )


def _sha256(file: Path) -> str:
    digest = hashlib.sha256()
    with file.open("rb") as stream:
        while chunk := stream.read(READ_BYTES):
            digest.update(chunk)
    return digest.hexdigest()


def added_subject(service: RestClient, subject: str) -> str:
    """What to say of a subject that a file's import added, so that a mistyped name is seen and undone."""
    others = [name for name in subject_names(service) if name != subject]
    near = difflib.get_close_matches(subject, others, n=3)
    similar = f" Similar: {', '.join(near)}." if near else ""
    return f"Added subject {subject}.{similar} To undo: glovecal subject remove {subject} --takes"


def frames_among(files: Sequence[Path]) -> list[Path]:
    """``files`` without those that are the reference table of another one."""
    from glovecal_models.takes.table import reference_beside

    return [
        file
        for file in dict.fromkeys(files)
        if not any(reference_beside(other) == file for other in files if other != file)
    ]


class ImportWarnings:
    def __init__(self) -> None:
        self._alike: dict[str, list[str]] = {}

    def add(self, file: Path, sentences: Iterable[str]) -> None:
        for sentence in sentences:
            self._alike.setdefault(kind_of(sentence), []).append(f"{file}: {sentence}")

    def print(self) -> None:
        """On standard error: the first of each kind, and how many more files have it."""
        for first, *more in self._alike.values():
            files = "file" if len(more) == 1 else "files"
            err.print(f"{first} The same in {len(more)} more {files}." if more else first, style="yellow")
