"""Models: immutable, verified at each load, activated and rolled back in one step."""

import itertools
import random
import threading
from contextlib import suppress

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sqlalchemy import text

from glovecal_models.errors import BadInput, DamagedArtifact
from glovecal_service.store.errors import Conflict, NotFound, StoreDamaged
from glovecal_service.store.list_part import ListPart


@pytest.fixture
def anna(store):
    store.subjects.create("anna")
    return store


def add(store, content: bytes, parent=None, subject="anna", layout="cyberglove18", hand=None, **facts):
    return store.models.add(
        content, subject=subject, layout=layout, method="linear", parent=parent, facts=facts, hand=hand
    )


def test_a_model_comes_back_and_is_found_by_prefix(anna):
    record = add(anna, b"one", held_out_rmse_deg=1.25, per_rotation={"I_PIP": None})
    assert anna.models.get(record.id) == record
    assert anna.models.get(record.id[:6]) == record
    assert anna.models.load_bytes(record.id[:6]) == b"one"
    assert anna.models.list("anna", "cyberglove18") == [record]
    assert anna.models.list("anna", "lucidglove") == []
    for wrong in (record.id[:5], record.id.upper(), "f" * 64, "../" + record.id, "", "%" * 6, "______"):
        with pytest.raises(NotFound):
            anna.models.get(wrong)


def test_models_are_found_by_their_words(anna):
    monday = add(anna, b"one", name='Monday, 100 % "new"', note="daumen geklebt", effects=["creep"])
    other = add(anna, b"two", effects=["hysteresis", "creep"])
    gone = anna.models.remove(add(anna, b"three", name="Monday").id)
    for words, found in (
        ("monday", [monday]), ("DAUMEN linear", [monday]), ("100 %", [monday]), ('"new"', [monday]),
        ("creep", [monday, other]), (other.id[:9], [other]), (other.id[1:9], []), ("linear daumen x", []),
        ("", [monday, other]), ("_", []), ("\\", []), ("'", []),
    ):  # fmt: skip
        part = ListPart(limit=10, text=words)
        assert anna.models.list(part=part) == found, words
        page = anna.models.page(part)
        assert (page.records, page.total) == (found, len(found)), words
    assert anna.models.list(removed=True) == [gone]
    newest = anna.models.page(ListPart(limit=1, reverse=True))
    assert (newest.records, newest.total) == ([other], 2)
    assert anna.models.page(ListPart(limit=1, after=newest.after or "", reverse=True)).records == [monday]
    assert anna.models.page(ListPart(limit=9), removed=True).records == [gone]


def test_the_same_model_again_is_the_same_record(anna):
    record = add(anna, b"one", seconds=1)
    assert add(anna, b"one", seconds=2) == record
    anna.subjects.create("ben")
    with pytest.raises(Conflict, match="belongs to subject 'anna'"):
        add(anna, b"one", subject="ben")


def test_lineage_runs_from_child_to_first(anna):
    first = add(anna, b"one")
    second = add(anna, b"two", parent=first.id)
    third = add(anna, b"three", parent=second.id)
    assert anna.models.lineage(third.id[:12]) == [third, second, first]
    with pytest.raises(NotFound):
        add(anna, b"four", parent="0" * 64)


def test_activation_and_rollback_walk_back_one_by_one(anna):
    models = [add(anna, content) for content in (b"one", b"two", b"three")]
    assert anna.models.active("anna", "cyberglove18") is None
    for model in models:
        anna.models.activate(model.id)
        assert anna.models.active("anna", "cyberglove18") == model
    assert anna.models.rollback("anna", "cyberglove18").model == models[1].id
    assert anna.models.rollback("anna", "cyberglove18").model == models[0].id
    with pytest.raises(Conflict, match="nothing earlier"):
        anna.models.rollback("anna", "cyberglove18")
    assert anna.models.active("anna", "cyberglove18") == models[0]
    anna.models.activate(models[2].id)
    assert anna.models.rollback("anna", "cyberglove18").model == models[0].id
    kinds = [item.kind for item in anna.models.activations("anna", "cyberglove18")]
    assert kinds == ["activate"] * 3 + ["rollback"] * 2 + ["activate", "rollback"]


def test_activating_the_active_model_adds_nothing(anna):
    model = add(anna, b"one")
    assert anna.models.activate(model.id) == anna.models.activate(model.id)
    assert len(anna.models.activations("anna", "cyberglove18")) == 1


def test_layouts_of_one_subject_do_not_disturb_each_other(anna):
    one, two = add(anna, b"one"), add(anna, b"two", layout="lucidglove")
    anna.models.activate(one.id)
    anna.models.activate(two.id)
    assert anna.models.active("anna", "cyberglove18") == one
    assert anna.models.active("anna", "lucidglove") == two
    with pytest.raises(Conflict):
        anna.models.rollback("anna", "lucidglove")


def test_a_damaged_or_missing_artifact_is_not_activated(anna, store_settings):
    good, damaged, missing = add(anna, b"good"), add(anna, b"damaged"), add(anna, b"missing")
    anna.models.activate(good.id)
    (store_settings.artifacts_folder / damaged.id).write_bytes(b"changed")
    (store_settings.artifacts_folder / missing.id).unlink()
    with pytest.raises(DamagedArtifact, match=damaged.id):
        anna.models.activate(damaged.id)
    with pytest.raises(NotFound, match=missing.id):
        anna.models.activate(missing.id)
    assert anna.models.active("anna", "cyberglove18") == good


def test_a_rollback_to_a_damaged_model_keeps_the_present_one(anna, store_settings):
    first, second = add(anna, b"one"), add(anna, b"two")
    anna.models.activate(first.id)
    anna.models.activate(second.id)
    (store_settings.artifacts_folder / first.id).write_bytes(b"x")
    with pytest.raises(DamagedArtifact):
        anna.models.rollback("anna", "cyberglove18")
    assert anna.models.active("anna", "cyberglove18") == second


