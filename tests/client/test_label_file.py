"""Label images come back bit by bit; of a file that was cut or damaged anywhere what lies before is read."""

from __future__ import annotations

import json
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from glovecal_client.errors import DeviceError, DeviceFinished, DeviceLost
from glovecal_client.pictures import label_file
from glovecal_client.pictures.label_file import LabelFilePictures, LabelWriter

SIZE = (24, 32)


def written(path: Path, count: int = 6) -> list[np.ndarray]:
    random = np.random.default_rng(3)
    images = [random.integers(0, 11, SIZE, np.uint8) for _ in range(count)]
    writer = LabelWriter(path, SIZE, {"source": "rendered", "simulated": True})
    for at, image in enumerate(images):
        writer.write(image, 10**9 * at, 10**18 + at)
    writer.close()
    return images


def read_all(path: Path) -> tuple[list[np.ndarray], str]:
    source, found = LabelFilePictures(path), []
    source.open()
    try:
        while True:
            found.append(source.read().pixels)
    except DeviceFinished as ended:
        return found, str(ended)
    finally:
        source.close()


def test_every_label_and_stamp_comes_back(tmp_path: Path) -> None:
    images = written(tmp_path / "a.labels")
    source = LabelFilePictures(tmp_path / "a.labels")
    source.open()
    assert source.simulated
    for at, image in enumerate(images):
        found = source.read()
        np.testing.assert_array_equal(found.pixels, image)
        assert (found.monotonic_ns, found.wall_ns) == (10**9 * at, 10**18 + at)
    with pytest.raises(DeviceFinished, match="is over after 6 pictures"):
        source.read()
    source.close()


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_whatever_is_cut_or_flipped_what_lies_before_is_read(tmp_path: Path, data: st.DataObject) -> None:
    whole, hurt = tmp_path / "whole.labels", tmp_path / "hurt.labels"
    whole.unlink(missing_ok=True)
    images = written(whole)
    content = bytearray(whole.read_bytes())
    at = data.draw(st.integers(0, len(content) - 1))
    if data.draw(st.booleans()):
        del content[at:]
    else:
        content[at] ^= data.draw(st.integers(1, 255))
    hurt.write_bytes(content)
    try:
        found, _ = read_all(hurt)
    except DeviceLost:
        assert at < 200, "only a damaged header makes the whole file unreadable"
        return
    assert len(found) < len(images) or at == len(content)
    for one, image in zip(found, images, strict=False):
        np.testing.assert_array_equal(one, image)


def test_a_file_that_was_cut_says_so(tmp_path: Path) -> None:
    written(tmp_path / "a.labels")
    content = (tmp_path / "a.labels").read_bytes()
    (tmp_path / "cut.labels").write_bytes(content[:-10])
    found, said = read_all(tmp_path / "cut.labels")
    assert len(found) == 5
    assert "ends in the middle of a picture after 5 pictures" in said


def test_a_record_that_would_unpack_to_more_is_not_unpacked(tmp_path: Path) -> None:
    writer = LabelWriter(tmp_path / "bomb.labels", SIZE, {})
    payload = label_file._STAMPS.pack(1, 1) + zlib.compress(bytes(100_000_000), 9)
    writer._append(label_file._PAIR.pack(len(payload), zlib.crc32(payload)) + payload)
    writer.close()
    assert read_all(tmp_path / "bomb.labels") == (
        [],
        f"labels:{tmp_path / 'bomb.labels'} is damaged after 0 pictures",
    )


@pytest.mark.parametrize("size", [(0, 5), (-1, 5), (1 << 20, 1 << 20), ("a", 5), (True, 5)])
def test_sizes_that_no_picture_has_are_refused(tmp_path: Path, size: tuple) -> None:
    text = json.dumps({"height": size[0], "width": size[1]}).encode()
    head = label_file.MAGIC + label_file._PAIR.pack(len(text), zlib.crc32(text)) + text
    (tmp_path / "x.labels").write_bytes(head)
    with pytest.raises(DeviceLost, match="pictures of"):
        LabelFilePictures(tmp_path / "x.labels").open()


def test_nothing_is_overwritten_and_sizes_must_fit(tmp_path: Path) -> None:
    written(tmp_path / "a.labels")
    with pytest.raises(DeviceError, match="exists already"):
        LabelWriter(tmp_path / "a.labels", SIZE, {})
    with pytest.raises(DeviceError, match="must end in"):
        LabelWriter(tmp_path / "a.mkv", SIZE, {})
    writer = LabelWriter(tmp_path / "b.labels", SIZE, {})
    with pytest.raises(DeviceError, match="do not fit"):
        writer.write(np.zeros((5, 5), np.uint8), 0, 0)
    writer.close()
    (tmp_path / "no.labels").write_bytes(b"something else")
    with pytest.raises(DeviceLost, match="holds no label images"):
        LabelFilePictures(tmp_path / "no.labels").open()
