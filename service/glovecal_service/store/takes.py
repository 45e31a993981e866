"""Takes: frames with their reference, kept under the subject who wore the glove."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from sqlalchemy import ColumnElement, Connection, bindparam, delete, func, select
from sqlalchemy.exc import IntegrityError

from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import Handedness
from glovecal_models.layout import Layout
from glovecal_models.names import check_identifier
from glovecal_models.takes.camera_reference import CAMERA_PATCHES
from glovecal_models.takes.clock_scan import aligned
from glovecal_models.takes.reference_jumps import without_jumps
from glovecal_models.takes.take import Stretch, Take, poses_at_frames
from glovecal_models.takes.time_code import TimeCode
from glovecal_service.store import tables
from glovecal_service.store.blobs import Artifacts, check_sha256
from glovecal_service.store.changes import tell_change
from glovecal_service.store.database import Database, new_id, now
from glovecal_service.store.errors import Conflict, NotFound, TakenOver
from glovecal_service.store.gloves import latency_of_take
from glovecal_service.store.list_part import WHOLE, Listing, ListPart, Page, TextIn, is_of_hand_in
from glovecal_service.store.records import CLOCK_UNKNOWN, LEFT_OUT, NOTE, TIME_CODE, TakeRecord
from glovecal_service.store.row_hash import add_row, change_rows, sound_row, sound_rows
from glovecal_service.store.subjects import of_subject, require_subject
from glovecal_service.store.take_file import dump_take, frames_hash, load_take
from glovecal_service.store.texts import check_text

CLOCK_OFFSET = "clock_offset_s"
"""Fact of a take: by how much its reference clock was ahead of the frames' before it was repaired."""

CAMERA_REFERENCE = "camera_reference"
"""Fact of a take whose reference a camera measured: its clock offset with its standard deviation, in seconds,
and the range of each rotation that it saw; None where another reference came after."""


UNWRAPPED = "unwrapped"
"""Fact of a take: sentences on angles of its reference that are counted past a full turn."""

AS_SHOWN_S = 0.006
"""Ends of a stretch are shown with two digits, and taken so."""

_LISTING = Listing(
    tables.takes,
    searched=(
        "^id", "name", "subject", "wearing", "layout", "source", "^original_sha256", "^facts.read_as.shape",
        "facts.note",
    ),
)  # fmt: skip


