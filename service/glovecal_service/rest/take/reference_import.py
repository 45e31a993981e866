"""``takes/references``: files with the angles of another measuring system, and their takes."""

from __future__ import annotations

import numpy as np
from fastapi import APIRouter
from pydantic import Field, FiniteFloat

from glovecal_models.errors import BadInput
from glovecal_models.hand.rotations import Handedness
from glovecal_models.takes.angles_on_a_circle import unwrapped
from glovecal_models.takes.joined_reference import ReferencesByTake, join_reference, with_reference
from glovecal_service.request_types import ID, SubjectName
from glovecal_service.rest.http.dependencies import Parts, PartsNeeded
from glovecal_service.rest.http.problem import change_problems
from glovecal_service.rest.take.answer import PossibleTake, ReferencePreview, ReferenceRotation, Take
from glovecal_service.rest.take.uploaded_files import UploadedReference, read_uploaded
from glovecal_service.store.errors import NotFound
from glovecal_service.store.list_part import ListPart
from glovecal_service.store.records import TakeRecord
from glovecal_service.store.takes import UNWRAPPED

router = APIRouter(prefix="/takes/references", tags=["takes"])
MOST_TRIED = 24
"""Takes of a subject that a reference is held against, the newest ones."""
LARGEST_OFFSET_S = 1e11


class ReferenceOfSubject(UploadedReference):
    subject: SubjectName | None = Field(None, description="Whose takes it may be of. None: it is only shown.")


class AttachedReference(UploadedReference):
    take: str = Field(pattern=ID, description="The take that it becomes the reference of.")
    offset_s: FiniteFloat | None = Field(
        None, ge=-LARGEST_OFFSET_S, le=LARGEST_OFFSET_S,
        description="Reference time less frame time. None: found by the movement.",
    )  # fmt: skip


@router.post(
    "/preview",
    response_model=ReferencePreview,
    summary="What a file of reference angles tells, and of which take it is",
    responses=change_problems(),
)
def preview_reference(body: ReferenceOfSubject, parts: PartsNeeded) -> ReferencePreview:
    """The body names a table with angles and no readings, a TRC or a BVH file. Nothing is changed. 422 names
    what cannot be read."""
    file = read_uploaded(parts, body, _hand_of_subject(parts, body.subject))
    every = list(file.rows.values())
    steps = sum(len(rows.time_s) - 1 for rows in every)
    lasts = sum(float(rows.time_s[-1] - rows.time_s[0]) for rows in every)
    rotations = [
        ReferenceRotation(
            rotation=name, made_of=list(file.made_of.get(name, (name,))), low_deg=float(np.nanmin(angles)),
            high_deg=float(np.nanmax(angles)), seen_share=float(np.isfinite(angles).mean()),
        )
        for name, angles in _angles(file.rows).items()
    ]  # fmt: skip
    takes, problem = _possible(parts, body.subject, file.rows)
    return ReferencePreview(
        title=file.title, hand=file.hand, hands=list(file.hands), rows=steps + len(every),
        rate_hz=steps / lasts if lasts > 0 else None, duration_s=lasts, rotations=rotations,
        left_out=dict(file.left_out), odd=list(file.odd), takes=takes, problem=problem,
    )  # fmt: skip


@router.post(
    "",
    response_model=Take,
    summary="Attach a file of reference angles to a take",
    responses=change_problems(409),
)
def attach_reference(body: AttachedReference, parts: PartsNeeded) -> TakeRecord:
    """As the preview showed it; the reference that was there stays on file. 422 where not a row lies within
    the take."""
    record = parts.store.takes.get(body.take)
    file = read_uploaded(parts, body, record.known_hand or _hand_of_subject(parts, record.subject))
    rows = file.rows.get(record.name) or file.rows.get(None) or next(iter(file.rows.values()))
    take = parts.store.takes.load(record.id)
    joined = (
        join_reference(take, rows).take
        if body.offset_s is None
        else with_reference(take, rows, body.offset_s)
    )
    circle = unwrapped([joined])
    [took] = circle.takes
    return parts.store.takes.attach_reference(
        record.id, took.reference_time_s, took.rotations, took.reference, rows.poses,
        reference_sd=took.reference_sd,
        facts={UNWRAPPED: list(circle.sentences)} if circle.sentences else None,
    )  # fmt: skip


def _hand_of_subject(parts: Parts, subject: str | None) -> Handedness | None:
    if subject is None:
        return None
    try:
        return parts.store.subjects.get(subject).known_hand
    except NotFound:
        return None


def _angles(references: ReferencesByTake) -> dict[str, np.ndarray]:
    """All angles of each rotation."""
    parts_of: dict[str, list[np.ndarray]] = {}
    for rows in references.values():
        for name, angles in zip(rows.rotations, rows.reference.T, strict=True):
            parts_of.setdefault(name, []).append(angles)
    return {name: np.concatenate(parts) for name, parts in parts_of.items()}


def _possible(
    parts: Parts, subject: str | None, references: ReferencesByTake
) -> tuple[list[PossibleTake], str | None]:
    if subject is None:
        return [], None
    newest = ListPart(limit=MOST_TRIED, reverse=True)
    possible_takes, refused = [], f"{subject} has no take that it could be of; import or record one first"
    for record in parts.store.takes.list(subject, part=newest):
        own = references.get(record.name) or references.get(None)
        if own is None:
            continue
        try:
            joined = join_reference(parts.store.takes.load(record.id), own)
        except BadInput as error:
            refused = str(error)
            continue
        possible = PossibleTake(
            id=record.id, name=record.name, is_matched=joined.is_matched, offset_s=joined.offset_s,
            has_reference=bool(record.rotations), sentence=joined.sentence,
        )  # fmt: skip
        possible_takes.append((not joined.is_matched, joined.unexplained, possible))
    possible_takes.sort(key=lambda each: each[:2])
    return [possible for *_, possible in possible_takes], None if possible_takes else refused
