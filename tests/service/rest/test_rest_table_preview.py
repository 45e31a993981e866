"""A table of another program: sent, looked at, corrected, imported; the next of its shape is read alike."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from foreign_tables import laboratory, logger, semicolons

from glovecal_client.errors import ServiceError
from glovecal_client.rest import RestClient

SHORT = {"count": 5, "seconds": 3.0}


def sent(client: RestClient, path: Path) -> dict[str, Any]:
    return {"upload": client.upload(path), "filename": path.name}


def test_what_a_preview_shows_is_imported(client: RestClient, tmp_path: Path) -> None:
    [path] = semicolons(tmp_path, **SHORT)
    file = sent(client, path)
    seen = client.post("/takes/preview", file)
    assert client.get("/takes") == []
    assert [take["name"] for take in seen["takes"]] == ["t0", "t1", "t2", "t3", "t4"]
    found = client.post(
        "/takes/import", file | {"subject": "anna", "create_subject": True, "mapping": seen["mapping"]}
    )
    assert found["subject_created"]
    assert [take["name"] for take in found["takes"]] == [take["name"] for take in seen["takes"]]
    assert [take["frames"] for take in found["takes"]] == [take["frames"] for take in seen["takes"]]
    assert found["takes"][0]["original_sha256"] == file["upload"]


def test_a_correction_is_kept_for_the_next_file_of_the_shape(client: RestClient, tmp_path: Path) -> None:
    first, second, *_ = logger(tmp_path, **SHORT)
    seen = client.post("/takes/preview", sent(client, first))
    columns = seen["mapping"]["columns"]
    names = {"joint1": "I_PIP", "A1": "I_PIP"}
    corrected = seen["mapping"] | {
        "columns": [item | {"name": names.get(item["header"], item["name"])} for item in columns]
    }
    file = sent(client, first) | {"mapping": corrected, "wearing": "w1"}
    assert client.post("/takes/preview", file)["takes"][0]["rotations"][1] == "I_PIP"
    client.post("/takes/import", file | {"subject": "anna", "create_subject": True})
    again = client.post("/takes/preview", sent(client, second))
    assert (seen["is_kept"], again["is_kept"]) == (False, True)
    assert again["takes"][0]["rotations"][1] == "I_PIP"


def test_what_cannot_be_read_is_refused_and_imports_nothing(client: RestClient, tmp_path: Path) -> None:
    [path] = laboratory(tmp_path, **SHORT)
    file = sent(client, path)
    mapping = client.post("/takes/preview", file)["mapping"]
    columns = [item | {"role": "ignored"} if item["role"] == "time" else item for item in mapping["columns"]]
    body = file | {"mapping": mapping | {"columns": columns}}
    assert "no column holds the time" in client.post("/takes/preview", body)["problem"]
    with pytest.raises(ServiceError, match="no column holds the time"):
        client.post("/takes/import", body | {"subject": "anna", "create_subject": True})
    assert client.get("/takes") == client.get("/subjects") == []


def test_a_file_that_is_no_table_is_refused(client: RestClient, tmp_path: Path) -> None:
    path = tmp_path / "hand.png"
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(64))
    with pytest.raises(ServiceError, match=r"hand\.png: not a table"):
        client.post("/takes/preview", sent(client, path))
    with pytest.raises(ServiceError, match="there is no upload"):
        client.post("/takes/preview", {"upload": "0" * 64, "filename": "a.csv"})