@pytest.mark.parametrize(
    "change",
    [
        "UPDATE models SET subject = 'ben'",
        "UPDATE models SET method = 'spgp'",
        """UPDATE models SET facts = '{"held_out_rmse_deg": 0.1}'""",
        "UPDATE activations SET model = (SELECT max(id) FROM models)",
        "UPDATE activations SET subject = 'ben'",
        "UPDATE activations SET previous = 1",
    ],
)
def test_a_changed_row_is_found(anna, change):
    anna.subjects.create("ben")
    ids = sorted(add(anna, content, held_out_rmse_deg=3.0).id for content in (b"one", b"two"))
    anna.models.activate(ids[0])
    with anna.database.write() as connection:
        connection.execute(text(change))
    subject = "ben" if "activations SET subject" in change else "anna"
    with pytest.raises(StoreDamaged, match="changed after it was written"):
        anna.models.active(subject, "cyberglove18")


def test_what_changed_is_told_to_who_follows(anna):
    def told(action) -> set[tuple[str, str]]:
        before = anna.changes_since(None).revision
        action()
        changes = anna.changes_since(before)
        assert not changes.everything
        assert not anna.changes_since(changes.revision).changed
        return set(changes.changed)

    one, two = add(anna, b"one"), add(anna, b"two")
    assert told(lambda: anna.models.activate(one.id)) == {("subject", "anna")}
    assert told(lambda: anna.models.activate(two.id)) == {("subject", "anna")}
    assert told(lambda: anna.models.rollback("anna", "cyberglove18")) == {("subject", "anna")}
    assert told(lambda: anna.gloves.assign("left", "anna", "morning")) == {("glove", "left")}
    assert told(lambda: anna.recordings.request("left", name="first")) == {("recording", "")}
    assert told(lambda: anna.subjects.list()) == set()
    assert told(lambda: add(anna, b"three")) == set()


def test_who_starts_who_is_ahead_and_who_missed_a_forgotten_person_look_at_everything(anna):
    seen = anna.changes_since(None)
    assert seen.everything
    assert anna.changes_since(seen.revision + 7).everything, "a backup was restored"
    anna.subjects.create("ben")
    anna.subjects.measure("ben", {"hand_length": 180.0})
    assert anna.changes_since(seen.revision).names("subject") == {"ben"}
    anna.subjects.remove("ben")
    changes = anna.changes_since(seen.revision)
    assert changes.everything
    assert changes.names("subject") == set()


def test_every_activation_of_many_threads_is_kept_in_one_order(anna):
    models = [add(anna, str(number).encode()) for number in range(12)]
    threads = [threading.Thread(target=anna.models.activate, args=(model.id,)) for model in models]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    history = anna.models.activations("anna", "cyberglove18")
    assert sorted(item.model for item in history) == sorted(model.id for model in models)
    assert [item.previous for item in history] == [None] + [item.id for item in history[:-1]]
    assert anna.models.active("anna", "cyberglove18").id == history[-1].model


def test_facts_that_are_not_json_are_refused(anna):
    for fact in (float("nan"), float("inf"), object()):
        with pytest.raises(BadInput):
            add(anna, b"model", wrong=fact)
    assert anna.models.list() == []


HANDS = st.sampled_from(["left", "right", None])


def test_a_hand_is_never_read_by_a_model_of_the_other(store):
    """Whatever is activated and rolled back, in whatever order."""
    persons = itertools.count()

    @settings(max_examples=40)
    @given(st.lists(st.tuples(HANDS, st.integers(0, 5), st.booleans()), min_size=1, max_size=12))
    def holds(moves):
        who = store.subjects.create(f"person-{next(persons)}").name
        models = [
            add(store, f"{who} {number}".encode(), subject=who, hand=hand)
            for number, (hand, _, _) in enumerate(moves)
        ]
        for _, number, is_rollback in moves:
            model = models[number % len(models)]
            if not is_rollback:
                store.models.activate(model.id)
                assert store.models.is_active(model)
                continue
            with suppress(Conflict):
                hand = store.models.rollback(who, "cyberglove18", model.hand).hand
                assert model.hand is None or hand in (None, model.hand)
        active = {hand: store.models.active(who, "cyberglove18", hand) for hand in ("left", "right", None)}
        for hand, model in active.items():
            assert model is None or hand is None or model.hand in (None, hand)
        listed = {each.id for each in store.models.active_of_each_hand(who, "cyberglove18")}
        assert {model.id for model in active.values() if model is not None} == listed

    holds()


@pytest.mark.parametrize("seed", range(6))
def test_which_of_many_are_active_is_told_as_of_each(anna, seed):
    """Whichever is activated in whichever order: of one hand, of the other, of takes that do not say."""
    choose = random.Random(seed)
    anna.subjects.create("ben")
    models = [
        anna.models.add(
            b"%d" % number, subject=choose.choice(["anna", "ben"]), layout=choose.choice(["one", "two"]),
            method="linear", parent=None, facts={}, hand=choose.choice(["left", "right", None]),
        )
        for number in range(12)
    ]  # fmt: skip
    for _ in range(10):
        anna.models.activate(choose.choice(models).id)
        pairs = {(each.subject, each.layout) for each in models}
        active = {each.id for pair in pairs for each in anna.models.active_of_each_hand(*pair)}
        assert anna.models.active_among(models) == (active, [])
        assert anna.models.count_active() == len(active)
        own = {each.id for each in models if each.subject == "ben"}
        assert anna.models.count_active("ben") == len(own & active)
