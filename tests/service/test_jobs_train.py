"""Training as a job: the same model as in one process, its error, its sentences, its refusals."""

import dataclasses

import numpy as np
import pytest
from jobs_waiting import error_of, result_of, wait_for_job
from stored_takes import LAYOUT, make_take

from glovecal_models.calibration.artifact import dump, load, model_id
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.worker_processes import pin_blas_to_one_thread
from glovecal_service.questions.train import TRAIN

QUICK = {"samples": 120, "folds": 2}


@pytest.fixture(scope="module")
def trained(dispatched):
    """A store with a subject of three takes; its jobs are run."""
    store, _ = dispatched
    store.subjects.create("anna")
    store.subjects.create("ben")
    store.layouts.put(LAYOUT)
    for seed in range(3):
        store.takes.add(make_take(seed), subject="anna", layout=LAYOUT.name, source="import")
    store.takes.add(make_take(9, measured=False), subject="anna", layout=LAYOUT.name, source="recording")
    return store


def create(store, **payload):
    return store.jobs.create("train", {"subject": "anna", "layout": LAYOUT.name, **QUICK, **payload}).id


@pytest.mark.parametrize("method", ["linear", "lmc_gpr"])
def test_workers_train_the_model_that_one_process_trains(trained, method):
    result = result_of(trained, create(trained, method=method, activate=True))
    pin_blas_to_one_thread()  # as in the workers: two threads add up in another order
    records = [take for take in trained.takes.list("anna") if take.has_reference]
    alone = train(
        [trained.takes.load(record.id) for record in records],
        LAYOUT,
        "anna",
        TrainingSettings(method=method, samples=120, folds=2),
        take_hashes=[record.artifact for record in records],
    )
    assert result["model"] == model_id(dump(alone))
    assert result["held_out_rmse_deg"] == pytest.approx(alone.error_estimate["rmse_deg"])
    assert result["per_rotation"]["I_DIP"] is None
    model = trained.models.active("anna", LAYOUT.name)
    assert (model.id, model.method) == (result["model"], method)
    assert [take["id"] for take in model.facts["takes"]] == [record.id for record in records]
    assert load(trained.models.load_bytes(model.id)).simulated


def test_a_take_that_is_being_repaired_is_used_with_a_sentence(trained):
    trained.subjects.create("dora")
    accounting = {"complete": False, "pending_frames": 38}
    take = trained.takes.add(
        make_take(7), subject="dora", layout=LAYOUT.name, source="recording", accounting=accounting
    )
    assert take.state == "repairing"
    payload = {"subject": "dora", "layout": LAYOUT.name, "takes": [take.id], "method": "linear", "folds": 0}
    result = result_of(trained, trained.jobs.create("train", payload).id)
    assert [text for text in result["sentences"] if "incomplete" in text] == [
        f"Take {take.name} is incomplete: 38 frames, and any after its last one, may still come from the "
        "capture log. What is there is used; train again once the take is complete."
    ]
    assert trained.models.get(result["model"]).facts["sentences"] == result["sentences"]


def test_training_again_gives_the_same_model_at_once(trained):
    first = result_of(trained, create(trained, method="lmc_gpr"))
    again = create(trained, method="lmc_gpr")
    assert result_of(trained, again)["model"] == first["model"]
    sentences = [event.sentence for event in trained.jobs.events(again)]
    assert "9 fits to do, 9 of them known already" in sentences


def test_progress_tells_each_rotation_and_its_error(trained):
    id = create(trained, method="linear", samples=100)
    wait_for_job(trained, id)
    fitted = [event for event in trained.jobs.events(id) if " fitted, " in event.sentence]
    assert [event.detail["rotation"] for event in fitted] == ["I_MCP", "I_PIP", "IM_ABD"]
    for event in fitted:
        assert f"{event.detail['held_out_rmse_deg']:.2f} degrees on held-out takes" in event.sentence


def test_a_job_that_is_finished_twice_has_stored_one_model(trained):
    id = create(trained, method="linear", samples=80, activate=True)
    result, models = result_of(trained, id), len(trained.models.list("anna"))
    plan = TRAIN.plan(trained, trained.jobs.get(id))
    results = [task.function(task.payload, lambda: False, lambda *said: None) for task in plan.tasks]
    assert plan.finish(results) == result
    assert len(trained.models.list("anna")) == models


def test_a_child_names_its_parent(trained):
    parent = result_of(trained, create(trained, method="linear"))["model"]
    child = result_of(trained, create(trained, method="linear", samples=90, parent=parent[:8]))["model"]
    assert [model.id for model in trained.models.lineage(child)] == [child, parent]


@pytest.mark.parametrize(
    ("payload", "sentence"),
    [
        ({"subject": "ben"}, "no take of subject 'ben' with layout 'two-fingers' has reference angles"),
        ({"subject": "carl"}, "there is no subject 'carl'"),
        ({"layout": "knitted"}, "there is no layout 'knitted'"),
        ({"subject": None}, "a job of kind train cannot have subject = None"),
        ({"takes": ["000000000000"]}, "there is no take '000000000000'"),
        ({"takes": []}, "cannot have takes = []"),
        ({"takes": "all"}, "cannot have takes = 'all'"),
        ({"method": "magic"}, "cannot have method = 'magic'"),
        ({"samples": -1}, "cannot have samples = -1"),
        ({"pseudo_inputs": "many"}, "cannot have pseudo_inputs = 'many'"),
        ({"colour": "red"}, "unknown key 'colour'"),
        ({"parent": "abcdef"}, "there is no model 'abcdef'"),
    ],
)
def test_what_cannot_be_trained_fails_with_a_sentence(trained, payload, sentence):
    assert sentence in error_of(trained, create(trained, **{"method": "linear", **payload}))


def test_takes_that_cannot_carry_a_model_are_named(trained):
    still = make_take(20)
    still = dataclasses.replace(still, reference=np.full_like(still.reference, 10.0))
    given = {"layout": LAYOUT.name, "source": "import"}
    mute = trained.takes.add(make_take(21, measured=False), subject="anna", **given).id
    stiff = trained.takes.add(still, subject="ben", **given).id
    of_ben = error_of(trained, create(trained, takes=[stiff]))
    assert of_ben == f"take {stiff} ('bending') is of subject 'ben', not 'anna'"
    never_moves = error_of(trained, create(trained, subject="ben", method="linear"))
    assert "10 degrees in all 300 samples" in never_moves
    nothing = error_of(trained, create(trained, takes=[mute], method="linear"))
    assert "no take of subject 'anna' with layout 'two-fingers' has reference angles" in nothing
    other = error_of(trained, create(trained, layout="cyberglove18", takes=[mute], method="linear"))
    assert "has layout 'two-fingers', not 'cyberglove18'" in other


def test_a_damaged_take_is_named(trained):
    take = trained.takes.add(make_take(30), subject="ben", layout=LAYOUT.name, source="import")
    path = trained.artifacts._blobs._folder / take.artifact
    content = path.read_bytes()
    path.write_bytes(content[:-1] + bytes([content[-1] ^ 1]))
    error = error_of(trained, create(trained, subject="ben", takes=[take.id]))
    assert f"artifact {take.artifact}" in error
    assert "is damaged" in error