class Takes:
    def __init__(self, database: Database, artifacts: Artifacts) -> None:
        self._database = database
        self._artifacts = artifacts

    def add(
        self,
        take: Take,
        *,
        subject: str,
        layout: str,
        source: str,
        original_sha256: str | None = None,
        accounting: Mapping[str, Any] | None = None,
        recording: str | None = None,
        facts: Mapping[str, Any] | None = None,
    ) -> TakeRecord:
        """Keep one take: ``add_all`` of it alone, with what its recording has to say about it.

        Raises TakenOver where that recording has its take already.
        """
        (record,) = self._keep(
            [take],
            subject,
            layout=layout,
            source=source,
            original_sha256=original_sha256,
            accounting=None if accounting is None else dict(accounting),
            recording=recording,
            facts=dict(facts or {}),
        )
        return record

    def add_all(
        self,
        takes: Sequence[Take],
        *,
        subject: str,
        layout: str,
        source: str,
        original_sha256: str | None = None,
        facts: Mapping[str, Any] | None = None,
    ) -> list[TakeRecord]:
        """Keep the takes of one file in their order, all in one transaction or none.

        The arrays are on disk before any row exists, so a row never points at nothing; what is killed in
        between leaves artifacts that nobody names, never half a file. Raises BadInput (bad names, no
        frames), NotFound (unknown subject), Conflict if the subject has the very same frames already
        (they would be trained and tested on at once), StorageFull; then nothing was kept.
        """
        return self._keep(
            takes, subject, layout=layout, source=source, original_sha256=original_sha256,
            accounting=None, recording=None, facts=dict(facts or {}),
        )  # fmt: skip

    def _keep(self, takes: Sequence[Take], subject: str, **shared: Any) -> list[TakeRecord]:
        """``shared`` are the columns that do not come from the take itself."""
        check_identifier(shared["layout"], "layout")
        check_identifier(shared["source"], "source of the take")
        if shared["original_sha256"] is not None:
            check_sha256(shared["original_sha256"])
        for take in takes:
            _check_keepable(take)
        with self._database.read() as connection:
            require_subject(connection, subject)
        records = [
            TakeRecord(id=new_id(), subject=subject, created_at=now(), **shared, **self._content(take))
            for take in takes
        ]
        with self._database.write() as connection:
            require_subject(connection, subject)
            if shared["recording"] is not None:
                _require_no_take(connection, shared["recording"])
            for take, record in zip(takes, records, strict=True):
                _insert(connection, take, record)
        return records

    def get(self, id: str) -> TakeRecord:
        """Raises NotFound."""
        with self._database.read() as connection:
            return _require(connection, id)

    def list(
        self, subject: str | None = None, layout: str | None = None, part: ListPart = WHOLE
    ) -> list[TakeRecord]:
        """Takes in the order they were added."""
        chosen = _LISTING.every(_of(subject), part=part)
        with self._database.read() as connection:
            wanted = {"subject": subject, "layout": layout}
            return sound_rows(connection, tables.takes, chosen, _record, wanted)

    def page(
        self,
        part: ListPart,
        *,
        subject: str | None = None,
        layout: str | None = None,
        hand: Handedness | None = None,
        among: Iterable[str] | None = None,
    ) -> Page[TakeRecord]:
        """A part of them, oldest first; of one hand those too of which nobody said whose they are. ``among``:
        these ids only."""
        own = tables.takes.c
        ids = None if among is None else bindparam("among", list(among), expanding=True, literal_execute=True)
        with self._database.read() as connection:
            return _LISTING.page(
                connection, _record, part,
                None if subject is None else own.subject == subject,
                None if layout is None else own.layout == layout,
                is_of_hand_in(TextIn(own.accounting, "hand"), hand),
                None if ids is None else own.id.in_(ids),
            )  # fmt: skip

    def count(self, subject: str | None = None) -> int:
        """How many there are of a subject (None: of all)."""
        own = select(func.count()).select_from(tables.takes)
        with self._database.read() as connection:
            return (
                connection.scalar(own if subject is None else own.where(tables.takes.c.subject == subject))
                or 0
            )

    def load(self, id: str) -> Take:
        """The take as it is worked with: ``load_recorded`` without what people left out, and without angles
        that jump away and come back. Raises NotFound, DamagedArtifact."""
        return without_jumps(self.load_recorded(id).without(self.get(id).left_out))

    def load_recorded(self, id: str) -> Take:
        """The take's arrays, verified, with what is known of its glove. Raises NotFound, DamagedArtifact."""
        record = self.get(id)
        with self._database.read() as connection:
            latency = latency_of_take(connection, record)
        return dataclasses.replace(load_take(self._artifacts.get(record.artifact)), glove_latency=latency)

    def attach_reference(
        self,
        id: str,
        time_s: np.ndarray,
        rotations: Sequence[str],
        reference: np.ndarray,
        poses: Sequence[str] | None = None,
        *,
        reference_sd: np.ndarray | None = None,
        context: Mapping[str, np.ndarray] | None = None,
        facts: Mapping[str, Any] | None = None,
    ) -> TakeRecord:
        """Give a take its reference angles, (R,) seconds and (R, len(rotations)) degrees.

        ``reference_sd``: their standard deviations where stated; ``context``: columns at the frames that come
        with them; ``facts`` tell where they come from.

        ``poses`` (R,) names the pose at each reference row; None leaves the take's own names as they are.

        The id stays; the artifact that was there is listed in ``facts["history"]``. Raises NotFound,
        BadInput, StorageFull, Conflict if the take was changed meanwhile.
        """
        earlier = self.get(id)
        take = load_take(self._artifacts.get(earlier.artifact))
        take = dataclasses.replace(
            take,
            reference_time_s=time_s,
            rotations=tuple(rotations),
            reference=reference,
            reference_sd=reference_sd,
            context={name: take.context[name] for name in take.context if name != CAMERA_PATCHES}
            | dict(context or {}),
            poses=take.poses if poses is None else poses_at_frames(take.time_s, time_s, poses),
        )
        return self._replace(earlier, take, _of_another_reference(earlier) | dict(facts or {}))

    def same_frames(self, take: Take, subject: str, layout: str) -> TakeRecord | None:
        """The take of ``subject`` and ``layout`` with exactly these frames, whatever it is called."""
        with self._database.read() as connection:
            return _with_frames(connection, subject, layout, frames_hash(take))

    def correct(self, id: str, take: Take, *, layout: str, original_sha256: str) -> TakeRecord:
        """Give a take all that its corrected file says beside the frames, which are the same.

        The id stays; the artifact that was there is listed in ``facts["history"]``. Raises NotFound,
        BadInput, StorageFull, Conflict if the take was changed meanwhile.
        """
        _check_keepable(take)
        earlier = self.get(id)
        columns = {"layout": layout, "original_sha256": check_sha256(original_sha256)}
        return self._replace(earlier, take, _of_another_reference(earlier), **columns)

    def shift_reference(self, id: str, seconds: float) -> TakeRecord:
        """Move a take's reference in time, later by ``seconds``; ``facts`` keep the sum of all shifts.

        Raises NotFound, BadInput without a reference, StorageFull, Conflict if it was changed meanwhile.
        """
        earlier = self.get(id)
        if not earlier.reference_rows:
            raise BadInput(f"take {id} ({earlier.name}) has no reference whose clock could be moved")
        take = load_take(self._artifacts.get(earlier.artifact))
        take = aligned(take, -seconds)
        total = earlier.facts.get(CLOCK_OFFSET, 0.0) - seconds
        return self._replace(earlier, take, {CLOCK_OFFSET: round(total, 9)})

    def note_clock(self, id: str, *, unknown: bool) -> TakeRecord:
        """Keep whether a repair of clocks did not find that of this take's reference. Raises NotFound."""
        earlier = self.get(id)
        if bool(earlier.facts.get(CLOCK_UNKNOWN)) == unknown:
            return earlier
        same = (tables.takes.c.id == id) & (tables.takes.c.artifact == earlier.artifact)
        with self._database.write() as connection:
            facts = {**earlier.facts, CLOCK_UNKNOWN: unknown}
            if not change_rows(connection, tables.takes, same, {"facts": facts}):
                raise Conflict(f"take {id} was changed or removed meanwhile; look at it again")
            return _require(connection, id)

    def describe(self, id: str, *, note: str) -> TakeRecord:
        """What people want to remember of it; "" for nothing. Raises NotFound."""
        return self._with_facts(id, lambda facts: {NOTE: note})

    def note_time_code(self, id: str, time_code: TimeCode | None) -> TakeRecord:
        """Which SMPTE time code it has; None: none is known. Raises NotFound."""
        document = None if time_code is None else time_code.document()
        return self._with_facts(id, lambda facts: {TIME_CODE: document})

    def leave_out(self, id: str, stretch: Stretch) -> TakeRecord:
        """Leave frames and reference between two times, seconds since its first frame, out of all work with
        the take; what is stored of it stays.

        Raises NotFound, and BadInput for no stretch of it, and for one without which nothing is left.
        """
        (low, high), record = stretch, self.get(id)
        if not 0.0 <= low < high or low > record.duration_s:
            raise BadInput(
                f"{low:g} to {high:g} s is no stretch of take {record.name!r}, which lasts "
                f"{record.duration_s:.2f} s: give two different times inside it, the earlier one first"
            )
        stretch = (low, min(high, record.duration_s))
        left = self.load_recorded(id).without([*record.left_out, stretch])
        if left.pre_roll_frames == len(left.time_s):
            raise BadInput(
                f"no frame of take {record.name!r} would be left; leave out less of it, or remove the take"
            )
        if record.has_reference and not np.isfinite(left.reference).any():
            raise BadInput(
                f"no measured angle of take {record.name!r} would be left; leave out less of it, or choose "
                "other takes to work with"
            )
        return self._note_left_out(id, lambda now: [*(each for each in now if each != stretch), stretch])

    def use_again(self, id: str, stretch: Stretch | None = None) -> TakeRecord:
        """Undo ``leave_out`` of that stretch, or the latest one. Raises NotFound, BadInput without it."""
        record = self.get(id)
        if not record.left_out:
            raise BadInput(f"nothing of take {record.name!r} is left out: there is nothing to undo")
        alike = [
            each for each in record.left_out if stretch is None or np.allclose(each, stretch, atol=AS_SHOWN_S)
        ]
        if not alike:
            known = ", ".join(f"{low:.2f} to {high:.2f} s" for low, high in record.left_out)
            raise BadInput(
                f"those seconds of take {record.name!r} are not what is left out: give one of {known}"
            )
        return self._note_left_out(id, lambda now: [each for each in now if each != alike[-1]])

    def _note_left_out(self, id: str, change: Callable[[tuple[Stretch, ...]], list[Stretch]]) -> TakeRecord:
        def changed(facts: dict[str, Any]) -> dict[str, Any]:
            return {LEFT_OUT: change(tuple((low, high) for low, high in facts.get(LEFT_OUT, ())))}

        return self._with_facts(id, changed)

    def _with_facts(self, id: str, new: Callable[[dict[str, Any]], dict[str, Any]]) -> TakeRecord:
        def changed(row: dict[str, Any]) -> dict[str, Any]:
            return {"facts": {**row["facts"], **new(row["facts"])}}

        with self._database.write() as connection:
            change_rows(connection, tables.takes, tables.takes.c.id == id, changed)
            return _require(connection, id)

    def repair(self, id: str, frames: Take, accounting: Mapping[str, Any]) -> TakeRecord:
        """Give a recorded take the frames that were fetched later; its reference and pose names stay.

        ``frames`` is the whole take as recorded. Raises NotFound, StorageFull, Conflict if the take was
        changed meanwhile.
        """
        earlier = self.get(id)
        before = load_take(self._artifacts.get(earlier.artifact))
        take = dataclasses.replace(
            frames,
            rotations=before.rotations,
            reference_time_s=before.reference_time_s,
            reference=before.reference,
            reference_sd=before.reference_sd,
            poses=before.poses and poses_at_frames(frames.time_s, before.time_s, before.poses),
        )
        found = {"accounting": dict(accounting), "frames_sha256": frames_hash(take)}
        later = float(before.time_s[0] - take.time_s[0])  # by so much the first frame is another one
        left_out = [(low + later, high + later) for low, high in earlier.left_out]
        return self._replace(earlier, take, {LEFT_OUT: left_out} if left_out else {}, **found)

    def use_layout(self, id: str, layout: Layout) -> TakeRecord:
        """Read a take's rotations as ``layout`` says from now on; its frames stay as they are.

        Raises NotFound, BadInput when the take lacks a sensor of the layout.
        """
        missing = [name for name in layout.sensors if name not in self.get(id).sensors]
        if missing:
            raise BadInput(f"take {id} has no sensor {missing[0]}, which layout {layout.name!r} reads")
        with self._database.write() as connection:
            change_rows(connection, tables.takes, tables.takes.c.id == id, {"layout": layout.name})
            return _require(connection, id)

    def _replace(self, earlier: TakeRecord, take: Take, facts: dict[str, Any], **columns: Any) -> TakeRecord:
        """Store ``take`` in the place of ``earlier``, whose artifact, if another, stays on file."""
        content = self._content(take)
        history = earlier.facts.get("history", [])
        if content["artifact"] != earlier.artifact:
            history = [*history, {"artifact": earlier.artifact, "until": now().isoformat()}]
        values = {**content, **columns, "facts": {**earlier.facts, **facts, "history": history}}
        same = (tables.takes.c.id == earlier.id) & (tables.takes.c.artifact == earlier.artifact)
        with self._database.write() as connection:
            if not change_rows(connection, tables.takes, same, values):
                raise Conflict(f"take {earlier.id} was changed or removed meanwhile; look at it again")
            return _require(connection, earlier.id)

    def remove(self, id: str) -> None:
        """Forget a take (its artifact stays). Raises NotFound, Conflict if a model was trained on it."""
        with self._database.write() as connection:
            record = _require(connection, id)
            if model := _trained_on(connection, record):
                raise Conflict(
                    f"model {model[:12]} was trained on take {id} ({record.name}), so it stays: a "
                    "model can always name what it learned from"
                )
            connection.execute(delete(tables.takes).where(tables.takes.c.id == id))

    def _content(self, take: Take) -> dict[str, Any]:
        measured = bool(len(take.reference_time_s)) and np.isfinite(take.reference).any(axis=0)
        return {
            "artifact": self._artifacts.put(dump_take(take)),
            "name": take.name,
            "wearing": take.wearing,
            "sensors": take.sensors,
            "rotations": tuple(np.array(take.rotations, dtype=object)[measured]) if take.rotations else (),
            "context": tuple(take.context),
            "frames": len(take.time_s),
            "reference_rows": len(take.reference_time_s),
            "duration_s": take.duration_s,
            "simulated": take.simulated,
        }


