"""``/ready`` while real time dies again and again: back within a second, it looks alive to who looks once."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from glovecal_client.rest import RestClient, ServiceError
from glovecal_service.rest.http.health import REALTIME_ALIVE
from glovecal_service.rest.in_process import in_process_client
from glovecal_service.restarts import Restarts
from glovecal_service.settings import Settings


@pytest.fixture
def alive(tmp_path: Path) -> Iterator[tuple[RestClient, Path]]:
    settings = Settings(data=tmp_path / "data")
    with in_process_client(settings) as client:
        (settings.data / REALTIME_ALIVE).touch()
        yield client, settings.data


def test_restarts_of_real_time_are_told(alive: tuple[RestClient, Path]) -> None:
    client, data = alive
    assert client.get("/health/ready")["problems"] == []
    Restarts(data).note()
    answer = client.get("/health/ready")
    assert answer["realtime_restarts"] == 1
    assert answer["problems"] == [
        "real time ended and was started again once in the last 10 minutes: poses were missing meanwhile; "
        "glovecal serve's log says why"
    ]
    for _ in range(2):
        Restarts(data).note()
    with pytest.raises(ServiceError, match=r"gloves are served with interruptions: .* 3 times") as refused:
        client.get("/health/ready")
    assert refused.value.status == 503
    Restarts(data).forget()
    assert client.get("/health/ready")["realtime_restarts"] == 0


def test_the_file_of_restarts_stays_small_and_may_be_damaged(tmp_path: Path) -> None:
    restarts = Restarts(tmp_path)
    for _ in range(300):
        restarts.note()
    assert restarts.within(600) == 100
    (tmp_path / "realtime.restarts").write_bytes(b"\xff\x00 nan\n\n1e400\nx\n")
    assert restarts.within(600) in (0, 1)
