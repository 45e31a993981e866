"""A data folder with a glove, for recorders that run for real."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from recorder_support import recorder_settings, store_with_glove

from glovecal_service.settings import Settings
from glovecal_service.store import Store


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    return recorder_settings(tmp_path)


@pytest.fixture
def store(settings: Settings) -> Iterator[Store]:
    with store_with_glove(settings) as store:
        yield store
