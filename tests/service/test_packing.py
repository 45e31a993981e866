"""Artifacts are packed where that is worth it, and are read as they were."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from safetensors.numpy import save

from glovecal_models.errors import DamagedArtifact
from glovecal_service.store.blobs import Artifacts, FolderBlobs
from glovecal_service.store.packing import MAGIC, packed, unpacked

COUNTS = np.round(120 + 60 * np.sin(np.arange(1200)[:, None] * np.linspace(0.01, 0.05, 18)))
TAKE = save({"readings": COUNTS, "time_s": np.arange(1200) / 120})


@given(st.one_of(st.binary(max_size=300), st.binary(max_size=9).map(lambda part: part * 40)))
def test_whatever_is_packed_comes_back(content: bytes) -> None:
    assert unpacked(packed(content)) == content or content.startswith(MAGIC)


def test_readings_take_a_fifth_and_weights_stay_as_they_are(tmp_path: Path) -> None:
    artifacts = Artifacts(FolderBlobs(tmp_path))
    name = artifacts.put(TAKE)
    assert name == hashlib.sha256(TAKE).hexdigest()
    assert (tmp_path / name).stat().st_size / len(COUNTS) < 40 < len(TAKE) / len(COUNTS)
    assert artifacts.get(name) == TAKE
    weights = np.random.default_rng(0).normal(size=1000).tobytes()
    assert (tmp_path / artifacts.put(weights)).read_bytes() == weights


@given(data=st.data())
def test_a_changed_byte_is_found(data: st.DataObject, tmp_path_factory: pytest.TempPathFactory) -> None:
    folder = tmp_path_factory.mktemp("kept")
    artifacts = Artifacts(FolderBlobs(folder))
    name = artifacts.put(TAKE)
    kept = (folder / name).read_bytes()
    at = data.draw(st.integers(0, len(kept) - 1))
    (folder / name).write_bytes(kept[:at] + bytes([kept[at] ^ 16]) + kept[at + 1 :])
    with pytest.raises(DamagedArtifact):
        artifacts.get(name)
    artifacts.put(TAKE)
    assert artifacts.get(name) == TAKE
