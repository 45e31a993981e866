"""A model has a name and a note; one that is removed comes back as it was."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from realtime_support import store_model

from glovecal_client.errors import ServiceError
from glovecal_client.rest import RestClient
from glovecal_service.settings import Settings
from glovecal_service.store import Store


@pytest.fixture
def models(settings: Settings, client: RestClient) -> Iterator[tuple[str, str]]:
    """Of anna; the second one is active."""
    with Store.open(settings) as store:
        yield (
            store_model(store, "anna", degrees_per_count=0.5),
            store_model(store, "anna", degrees_per_count=0.4),
        )


def listed(client: RestClient, **query: str) -> list[str]:
    return [model["id"] for model in client.get("/models", query)]


def test_a_name_and_a_note_stay_with_a_model(client: RestClient, models: tuple[str, str]) -> None:
    named = client.put(f"/models/{models[0]}/name", {"name": "Monday", "note": "thumb glued"})
    assert (named["name"], named["note"]) == ("Monday", "thumb glued")
    first = client.get(f"/models/{models[0]}")
    assert (first["id"], first["name"], first["note"]) == (models[0], "Monday", "thumb glued")
    with pytest.raises(ServiceError):
        client.put(f"/models/{models[0]}/name", {"name": "x" * 81})


def test_a_removed_model_comes_back_as_it_was(client: RestClient, models: tuple[str, str]) -> None:
    first, second = models
    before = client.get(f"/models/{first}")
    client.delete(f"/models/{first}")
    assert listed(client) == [second]
    assert listed(client, removed="true") == [first]
    assert client.get(f"/models/{first}")["id"] == first, "what was made of it can still be asked for"
    client.post(f"/models/{first}/restore")
    assert listed(client) == [first, second]
    assert client.get(f"/models/{first}") == before


def test_an_active_model_is_not_removed_and_a_removed_one_that_is_activated_is_back(
    client: RestClient, models: tuple[str, str]
) -> None:
    first, second = models
    with pytest.raises(ServiceError, match="is active: live poses of anna come from it"):
        client.delete(f"/models/{second}")
    client.delete(f"/models/{first}")
    client.post(f"/models/{first}/activate")
    assert listed(client) == [first, second]