def _trained_on(connection: Connection, record: TakeRecord) -> str | None:
    """A model that learned from the take. All rows of the subject's models are looked at: in a damaged one
    the name of this very take may be lost."""
    table, models = tables.model_takes, tables.models
    own = select(models.c.id).where(models.c.subject == record.subject)
    possible = select(table).where((table.c.take == record.id) | table.c.model.in_(own))
    rows = sound_rows(connection, table, possible, dict)
    return next((row["model"] for row in rows if row["take"] == record.id), None)


def _check_keepable(take: Take) -> None:
    check_text(take.name, "name of the take")
    check_text(take.wearing, f"wearing of take {take.name!r}", empty=True)
    if len(take.time_s) == 0:
        raise BadInput(f"take {take.name!r} holds no frames")


def _require_no_take(connection: Connection, recording: str) -> None:
    tell_change(connection, "recording")  # one transaction after the other, on PostgreSQL too
    table = tables.takes
    there = connection.scalar(select(table.c.name).where(table.c.recording == recording).limit(1))
    if there is not None:
        raise TakenOver(f"the recording has a take already, {there!r}")


def _insert(connection: Connection, take: Take, record: TakeRecord) -> None:
    values = {**record.__dict__, "frames_sha256": frames_hash(take)}
    if here := _with_frames(connection, record.subject, record.layout, values["frames_sha256"]):
        raise Conflict(
            f"subject {record.subject!r} has exactly the frames of {take.name!r} already: take {here.name} "
            f"({here.id}). To replace its reference and names, import the file with --replace (over REST "
            f"replace=true); to remove it: glovecal take remove {here.id}"
        )
    try:
        add_row(connection, tables.takes, values)
    except IntegrityError as error:
        raise Conflict(
            f"subject {record.subject!r} already has a take with exactly the frames of {take.name!r}"
        ) from error


