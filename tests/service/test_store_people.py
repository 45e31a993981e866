"""Subjects, layouts, gloves and who wears them."""

from datetime import UTC, datetime

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from stored_takes import LAYOUT, make_take

from glovecal_models.errors import BadInput
from glovecal_models.layout import BUILT_IN, Layout
from glovecal_models.names import IDENTIFIER
from glovecal_service.store.errors import Conflict, NotFound

META = {"layout": "cyberglove18", "subject": "anna", "wearing": "first", "hand": "left", "run_id": "0a"}


def test_subjects_are_created_listed_and_removed(store):
    anna = store.subjects.create("anna", title="Anna Müller 手", dimensions={"hand_length": 182}, hand="left")
    ben = store.subjects.create("ben")
    assert store.subjects.list() == [anna, ben]
    assert store.subjects.get("anna") == anna
    assert (anna.dimensions, anna.hand, ben.hand) == ({"hand_length": 182.0}, "left", "unknown")
    with pytest.raises(Conflict, match="already a subject 'anna'"):
        store.subjects.create("anna")
    store.subjects.remove("ben")
    with pytest.raises(NotFound, match="'ben'"):
        store.subjects.get("ben")
    with pytest.raises(NotFound, match="'ben'"):
        store.subjects.remove("ben")


def test_a_subject_with_takes_or_models_stays(store):
    store.subjects.create("anna")
    take = store.takes.add(make_take(1), subject="anna", layout=LAYOUT.name, source="import")
    with pytest.raises(Conflict, match="1 takes"):
        store.subjects.remove("anna")
    store.takes.remove(take.id)
    store.models.add(b"m", subject="anna", layout="a", method="linear", parent=None, facts={})
    with pytest.raises(Conflict, match="1 models"):
        store.subjects.remove("anna")


@pytest.mark.parametrize("dimension", [0, -1, float("nan"), float("inf"), "7", None, True])
def test_wrong_dimensions_are_refused(sqlite_store, dimension):
    with pytest.raises(BadInput, match="T_distal"):
        sqlite_store.subjects.create("anna", dimensions={"hand_length": 180, "T_distal": dimension})
    with pytest.raises(BadInput, match=r"subject 'anna': a hand has no dimension '\.\./x'"):
        sqlite_store.subjects.create("anna", dimensions={"../x": 1})
    assert sqlite_store.subjects.list() == []


def test_a_hand_is_measured_again(store):
    anna = store.subjects.create("anna", dimensions={"hand_length": 182, "hand_breadth": 80})
    again = store.subjects.measure("anna", {"hand_length": 176.5}, "left")
    assert again == store.subjects.get("anna")
    assert (again.dimensions, again.hand) == ({"hand_length": 176.5}, "left")
    assert again.created_at == anna.created_at
    with pytest.raises(BadInput, match="'both'; give right or left"):
        store.subjects.measure("anna", {}, "both")
    with pytest.raises(NotFound, match="'ben'"):
        store.subjects.measure("ben", {}, "left")
    assert store.subjects.get("anna") == again


hostile = st.sampled_from(
    ["..", "a/b", "a\0", "a%2e%2e", "a\r\n", "é", "ａ", "con\ud800", "-a", "_a", " a", "a" * 65]
)


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(name=hostile | st.text(max_size=70) | st.from_regex(IDENTIFIER))
def test_a_name_is_kept_as_it_is_or_refused(sqlite_store, name):
    if IDENTIFIER.match(name):
        if name not in [record.name for record in sqlite_store.subjects.list()]:
            assert sqlite_store.subjects.create(name).name == name
        assert sqlite_store.gloves.seen(name, {}).name == name
        assert sqlite_store.subjects.get(name).name == name
        return
    for call in (
        lambda: sqlite_store.subjects.create(name),
        lambda: sqlite_store.gloves.seen(name, META),
        lambda: sqlite_store.gloves.assign(name, None),
        lambda: sqlite_store.recordings.request(name, name="x"),
        lambda: sqlite_store.jobs.create(name, {}),
    ):
        with pytest.raises(BadInput):
            call()
    with pytest.raises((NotFound, BadInput)):
        sqlite_store.subjects.get(name)


def test_layouts_are_built_in_or_stored(store):
    assert [record.name for record in store.layouts.list()] == list(BUILT_IN)
    assert store.layouts.get("cyberglove18") == Layout.built_in("cyberglove18")
    stored = store.layouts.put(LAYOUT)
    assert store.layouts.put(LAYOUT).created_at == stored.created_at
    assert store.layouts.get(LAYOUT.name) == LAYOUT
    assert store.layouts.list()[-1] == stored
    with pytest.raises(NotFound, match="'knitted'"):
        store.layouts.get("knitted")


def changed(name: str) -> Layout:
    return Layout.from_columns(name, ["A", "B"], ["A"])


