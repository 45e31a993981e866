"""Artifacts: every changed byte is noticed, every write is whole or absent."""

import hashlib
import os
import socket

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glovecal_models.errors import BadInput, DamagedArtifact
from glovecal_service.store import object_blobs
from glovecal_service.store.blobs import ABANDONED_AFTER_S, TEMPORARY, Artifacts, FolderBlobs
from glovecal_service.store.errors import NotFound, StoreUnavailable
from glovecal_service.store.object_blobs import ObjectBlobs


@pytest.fixture(params=["folder", "object store"])
def artifacts(request, tmp_path):
    """The folder we write ourselves, and the same through obstore (its own folder store and URL)."""
    if request.param == "folder":
        return Artifacts(FolderBlobs(tmp_path))
    return Artifacts(ObjectBlobs(tmp_path.as_uri(), tmp_path / "cache"))


def test_what_is_read_is_what_was_written(artifacts):
    for content in (b"", b"x", os.urandom(100_000)):
        name = artifacts.put(content)
        assert name == hashlib.sha256(content).hexdigest()
        assert artifacts.exists(name)
        assert artifacts.get(name) == content
        assert artifacts.put(content) == name


def test_a_missing_artifact_is_named(artifacts):
    assert not artifacts.exists("0" * 64)
    with pytest.raises(NotFound, match="0" * 64):
        artifacts.get("0" * 64)


def test_every_flipped_bit_and_every_truncation_is_refused_by_name(tmp_path):
    artifacts = Artifacts(FolderBlobs(tmp_path))
    content = bytes(range(256)) + b"a small model"
    name = artifacts.put(content)
    path = tmp_path / name
    broken = [content[:length] for length in range(len(content))] + [content + b"\0"]
    for place in range(len(content)):
        for bit in range(8):
            changed = bytearray(content)
            changed[place] ^= 1 << bit
            broken.append(bytes(changed))
    for wrong in broken:
        path.write_bytes(wrong)
        with pytest.raises(DamagedArtifact, match=name):
            artifacts.get(name)
    assert artifacts.put(content) == name
    assert artifacts.get(name) == content


@settings(max_examples=200)
@given(name=st.text(max_size=80) | st.sampled_from(["../" + "0" * 61, "0" * 63 + "\n", "A" * 64, "0" * 65]))
def test_no_other_name_reaches_a_path(name):
    class Untouched:
        place = "nowhere"

        def read(self, name: str) -> bytes | None:
            pytest.fail(f"a path was made of {name!r}")

        def exists(self, name: str) -> bool:
            pytest.fail(f"a path was made of {name!r}")

        def remove(self, name: str) -> None:
            pytest.fail(f"a path was made of {name!r}")

        def stamp(self, name: str) -> None:
            pytest.fail(f"a path was made of {name!r}")

        def write(self, name: str, content: bytes) -> None:
            pytest.fail(f"a path was made of {name!r}")

    artifacts = Artifacts(Untouched())
    for call in (artifacts.get, artifacts.exists, artifacts.verify, artifacts.remove):
        with pytest.raises(BadInput):
            call(name)


def test_what_was_verified_is_read_again_only_when_it_changed(tmp_path):
    class Counting(FolderBlobs):
        reads = 0

        def read(self, name: str) -> bytes | None:
            self.reads += 1
            return super().read(name)

    blobs = Counting(tmp_path)
    artifacts = Artifacts(blobs)
    name = artifacts.put(b"some model")
    blobs.reads = 0
    for _ in range(5):
        artifacts.verify(name)
    assert blobs.reads == 1
    (tmp_path / name).write_bytes(b"SOME model")
    for _ in range(2):
        with pytest.raises(DamagedArtifact, match=name):
            artifacts.verify(name)
    (tmp_path / name).unlink()
    with pytest.raises(NotFound, match=name):
        artifacts.verify(name)
    artifacts.put(b"some model")
    artifacts.verify(name)


def test_nothing_but_whole_artifacts_is_left_in_the_folder(tmp_path):
    artifacts = Artifacts(FolderBlobs(tmp_path))
    name = artifacts.put(b"whole")
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_leftovers_of_killed_writers_are_swept(tmp_path):
    old, fresh = tmp_path / f"{TEMPORARY}old", tmp_path / f"{TEMPORARY}fresh"
    for path in (old, fresh):
        path.write_bytes(b"half")
    long_ago = os.stat(old).st_mtime - ABANDONED_AFTER_S - 10
    os.utime(old, (long_ago, long_ago))
    FolderBlobs(tmp_path)
    assert not old.exists()
    assert fresh.exists(), "another process may be writing it"


def test_an_unusable_object_store_is_named(tmp_path):
    with pytest.raises(BadInput, match="GLOVECAL_ARTIFACTS"):
        ObjectBlobs("gopher://nowhere", tmp_path)


def test_an_object_store_that_hangs_is_told_and_what_was_read_before_is_read_again(tmp_path, monkeypatch):
    """Something that accepts and never answers stands for it."""
    (tmp_path / "objects").mkdir()
    before = Artifacts(ObjectBlobs((tmp_path / "objects").as_uri(), tmp_path / "cache"))
    name = before.put(b"a model")
    with socket.create_server(("127.0.0.1", 0)) as hanging:
        for variable, value in (
            ("AWS_ENDPOINT_URL", f"http://127.0.0.1:{hanging.getsockname()[1]}"),
            ("AWS_ALLOW_HTTP", "true"), ("AWS_ACCESS_KEY_ID", "a"), ("AWS_SECRET_ACCESS_KEY", "b"),
            ("AWS_REGION", "here"),
        ):  # fmt: skip
            monkeypatch.setenv(variable, value)
        artifacts = Artifacts(ObjectBlobs("s3://bucket", tmp_path / "cache"))
        assert artifacts.get(name) == b"a model"
        for act in (
            lambda: artifacts.get("0" * 64), lambda: artifacts.put(b"another"),
            lambda: artifacts.exists(name), lambda: artifacts.verify(name),
        ):  # fmt: skip
            with pytest.raises(StoreUnavailable, match="the object store s3://bucket does not answer"):
                act()


def test_the_oldest_make_room_in_the_cache(tmp_path, monkeypatch):
    monkeypatch.setattr(object_blobs, "CACHE_BYTES", 250_000)
    (tmp_path / "objects").mkdir()
    artifacts = Artifacts(ObjectBlobs((tmp_path / "objects").as_uri(), tmp_path / "cache"))
    names = [artifacts.put(os.urandom(100_000)) for _ in range(4)]
    for age, name in enumerate(names):
        assert artifacts.get(name), age
    assert {path.name for path in (tmp_path / "cache").iterdir()} == set(names[2:])
    artifacts.remove(names[3])
    assert {path.name for path in (tmp_path / "cache").iterdir()} == {names[2]}
