"""A store with a row or two in each protected table."""

from __future__ import annotations

from contextlib import suppress

from stored_takes import LAYOUT, make_take

from glovecal_service.store import Store
from glovecal_service.store.errors import Conflict

META = {"layout": LAYOUT.name, "run_id": "run", "hand": "right", "sensors": list(LAYOUT.sensors)}
PROTECTED = ("takes", "model_takes", "recordings", "samplings", "jobs", "models", "activations")


def fill(store: Store) -> None:
    store.subjects.create("anna")
    store.subjects.create("ben")
    store.layouts.put(LAYOUT)
    takes = [
        store.takes.add(
            make_take(number, f"t{number}"), subject="anna", layout=LAYOUT.name, source="import",
            original_sha256="0" * 64, accounting={"sent": 300 + number}, recording=f"r{number}",
        )
        for number in range(2)
    ]  # fmt: skip
    facts = {"takes": [take.id for take in takes], "held_out_rmse_deg": 2.5}
    for content in (b"one", b"two"):
        model = store.models.add(
            content, subject="anna", layout=LAYOUT.name, method="linear", parent=None, facts=facts
        )
        store.models.activate(model.id)
    store.gloves.seen("left", META)
    recording = store.recordings.request("left", name="walk", subject="anna", wearing="w")
    store.recordings.update(recording.id, state="done", sent=300, missing=0, take=takes[0].id)
    store.recordings.request("left", name="walk 2", subject="anna", wearing="w")
    sampling = store.samplings.create(
        glove="left", subject="anna", wearing="w", layout=LAYOUT.name, document={"step": 3, "at_s": 0.5}
    )
    store.samplings.note(sampling.id, recordings=[recording.id], takes=[takes[1].id], problem="none")
    store.jobs.create("train", {"takes": facts["takes"], "samples": 2000}, subject="anna")
    claimed = store.jobs.claim("worker")
    assert claimed is not None
    store.jobs.finish(claimed.id, claimed.attempt, {"rmse_deg": 1.25, "floors": {"repeat": 0.5}})
    failing = store.jobs.create("knit", {}, subject="anna")
    store.jobs.claim("worker")
    store.jobs.fail(failing.id, 1, "no job of kind 'knit'")
    store.jobs.create("train", {"takes": []}, subject="anna")


def read_all(store: Store) -> list[object]:
    """Every row of the protected tables, as the store reads them; a take that a model knows stays."""
    for take in store.takes.list():
        with suppress(Conflict):
            store.takes.remove(take.id)
    return [
        store.takes.list(), store.models.list(), store.models.activations("anna", LAYOUT.name),
        store.models.active("anna", LAYOUT.name), store.recordings.list(), store.samplings.list(),
        store.jobs.list(),
    ]  # fmt: skip
