"""A key in the environment, for tests of what is encrypted on disk."""

from __future__ import annotations

from pathlib import Path

import pytest

from glovecal_client.encryption.key_file import KEY_FILE, EncryptionKey, make_key_file


def use_new_key(place: Path, monkeypatch: pytest.MonkeyPatch, name: str = "disk.key") -> EncryptionKey:
    """Make a key in the folder ``place`` and name it in the environment."""
    key = make_key_file(place / name)
    monkeypatch.setenv(KEY_FILE, str(key.file))
    return key
