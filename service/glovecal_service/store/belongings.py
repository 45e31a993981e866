"""What is of one subject: rows of the store and files of the data folder. An export holds it, an erasure
removes it, so what is found here is found by both.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from glovecal_client.encryption.kept_file import open_kept
from glovecal_client.errors import ClientError
from glovecal_client.pictures.video_file import read_about, read_times
from glovecal_models.errors import BadInput, DamagedArtifact
from glovecal_service.store.errors import DamagedRows, NotFound
from glovecal_service.store.records import (
    Activation,
    GloveRecord,
    JobRecord,
    ModelRecord,
    RecordingRecord,
    SamplingRecord,
    SubjectRecord,
    TakeRecord,
)
from glovecal_service.store.store import Store
from glovecal_service.store.take_file import VideoFacts, Videos


@dataclass(frozen=True)
class Belongings:
    subject: SubjectRecord
    takes: list[TakeRecord]
    models: list[ModelRecord]
    """Those that were removed from lists, too."""
    activations: list[Activation]
    recordings: list[RecordingRecord]
    samplings: list[SamplingRecord]
    jobs: list[JobRecord]
    gloves: list[GloveRecord]
    """That it wears now."""
    damaged: list[str] = field(default_factory=list)
    """Rows that cannot be read, a sentence each: they may be of this subject."""

    @classmethod
    def of(cls, store: Store, name: str) -> Belongings:
        """Raises NotFound."""
        subject = store.subjects.get(name)
        damaged: list[str] = []

        def own(read: Callable[[], list[Any]]) -> list[Any]:
            try:
                rows = read()
            except DamagedRows as error:
                damaged.extend(sentence for sentence in error.damaged if sentence not in damaged)
                rows = error.sound
            return [row for row in rows if row.subject == name]

        models = own(lambda: store.models.list(name)) + own(lambda: store.models.list(name, removed=True))
        layouts = sorted({model.layout for model in models})
        return cls(
            subject=subject,
            takes=own(lambda: store.takes.list(name)),
            models=models,
            activations=[
                row for layout in layouts for row in own(lambda of=layout: store.models.activations(name, of))
            ],
            recordings=own(store.recordings.list),
            samplings=own(store.samplings.list),
            jobs=own(lambda: store.jobs.list(subject=name)),
            gloves=own(store.gloves.list),
            damaged=damaged,
        )

    @property
    def ids(self) -> set[str]:
        """Of its takes, models, recordings, samplings and jobs."""
        rows = (*self.takes, *self.models, *self.recordings, *self.samplings, *self.jobs)
        return {row.id for row in rows}

    def wearings(self) -> list[dict[str, str]]:
        """Each wearing once, in the order of its first take or recording, with the glove where that is
        known."""
        gloves = {row.id: row.glove for row in self.recordings}
        rows = [(take.wearing, gloves.get(take.recording or "", "")) for take in self.takes]
        rows += [(row.wearing or "", row.glove) for row in self.recordings[::-1]]
        return [{"wearing": wearing, "glove": glove} for wearing, glove in dict.fromkeys(rows)]


def artifacts_of(artifact: str, facts: Mapping[str, Any]) -> list[str]:
    """Of a take's arrays as they are, and as they were with earlier references: sha256, the newest first."""
    earlier = [str(one["artifact"]) for one in facts.get("history", [])]
    return list(dict.fromkeys([artifact, *earlier[::-1]]))


def recording_files(store: Store, id: str) -> list[str]:
    """What the recorder wrote of a recording, frames as they came with its pre-roll: paths below the data
    folder."""
    return store.files.names(f"recordings/{id}.")


def films_of(store: Store, takes: list[TakeRecord]) -> list[str]:
    """Films that were made while one of ``takes`` was recorded, with their tables of times: by the clock of
    the computer that filmed, as the takes' videos have it. Paths below the data folder."""
    videos = Videos(store.files)
    spans = []
    for take in takes:
        try:
            spans.append(videos.facts(take.id))
        except (NotFound, BadInput, DamagedArtifact):
            continue
    if not spans:
        return []
    films: dict[str, list[str]] = {}
    for file in store.files.names("films/"):
        films.setdefault(file.partition(".")[0], []).append(file)
    return [
        file
        for film, parts in films.items()
        if any(_shows(store, film, span) for span in spans)
        for file in parts
    ]


def _shows(store: Store, film: str, video: VideoFacts) -> bool:
    """``film``: without its ending. Of one that lies elsewhere its times are fetched, not its pictures."""
    times, about = (store.files.find(f"{film}{end}") for end in (".times.csv", ".json"))
    if times is None or about is None:
        return False
    place = about.with_suffix(".mkv")
    try:
        times_s = [at_ns / 1e9 for at_ns, _ in read_times(place)]
    except ClientError:
        return False
    if not times_s or read_about(place).get("computer") != video.computer:
        return False
    return times_s[0] <= video.times_s[-1] and video.times_s[0] <= times_s[-1]


def parts_of(path: Path, size: int = 1 << 20) -> Iterator[bytes]:
    """Of a file. Raises OSError."""
    with open_kept(path) as file:
        while part := file.read(size):
            yield part
