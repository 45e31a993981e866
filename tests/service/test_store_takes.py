"""Takes in the store: what goes in comes out bit for bit, and only once."""

import dataclasses

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from stored_takes import LAYOUT, make_take

from glovecal_models.errors import BadInput, DamagedArtifact
from glovecal_models.takes.take import Take
from glovecal_service.store.errors import Conflict, NotFound
from glovecal_service.store.take_file import dump_take, load_take
from glovecal_service.store.takes import CAMERA_REFERENCE


def same(one: Take, other: Take) -> bool:
    for field in dataclasses.fields(Take):
        a, b = getattr(one, field.name), getattr(other, field.name)
        if field.name == "context":
            if set(a) != set(b) or not all(np.array_equal(a[n], b[n], equal_nan=True) for n in a):
                return False
        elif isinstance(a, np.ndarray):
            if a.shape != b.shape or not np.array_equal(a, b, equal_nan=True):
                return False
        elif a != b:
            return False
    return True


@pytest.fixture
def anna(store):
    store.subjects.create("anna")
    store.layouts.put(LAYOUT)
    return store


def add(store, take, **given):
    return store.takes.add(take, **{"subject": "anna", "layout": LAYOUT.name, "source": "import", **given})


@pytest.mark.parametrize("begins_s", [None, 1.0 / 3.0])
def test_a_take_comes_back_bit_for_bit(anna, begins_s):
    take = dataclasses.replace(make_take(1), begins_s=begins_s)
    record = add(anna, take, accounting={"sent": 300, "recorded": 300, "missing": []})
    assert same(anna.takes.load(record.id), take)
    assert anna.takes.get(record.id) == record
    assert anna.takes.list("anna", LAYOUT.name) == [record]
    assert record.rotations == ("I_MCP", "I_PIP", "IM_ABD")
    assert record.has_reference
    assert record.accounting == {"sent": 300, "recorded": 300, "missing": []}
    assert (record.frames, record.duration_s) == (300, pytest.approx(299 / 60))


def test_stated_deviations_come_back_and_older_takes_read_as_they_did(anna):
    plain = make_take(1)
    stated = dataclasses.replace(plain, reference_sd=np.full(plain.reference.shape, 1.5))
    assert same(load_take(dump_take(stated)), stated)
    assert b"reference_sd" not in dump_take(plain)  # the bytes, and so the name, of what was stored before
    assert load_take(dump_take(plain)).reference_sd is None
    record = add(anna, plain)
    attached = anna.takes.attach_reference(
        record.id, plain.reference_time_s, plain.rotations, plain.reference,
        reference_sd=stated.reference_sd, facts={CAMERA_REFERENCE: {"clock_offset_s": 0.1}},
    )  # fmt: skip
    assert same(anna.takes.load(record.id), stated)
    assert attached.facts[CAMERA_REFERENCE] == {"clock_offset_s": 0.1}
    replaced = anna.takes.attach_reference(
        record.id, plain.reference_time_s, plain.rotations, plain.reference
    )
    assert anna.takes.load(record.id).reference_sd is None
    assert replaced.facts[CAMERA_REFERENCE] is None


def test_the_takes_of_a_file_are_kept_all_or_none(anna):
    """The third has the frames of the first: the first two are not kept either."""
    good = [make_take(1, "one"), make_take(2, "two")]
    file = {"subject": "anna", "layout": LAYOUT.name, "source": "import", "original_sha256": "ab" * 32}
    with pytest.raises(Conflict, match="frames of 'three'"):
        anna.takes.add_all([*good, make_take(1, "three")], **file)
    assert anna.takes.list() == []
    with pytest.raises(BadInput, match="'empty' holds no frames"):
        anna.takes.add_all([*good, make_take(3, "empty", frames=0, measured=False)], **file)
    assert anna.takes.list() == []
    kept = anna.takes.add_all(good, **file)
    assert [record.name for record in kept] == ["one", "two"]
    assert anna.takes.list() == kept
    assert anna.takes.add_all([], **file) == []


numbers = st.floats(allow_nan=False, allow_infinity=False, width=64)


@settings(max_examples=60)
@given(data=st.data(), frames=st.integers(1, 6), rows=st.integers(0, 4))
def test_any_take_survives_its_file(data, frames, rows):
    def times(count):
        return np.array(sorted(data.draw(st.sets(numbers, min_size=count, max_size=count))))

    text = st.text(st.characters(exclude_categories=("Cs",)), max_size=8)
    take = Take(
        name=data.draw(text),
        wearing=data.draw(text),
        sensors=("A", "B"),
        time_s=times(frames),
        readings=data.draw(arrays.arrays(np.float64, (frames, 2), elements=numbers)),
        rotations=("R",),
        reference_time_s=times(rows),
        reference=data.draw(arrays.arrays(np.float64, (rows, 1), elements=st.floats(width=64))),
        context={"supply_v": data.draw(arrays.arrays(np.float64, frames, elements=st.floats(width=64)))},
        poses=data.draw(st.none() | st.tuples(*[text] * frames)),
    )
    assert same(load_take(dump_take(take)), take)


