"""References of takes: in a table of their own, with a clock of their own, and attached later."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from glovecal_client.rest import Refused, RestClient
from glovecal_models.takes.take import Take
from glovecal_models.takes.write_table import write_takes
from glovecal_service.rest.in_process import in_process_client
from glovecal_service.settings import Settings
from glovecal_service.store import Store

Write = Callable[..., Path]


@pytest.fixture
def client(client: RestClient) -> RestClient:
    client.post("/subjects", {"name": "anna"})
    return client


def two_tables(tmp_path: Path) -> tuple[Path, Path]:
    time = np.arange(200) / 100
    own = np.arange(0, 2, 1 / 30) + 0.001
    take = Take(
        "walk", "first", ("A",), time, np.sin(time)[:, None] * 100, ("A",), own, np.cos(own)[:, None] * 30
    )
    frames, reference = write_takes([take], tmp_path / "walk.csv")
    return frames, reference


def test_two_tables_with_clocks_of_their_own(client: RestClient, tmp_path: Path) -> None:
    frames, reference = two_tables(tmp_path)
    answer = client.upload_takes(frames, reference=reference, subject="anna")
    [take] = answer["takes"]
    assert take["rotations"] == ["A"]
    assert take["reference_rows"] == 60
    with pytest.raises(Refused, match="clock of its own") as refused:
        client.download(f"/takes/{take['id']}/export")
    assert refused.value.status == 409
    assert client.download(f"/takes/{take['id']}/export", {"part": "frames"}) == frames.read_bytes()
    assert client.download(f"/takes/{take['id']}/export", {"part": "reference"}) == reference.read_bytes()
    with pytest.raises(Refused, match="another reference"):
        client.upload_takes(frames, subject="anna")


def test_a_reference_that_is_missing_or_wrong_imports_nothing(shared: RestClient, tmp_path: Path) -> None:
    frames, reference = two_tables(tmp_path)
    reference.write_text(reference.read_text().replace("walk", "run"))
    with pytest.raises(Refused) as refused:
        shared.upload_takes(frames, reference=reference, subject="anna")
    assert refused.value.problem["file"] == "walk.reference.csv"
    with pytest.raises(Refused, match="no upload"):
        shared.upload_takes(frames, subject="anna", reference_upload="0" * 64)
    assert shared.get("/takes") == []


def test_attach_a_reference_later(client: RestClient, tmp_path: Path) -> None:
    frames, reference = two_tables(tmp_path)
    with pytest.raises(Refused, match="name a layout"):
        client.upload_takes(frames, subject="anna")
    layout = tmp_path / "one.toml"
    layout.write_text('sensors = ["A"]\n')
    [take] = client.upload_takes(frames, subject="anna", layout=client.add_layout(layout))["takes"]
    assert (take["rotations"], take["layout"]) == ([], "one")
    changed = client.attach_reference(take["id"], reference)
    assert (changed["id"], changed["rotations"], changed["reference_rows"]) == (take["id"], ["A"], 60)
    assert changed["facts"]["history"][0]["artifact"] == take["artifact"]
    posed = tmp_path / "posed.reference.csv"
    first, *rows = reference.read_text().splitlines()
    posed.write_text("\n".join([f"pose,{first}", *(f"fist,{row}" for row in rows)]))
    client.attach_reference(take["id"], posed)
    assert b"fist" in client.download(f"/takes/{take['id']}/export", {"format": "csv", "part": "frames"})
    with pytest.raises(Refused, match="when it was recorded") as refused:
        client.attach_reference(take["id"], reference, clock="wall")
    assert refused.value.status == 409
    with pytest.raises(Refused) as refused:
        client.attach_reference("0123456789ab", reference)
    assert refused.value.status == 404
    frames.write_text("time_s,s.A\n0,1\n")
    with pytest.raises(Refused, match="belong to the frames"):
        client.attach_reference(take["id"], frames)


def test_a_reference_in_wall_clock_time_for_a_recorded_take(tmp_path: Path, settings: Settings) -> None:
    """A take as the recorder stores it: its own time is monotonic, its accounting knows the wall clock."""
    time_s = 5000 + np.arange(100) / 100
    unix = 1.76e9
    with Store.open(settings) as store:
        store.subjects.create("anna")
        take = store.takes.add(
            Take("wave", "first", ("A",), time_s, np.sin(time_s)[:, None]),
            subject="anna",
            layout="lucidglove",
            source="recording",
            accounting={"wall_minus_time_s": unix},
        )
    reference = tmp_path / "optitrack.csv"
    reference.write_text("time_s,r.A\n" + "".join(f"{unix + 5000 + n / 50!r},{n}\n" for n in range(50)))
    with in_process_client(settings) as client:
        assert client.attach_reference(take.id, reference, clock="wall")["reference_rows"] == 50
    with Store.open(settings) as store:
        loaded = store.takes.load(take.id)
    np.testing.assert_allclose(loaded.reference_time_s, 5000 + np.arange(50) / 50, atol=1e-6)
    assert np.isfinite(loaded.reference_at_frames(["A"])).sum() > 90


def test_a_reference_that_never_moves_is_said(client: RestClient, tmp_path: Path) -> None:
    file = tmp_path / "still.csv"
    file.write_text("time_s,s.A,r.A\n" + "".join(f"{n},{n % 7},10\n" for n in range(50)))
    answer = client.upload_takes(file, subject="anna")
    assert any("never moves" in sentence for sentence in answer["warnings"])