def _with_frames(connection: Connection, subject: str, layout: str, digest: str) -> TakeRecord | None:
    of = tables.takes.c
    same = (of.subject == subject) & (of.layout == layout) & (of.frames_sha256 == digest)
    row = connection.execute(select(tables.takes).where(same)).first()
    return None if row is None else _record(sound_row(tables.takes, row))


def _of_another_reference(record: TakeRecord) -> dict[str, Any]:
    """What a take's facts say of a reference that is not known of the next one."""
    unknown = {CLOCK_OFFSET: 0.0, CLOCK_UNKNOWN: False, CAMERA_REFERENCE: None, UNWRAPPED: []}
    return {name: unknown[name] for name in unknown if name in record.facts}


def _of(subject: str | None) -> ColumnElement[bool] | None:
    return None if subject is None else of_subject(tables.takes, subject)


def _require(connection: Connection, id: str) -> TakeRecord:
    row = connection.execute(select(tables.takes).where(tables.takes.c.id == id)).one_or_none()
    if row is None:
        raise NotFound(f"there is no take {id!r}. List them: glovecal take list")
    return _record(sound_row(tables.takes, row))


def _record(values: dict[str, Any]) -> TakeRecord:
    values = {name: value for name, value in values.items() if name != "frames_sha256"}
    for name in ("sensors", "rotations", "context"):
        values[name] = tuple(values[name])
    return TakeRecord(**values)
