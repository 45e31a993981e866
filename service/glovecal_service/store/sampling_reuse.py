"""Takes of one person's sampling for another person (Wang & Neff 2013, section 8.2): rough, and FK only."""

from __future__ import annotations

from typing import TYPE_CHECKING

from glovecal_models.errors import BadInput
from glovecal_models.sampling.sampled_takes import for_other_subject
from glovecal_service.store.errors import Conflict
from glovecal_service.store.records import SamplingRecord

if TYPE_CHECKING:
    from glovecal_service.store.store import Store


def reuse_takes(store: Store, record: SamplingRecord, subject: str) -> tuple[list[str], list[str]]:
    """Ids of the new takes of ``subject``, and a sentence for each that cannot be used.

    Raises NotFound (subject), Conflict for a sampling without takes, the same person, or done before.
    """
    store.subjects.get(subject)
    if subject == record.subject:
        raise Conflict(f"sampling {record.id} is {subject}'s own")
    if not record.takes:
        raise Conflict(f"sampling {record.id} has no takes yet")
    kept, left_out = [], []
    for id in record.takes:
        accounting = store.takes.get(id).accounting or {}
        try:
            take, document = for_other_subject(
                store.takes.load_recorded(id), accounting["sampling"], record.subject
            )
        except BadInput as error:
            left_out.append(str(error))
            continue
        told = {**accounting, "sampling": document}
        added = store.takes.add(
            take, subject=subject, layout=record.layout, source="sampling", accounting=told
        )
        kept.append(added.id)
    return kept, left_out