def test_bytes_that_are_no_take_are_refused():
    whole = dump_take(make_take(1, frames=20))
    for broken in (b"", b"\0" * 8, whole[:-1], whole[:100], whole + b"x", b"\xff" * 64):
        with pytest.raises(DamagedArtifact):
            load_take(broken)


def test_a_take_without_reference_gets_one_later(anna):
    recorded = add(anna, make_take(2, measured=False), source="recording", recording="r1")
    assert not recorded.has_reference
    measured = make_take(2)
    attached = anna.takes.attach_reference(
        recorded.id, measured.reference_time_s, measured.rotations, measured.reference
    )
    assert attached.id == recorded.id
    assert attached.artifact != recorded.artifact
    assert attached.facts["history"][0]["artifact"] == recorded.artifact
    assert same(anna.takes.load(recorded.id), measured)
    assert anna.artifacts.exists(recorded.artifact)


def test_a_reference_of_the_wrong_shape_changes_nothing(anna):
    record = add(anna, make_take(3, measured=False))
    with pytest.raises(BadInput, match="reference"):
        anna.takes.attach_reference(record.id, np.arange(4.0), ("I_MCP",), np.zeros((3, 1)))
    assert anna.takes.get(record.id) == record


def test_a_rotation_that_is_all_missing_is_not_listed(anna):
    take = make_take(4)
    reference = take.reference.copy()
    reference[:, 1] = np.nan
    record = add(anna, dataclasses.replace(take, reference=reference))
    assert record.rotations == ("I_MCP", "IM_ABD")


def test_the_same_frames_are_refused_under_any_name(anna):
    add(anna, make_take(5, "first"))
    with pytest.raises(Conflict, match="exactly the frames"):
        add(anna, make_take(5, "second", measured=False))
    anna.subjects.create("ben")
    add(anna, make_take(5), subject="ben")


def test_empty_takes_and_bad_names_are_refused(anna):
    nothing = Take("empty", "", ("A",), np.empty(0), np.empty((0, 1)))
    with pytest.raises(BadInput, match="no frames"):
        add(anna, nothing)
    for name in ("", "x\0y", "line\nbreak", "\ud800", "n" * 201):
        with pytest.raises(BadInput):
            add(anna, dataclasses.replace(make_take(1), name=name))
    for layout in ("../up", "UPPER", "", "a/b", "a%2e"):
        with pytest.raises(BadInput):
            add(anna, make_take(1), layout=layout)
    with pytest.raises(NotFound, match="ben"):
        add(anna, make_take(1), subject="ben")
    assert anna.takes.list() == []


def test_a_take_that_trained_a_model_stays(anna):
    trained, other = add(anna, make_take(6)), add(anna, make_take(7))
    anna.models.add(
        b"model",
        subject="anna",
        layout=LAYOUT.name,
        method="linear",
        parent=None,
        facts={"takes": [{"id": trained.id}]},
    )
    with pytest.raises(Conflict, match="trained on take"):
        anna.takes.remove(trained.id)
    anna.takes.remove(other.id)
    with pytest.raises(NotFound):
        anna.takes.get(other.id)
    assert [record.id for record in anna.takes.list()] == [trained.id]


@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(id=st.text(max_size=70))
def test_no_text_is_an_id_by_accident(sqlite_store, id):
    for get in (sqlite_store.takes.get, sqlite_store.jobs.get, sqlite_store.recordings.get):
        with pytest.raises((NotFound, BadInput)):
            get(id)
    with pytest.raises((NotFound, BadInput)):
        sqlite_store.models.get(id)


def test_a_stretch_that_was_left_out_stays_where_it_was_when_earlier_frames_come_later(anna):
    whole = make_take(1)
    record = add(anna, whole.some(whole.time_s >= 1.0, whole.reference_time_s >= 1.0))
    anna.takes.leave_out(record.id, (0.5, 1.5))
    before = anna.takes.load(record.id)
    repaired = anna.takes.repair(record.id, whole, {"complete": True})
    assert repaired.left_out == ((1.5, 2.5),)
    after = anna.takes.load(record.id)
    assert np.array_equal(after.time_s[after.time_s >= 1.0], before.time_s)
    assert anna.takes.use_again(record.id).left_out == ()
    assert np.array_equal(anna.takes.load(record.id).time_s, whole.time_s)


def test_a_stretch_without_which_nothing_was_measured_is_not_left_out(anna):
    take = make_take(2)
    reference = take.reference.copy()
    reference[take.time_s > 1.0] = np.nan
    record = add(anna, dataclasses.replace(take, reference=reference))
    with pytest.raises(BadInput, match="no measured angle of take 'bending' would be left"):
        anna.takes.leave_out(record.id, (0.0, 1.0))
    assert anna.takes.leave_out(record.id, (0.5, 1.0)).left_out == ((0.5, 1.0),)
