"""What a finished sampling leaves behind: takes with known angles, cut out of its recordings."""

from __future__ import annotations

from glovecal_models.sampling.sampled_takes import SampledTake, sampled_takes
from glovecal_models.sampling.state import SamplingState
from glovecal_models.takes.take import Take
from glovecal_service.store.records import SamplingRecord, TakeRecord
from glovecal_service.store.store import Store

SOURCE = "sampling"


def keep_sampled_takes(store: Store, record: SamplingRecord) -> tuple[list[str], str]:
    """Ids of the takes, stored once each, and a sentence on what is not in them ("" if nothing is missing).

    Raises what the store raises; done again after that, it goes on where it was.
    """
    state = SamplingState.from_document(record.document)
    recordings = {id: store.recordings.get(id) for id in record.recordings}
    wholes = {
        id: store.takes.get(recording.facts["take"])
        for id, recording in recordings.items()
        if "take" in recording.facts
    }
    recorded: dict[str, Take] = {id: store.takes.load(whole.id) for id, whole in wholes.items()}
    found = [take for take in sampled_takes(state, recorded, name=record.id) if take.kind != "range"]
    before = {take.name: take.id for take in store.takes.list(record.subject) if _is_of(take, record.id)}
    kept = []
    for each in found:
        name = each.take.name
        kept.append(before.get(name) or _keep(store, record, each, wholes[each.recording]))
    return kept, _what_is_missing(state, found)


def _is_of(take: TakeRecord, sampling: str) -> bool:
    return ((take.accounting or {}).get(SOURCE) or {}).get("id") == sampling


def _keep(store: Store, record: SamplingRecord, each: SampledTake, whole: TakeRecord) -> str:
    clock = {"wall_minus_time_s": (whole.accounting or {}).get("wall_minus_time_s", 0.0)}
    told = {"id": record.id, "recording": each.recording, **each.to_document()}
    accounting = {**clock, "begins_s": each.begins_s, SOURCE: told}
    kept = store.takes.add(
        each.take, subject=record.subject, layout=record.layout, source=SOURCE, accounting=accounting
    )
    return kept.id


def _what_is_missing(state: SamplingState, found: list[SampledTake]) -> str:
    there = {step.name for each in found for step in each.steps}
    lost = [
        name
        for name, attempt in state.finished().items()
        if attempt.outcome == "good" and name not in there and state.protocol.step(name).kind != "range"
    ]
    return f"{', '.join(lost)}: recorded, but the frames are not in the recording." if lost else ""
