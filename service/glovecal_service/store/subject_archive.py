"""All that is kept of one subject, as one zip file that is made while it is sent: never more of it in memory
than one artifact.
"""

from __future__ import annotations

import hashlib
import json
import zipfile
from collections.abc import Iterable, Iterator
from datetime import UTC, datetime
from io import RawIOBase
from typing import Any

from glovecal_models.errors import DamagedArtifact
from glovecal_service.plain import plain
from glovecal_service.store.belongings import (
    Belongings,
    artifacts_of,
    films_of,
    parts_of,
    recording_files,
)
from glovecal_service.store.errors import DamagedRows, NotFound, StoreUnavailable
from glovecal_service.store.store import Store
from glovecal_service.store.subject_audit import SubjectAudit
from glovecal_service.store.take_file import video_of

README, MANIFEST = "README.txt", "manifest.json"
AUDIT = "audit.jsonl"
ABOUT = """\
Everything that Glovecal keeps of subject {name}, written {at}.

subject.json            name, title, sizes of the hand in mm, which hand
wearings.json           each time a glove was put on, with the glove where that is known
gloves.json             gloves that are assigned to the subject now
takes/ID/about.json     a take: name, wearing, sensors, rotations, seconds, how its frames are accounted for
takes/ID/take-1.safetensors
                        its readings and reference angles, with times in seconds; take-2 and on: as they were
                        before its reference was replaced. Read it by safetensors.numpy.load_file(FILE)
takes/ID/video.zip      pictures filmed beside it (JPEG), with their times in video.json
originals/SHA256        files that takes were imported from, as they were given
recordings/ID/about.json
                        a recording: which glove, when, what became of it
recordings/ID/*.glog    frames as they came from the glove, with those from before the recording began;
                        glovecal_client.frame_log reads them
films/*                 whole films made while a take was recorded (.mkv), with the time of each picture.
                        They may show others who were there.
models/ID/about.json    a calibration model: method, layout, takes it learned from, errors in degrees
models/ID/model.safetensors
                        the model; glovecal model import reads it
activations.json        which model was used since when
samplings/ID.json       guided samplings: what was asked for and done
jobs/ID.json            trainings, comparisons and other work: what was asked, steps, result
audit.jsonl             changes that concern the subject, one a line, oldest first: who, when, what before and
                        after. Other people are not named.
manifest.json           size and sha256 of each file here but itself, and what could not be read

Not here: frames in the logs of capture computers, and copies in backups.
"""


