"""Importing a take table: all takes of the file, or none."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import numpy as np

from glovecal_models.calibration.samples import require_layout
from glovecal_models.errors import BadInput
from glovecal_models.layout import Layout
from glovecal_models.takes.angles_on_a_circle import unwrapped
from glovecal_models.takes.take import Take
from glovecal_models.takes.take_check import alike_once, take_warnings
from glovecal_service.store.errors import Conflict, DamagedRows
from glovecal_service.store.list_part import ListPart
from glovecal_service.store.records import TakeRecord
from glovecal_service.store.store import Store

MADE_OF_COLUMNS = "auto-"
"""Begins the names of layouts that an import made."""
NEAR_A_HALF_TURN_DEG = 120.0
"""Angles that stay below are counted as they are, whatever other takes hold."""


@dataclass(frozen=True)
class Import:
    """What became of a file."""

    layout: str
    takes: list[TakeRecord]
    """All takes of the file, in its order."""
    existing: set[str]
    """Ids of those that this very file had brought before: sending a file twice is harmless."""
    warnings: list[str]
    subject_created: bool
    """Whether the subject was not there before."""
    replaced: set[str]
    """Ids of those whose frames were here, and whose reference and names are now those of the file."""

    @property
    def imported(self) -> list[str]:
        return [record.id for record in self.takes if record.id not in self.existing | self.replaced]


def import_takes(
    store: Store,
    read: Callable[[], list[Take]],
    *,
    original_sha256: str,
    subject: str,
    layout: str | None,
    create_subject: bool = False,
    replace: bool = False,
    facts: Mapping[str, Any] | None = None,
) -> Import:
    """Keep all takes that ``read`` finds. Without ``layout`` the file's columns make one.

    A file that another subject has already is refused: one recording is of one hand. With ``create_subject``
    a subject that is not there is added with the takes. With ``replace`` a take whose frames are here already
    gets what this file says beside them, and keeps its id; else that is a Conflict. New takes keep ``facts``.
    Raises BadInput
    (BadTakeTable, LayoutMismatch), NotFound, Conflict, StorageFull; then nothing was imported, and no subject
    added.
    """
    is_new = create_subject and subject not in {record.name for record in store.subjects.list()}
    if not is_new:
        store.subjects.get(subject)
    known = None if layout is None else store.layouts.get(layout)
    _require_no_other_owner(store, original_sha256, subject)
    takes = read()
    if not takes:
        raise BadInput("the file holds no takes: there is no row below the header")
    chosen = known or _layout_of_columns(store, takes)
    for take in takes:
        _require_fits(take, chosen)
    stored_before = store.takes.list(subject=subject, layout=chosen.name)
    stored = {item.name: item for item in stored_before if item.original_sha256 == original_sha256}
    held = (
        {take.name: store.takes.same_frames(take, subject, chosen.name) for take in takes}
        if replace and not is_new
        else {}
    )
    corrected = {name: record for name, record in held.items() if record is not None}
    existing = {
        take.name: _same(take, stored[take.name])
        for take in takes
        if take.name in stored and take.name not in corrected
    }
    changed = [take for take in takes if take.name not in existing]
    beside = _newest_measured(store, stored_before, changed)
    circle = unwrapped(changed, [] if beside is None else [store.takes.load(beside.id)])
    with ExitStack() as undo:
        if is_new:
            store.subjects.create(subject)
            undo.callback(store.subjects.remove, subject)
        added = store.takes.add_all(
            [take for take in circle.takes if take.name not in corrected],
            subject=subject,
            layout=chosen.name,
            source="import",
            original_sha256=original_sha256,
            facts=facts,
        )
        undo.pop_all()
    for take in circle.takes:
        if take.name in corrected:
            corrected[take.name] = store.takes.correct(
                corrected[take.name].id, take, layout=chosen.name, original_sha256=original_sha256
            )
    by_name = existing | corrected | {record.name: record for record in added}
    return Import(
        chosen.name,
        [by_name[take.name] for take in takes],
        {record.id for record in existing.values()},
        [*alike_once(circle.sentences), *take_warnings(_now_unwrapped(takes, circle.takes))],
        is_new,
        {record.id for record in corrected.values()},
    )


def _now_unwrapped(takes: Sequence[Take], new: Sequence[Take]) -> list[Take]:
    by_name = {take.name: take for take in new}
    return [by_name.get(take.name, take) for take in takes]


def _newest_measured(store: Store, records: Sequence[TakeRecord], new: Sequence[Take]) -> TakeRecord | None:
    """The take whose angles tell from where those of ``new`` are counted; None where nothing is near a half
    turn, or nothing was measured before."""
    near = {
        name
        for take in new
        for name, angles in zip(take.rotations, take.reference.T, strict=True)
        if np.nanmax(np.abs(angles), initial=0.0) > NEAR_A_HALF_TURN_DEG
    }
    return next((item for item in reversed(records) if near & set(item.rotations)), None)


def _require_no_other_owner(store: Store, original_sha256: str, subject: str) -> None:
    try:
        every = store.takes.list(part=ListPart(text=original_sha256))
    except DamagedRows as error:  # a damaged row of anyone must not end all imports
        every = error.sound
    for record in every:
        if record.original_sha256 == original_sha256 and record.subject != subject:
            raise Conflict(
                f"this file already belongs to {record.subject} (take {record.name}, {record.id}); use "
                f"subject {record.subject}, or remove its takes there first"
            )


def _require_fits(take: Take, layout: Layout) -> None:
    """Further rotations are kept, but a take none of whose rotations the layout has is a mistake."""
    require_layout(take, layout)
    unknown = [name for name in take.rotations if name not in layout.rotations]
    if unknown and len(unknown) == len(take.rotations):
        raise BadInput(
            f"take {take.name!r} measured {', '.join(unknown)}, none of which layout {layout.name!r} has; "
            f"its rotations are {', '.join(layout.rotations)}"
        )


def _same(take: Take, record: TakeRecord) -> TakeRecord:
    if len(take.reference_time_s) != record.reference_rows:
        raise Conflict(
            f"take {take.name!r} of this file is here already ({record.id}) with another reference. To "
            "replace it, import the file with --replace (over REST replace=true)"
        )
    return record


def _layout_of_columns(store: Store, takes: list[Take]) -> Layout:
    """The layout of a file that nobody named one for, by its columns.

    One that is there already (built in, or made of another file's columns) when it has the same sensors
    and all the rotations; else a new one: each rotation from the sensor of its name, else from all.
    """
    sensors = takes[0].sensors
    rotations = list(dict.fromkeys(name for take in takes for name in take.rotations))
    if not rotations and any(take.poses is not None for take in takes):
        rotations = list(sensors)
    for record in store.layouts.list():
        if record.built_in or record.name.startswith(MADE_OF_COLUMNS):
            layout = Layout.from_document(record.document)
            if set(layout.sensors) == set(sensors) and set(rotations) <= set(layout.rotations):
                return layout
    if not rotations:
        raise BadInput(
            "the file has no r.ROTATION columns (reference angles in degrees, which a model is learned from) "
            f"and no known layout has the sensors {', '.join(sensors)}: name a layout to import it all the "
            "same"
        )
    digest = hashlib.sha256(" ".join([*sensors, "", *rotations]).encode()).hexdigest()
    layout = Layout.from_columns(MADE_OF_COLUMNS + digest[:8], sensors, rotations)
    store.layouts.put(layout)
    return layout