def test_a_layout_in_use_is_not_changed(store):
    store.layouts.put(changed(LAYOUT.name))
    store.layouts.put(LAYOUT)
    store.subjects.create("anna")
    store.takes.add(make_take(1), subject="anna", layout=LAYOUT.name, source="import")
    with pytest.raises(Conflict, match="use layout 'two-fingers'"):
        store.layouts.put(changed(LAYOUT.name))
    assert store.layouts.get(LAYOUT.name) == LAYOUT
    with pytest.raises(Conflict, match="built in"):
        store.layouts.put(changed("lucidglove"))
    assert store.layouts.put(Layout.built_in("lucidglove")).built_in
    for name in ("Upper", "../x", ""):
        with pytest.raises(BadInput):
            store.layouts.put(changed(name))


def test_a_glove_is_worn_by_whoever_was_named_last(store):
    store.subjects.create("ben")
    glove = store.gloves.seen("left", META)
    assert (glove.subject, glove.wearing, glove.hand) == ("anna", "first", "left")
    assert store.gloves.assign("left", "ben", "second").subject == "ben"
    again = store.gloves.seen("left", META)
    assert (again.subject, again.wearing) == ("ben", "second"), "the same run: the user's word is later"
    silent = store.gloves.seen("left", {**META, "run_id": "0b", "subject": None, "wearing": "third"})
    assert (silent.subject, silent.wearing) == ("ben", "second")
    later = store.gloves.seen("left", {**META, "run_id": "0c", "subject": "Anna"})
    assert (later.subject, later.wearing) == ("anna", "first"), "a new run names its subject: that is later"
    assert store.gloves.assign("left", None).subject is None
    assert store.gloves.list() == [store.gloves.get("left")]


def test_a_wearer_can_be_chosen_before_the_glove_appears(store):
    store.subjects.create("ben")
    assert store.gloves.assign("right", "ben").layout is None
    seen = store.gloves.seen("right", {**META, "subject": None})
    assert (seen.subject, seen.layout, seen.wearing) == ("ben", "cyberglove18", "first")
    with pytest.raises(NotFound, match="'nobody'"):
        store.gloves.assign("right", "nobody")
    store.subjects.remove("ben")
    assert store.gloves.get("right").subject is None


@pytest.mark.parametrize(
    "meta", [{"layout": "../x"}, {"subject": 3}, {"hand": ["left"]}, {"wearing": "a\0b"}, {"run_id": 7}]
)
def test_a_meta_that_cannot_be_one_is_refused(sqlite_store, meta):
    with pytest.raises(BadInput):
        sqlite_store.gloves.seen("left", {**META, **meta})
    assert sqlite_store.gloves.list() == []


def test_seeing_a_glove_again_disturbs_nobody(store):
    store.gloves.seen("left", META)
    before = store.changes_since(None).revision
    store.gloves.seen("left", META)
    assert not store.changes_since(before).are_of("glove")
    store.gloves.seen("left", {**META, "subject": "ben", "run_id": "0b"})
    assert store.changes_since(before).names("glove") == {"left"}


def test_a_recording_moves_forward_only(store):
    with pytest.raises(NotFound, match="'left'"):
        store.recordings.request("left", name="walk")
    store.gloves.seen("left", META)
    recording = store.recordings.request("left", name="walk", wearing="second")
    assert (recording.state, recording.subject, recording.wearing) == ("requested", "anna", "second")
    with pytest.raises(Conflict, match="being recorded already"):
        store.recordings.request("left", name="run")
    assert store.recordings.update(recording.id, state="recording", first_sequence=7).state == "recording"
    assert store.recordings.stop(recording.id).state == "stopping"
    assert store.recordings.update(recording.id, state="recording").state == "stopping"
    facts = {"last_sequence": 99, "sent": 93, "recorded": 90, "missing": [[50, 52]]}
    repairing = store.recordings.update(recording.id, state="repairing")
    assert not repairing.is_open
    assert store.recordings.unsettled() == [repairing]
    done = store.recordings.update(recording.id, state="done", **facts)
    recording_facts = dict(done.facts)
    asked_s = recording_facts.pop("stop_asked_s")
    assert done.ended_at == datetime.fromtimestamp(asked_s, UTC)
    assert recording_facts == {"pre_roll": {"asked_s": 60.0}, "first_sequence": 7, **facts}
    with pytest.raises(Conflict, match="is over; say it of its take"):
        store.recordings.note_time_code(recording.id, {"time_code": "10:00:00:00"})
    assert store.recordings.stop(recording.id).state == "done"
    assert store.recordings.update(recording.id, state="failed").state == "done"
    second = store.recordings.request("left", name="run")
    assert store.recordings.list(only_open=True) == [second]
    assert [item.id for item in store.recordings.list("left")] == [second.id, recording.id]
    with pytest.raises(BadInput, match="no state"):
        store.recordings.update(second.id, state="sleeping")