class SubjectArchive:
    """``parts()`` gives it; what is removed meanwhile is named in the manifest instead of being there."""

    def __init__(self, store: Store, name: str) -> None:
        """Raises NotFound for a subject that is not there, or not for who asks."""
        self._store = store
        self._of = Belongings.of(store, name)
        self._sink = _Sink()
        self._files: list[dict[str, Any]] = []
        self._problems = list(self._of.damaged)
        self._at = datetime.now(UTC)

    def parts(self) -> Iterator[bytes]:
        """The bytes of the zip file, its manifest last."""
        with zipfile.ZipFile(self._sink, "w", zipfile.ZIP_STORED) as archive:
            for name, content in self._contents():
                yield from self._file(archive, name, content)
            manifest = {
                "format": "glovecal.subject.v1", "subject": self._of.subject.name,
                "written_at": self._at.isoformat(), "files": self._files, "problems": self._problems,
            }  # fmt: skip
            yield from self._file(archive, MANIFEST, iter([_json(manifest)]))
        yield self._sink.taken()

    def _file(self, archive: zipfile.ZipFile, name: str, content: Iterable[bytes]) -> Iterator[bytes]:
        entry = zipfile.ZipInfo(name, self._at.timetuple()[:6])
        digest, size = hashlib.sha256(), 0
        with archive.open(entry, "w", force_zip64=True) as file:
            for part in content:
                digest.update(part)
                size += len(part)
                file.write(part)
                yield self._sink.taken()
        self._files.append({"name": name, "bytes": size, "sha256": digest.hexdigest()})

    def _contents(self) -> Iterator[tuple[str, Iterator[bytes]]]:
        of = self._of
        about = ABOUT.format(name=of.subject.name, at=self._at.isoformat(timespec="seconds"))
        documents = {
            "subject": of.subject, "wearings": of.wearings(), "gloves": of.gloves,
            "activations": of.activations,
        }  # fmt: skip
        yield README, iter([about.encode()])
        for name, document in documents.items():
            yield f"{name}.json", iter([_json(document)])
        yield from self._of_takes()
        for row in of.recordings:
            yield f"recordings/{row.id}/about.json", iter([_json(row)])
            for file in recording_files(self._store, row.id):
                yield f"recordings/{row.id}/{file.partition('/')[2]}", self._kept(file)
        for model in of.models:
            yield f"models/{model.id}/about.json", iter([_json(model)])
            yield f"models/{model.id}/model.safetensors", self._artifact(model.id)
        for sampling in of.samplings:
            yield f"samplings/{sampling.id}.json", iter([_json(sampling)])
        for job in of.jobs:
            yield f"jobs/{job.id}.json", iter([_json({**vars(job), "steps": self._steps(job.id)})])
        audit = SubjectAudit(self._store.audit, of.subject.name, of.ids)
        yield AUDIT, (f"{json.dumps(plain(entry))}\n".encode() for entry in audit.own())

    def _of_takes(self) -> Iterator[tuple[str, Iterator[bytes]]]:
        of = self._of
        for take in of.takes:
            yield f"takes/{take.id}/about.json", iter([_json(take)])
            for number, artifact in enumerate(artifacts_of(take.artifact, take.facts), 1):
                yield f"takes/{take.id}/take-{number}.safetensors", self._artifact(artifact)
            if self._store.files.names(video_of(take.id)):
                yield f"takes/{take.id}/video.zip", self._kept(video_of(take.id))
        for sha256 in dict.fromkeys(take.original_sha256 for take in of.takes):
            if sha256 is not None and self._store.files.names(f"uploads/{sha256}"):
                yield f"originals/{sha256}", self._kept(f"uploads/{sha256}")
        if self._store.actor.subjects is None:  # films do not say whose they are
            for film in films_of(self._store, of.takes):
                yield film, self._kept(film)

    def _artifact(self, sha256: str) -> Iterator[bytes]:
        return self._read((self._store.artifacts.get(each) for each in [sha256]), sha256)

    def _kept(self, file: str) -> Iterator[bytes]:
        def parts() -> Iterator[bytes]:
            path = self._store.files.find(file)
            if path is not None:
                yield from parts_of(path)

        return self._read(parts(), file.partition("/")[2])

    def _read(self, parts: Iterator[bytes], name: str) -> Iterator[bytes]:
        try:
            yield from parts
        except StoreUnavailable as error:
            self._problems.append(f"{name} is not here: {error}")
        except (DamagedArtifact, NotFound, OSError):
            self._problems.append(f"{name} is missing or damaged: what is here of it is not whole")

    def _steps(self, job: str) -> list[Any]:
        try:
            return self._store.jobs.events(job)
        except DamagedRows as error:
            self._problems.extend(error.damaged)
            return error.sound
        except NotFound:  # removed meanwhile
            return []


def _json(document: Any) -> bytes:
    return json.dumps(plain(_as_data(document)), indent=2, ensure_ascii=False).encode()


def _as_data(value: Any) -> Any:
    """Records as dictionaries."""
    if isinstance(value, list):
        return [_as_data(item) for item in value]
    value = value if isinstance(value, dict) else vars(value)
    return {key: _as_data(item) if _is_record(item) else item for key, item in value.items()}


def _is_record(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and hasattr(value[0], "__dataclass_fields__")


class _Sink(RawIOBase):
    """What the zip file writes, until it is taken: it is never read again, nor written in its middle."""

    def __init__(self) -> None:
        self._waiting = bytearray()

    def writable(self) -> bool:
        return True

    def write(self, part: Any) -> int:
        self._waiting += part
        return len(part)

    def taken(self) -> bytes:
        waiting, self._waiting = bytes(self._waiting), bytearray()
        return waiting
