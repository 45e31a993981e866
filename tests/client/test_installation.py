"""A sentence about a missing package names a command that works where it is read."""

from __future__ import annotations

import re
import shlex
import sys
from pathlib import Path

import pytest

import glovecal_client.installation as installation
import glovecal_models.installation
from glovecal_client.errors import DeviceError
from glovecal_client.pictures.source import opencv
from glovecal_models.errors import BadInput
from glovecal_service.camera.camera_settings import camera_not_installed
from glovecal_service.store.database import Database

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("client/glovecal_client", "models/glovecal", "models/glovecal_models", "service/glovecal_service")
COMMANDS = re.compile(r"(pip|uv|conda|apt|pipx) install|uv sync")


@pytest.fixture
def environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An environment of its own, made neither by an image nor with pip."""
    folder = tmp_path / "my gloves" / ".venv"
    folder.mkdir(parents=True)
    monkeypatch.delenv("GLOVECAL_INSTALLED_BY", raising=False)
    monkeypatch.setattr(sys, "prefix", str(folder))
    monkeypatch.setattr(installation, "find_spec", lambda name: None)
    return folder


def test_the_client_and_the_mathematics_say_it_alike() -> None:
    twins = [Path(str(module.__file__)) for module in (installation, glovecal_models.installation)]
    assert twins[0].read_bytes() == twins[1].read_bytes()


def test_no_other_sentence_says_how_to_install() -> None:
    files = [file for package in PACKAGES for file in (ROOT / package).rglob("*.py")]
    saying = [file for file in files if COMMANDS.search(file.read_text(encoding="utf-8"))]
    assert {file.name for file in saying} == {"installation.py"}


def test_with_pip_it_is_the_pip_of_this_python(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("GLOVECAL_INSTALLED_BY", raising=False)
    monkeypatch.setattr(installation, "find_spec", lambda name: name == "pip")
    words = shlex.split(installation.install_command("psycopg[binary]>=3.2"))
    assert words == [sys.executable, "-m", "pip", "install", "psycopg[binary]>=3.2"]


def test_without_pip_it_is_uv_on_the_path(environment: Path) -> None:
    words = shlex.split(installation.install_command("pandas", "matplotlib"))
    assert words == ["uv", "pip", "install", "--python", str(environment), "pandas", "matplotlib"]


def test_a_checkout_has_a_uv_of_its_own(environment: Path) -> None:
    own = environment.parent / ".tools" / "bin" / "uv"
    own.parent.mkdir(parents=True)
    own.touch()
    assert shlex.split(installation.install_command("pandas"))[0] == str(own)


def test_in_an_image_it_is_a_line_of_a_dockerfile(environment: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GLOVECAL_INSTALLED_BY", "image")
    command = installation.install_command("pandas")
    assert command.endswith(f"RUN pip --python '{environment}' install pandas")


def test_only_what_is_missing_is_named() -> None:
    sentence = installation.not_installed("a picture", "numpy", "no-such-package", "nor-this-one")
    assert sentence.startswith("a picture needs no-such-package and nor-this-one, which are not installed: ")
    assert "numpy" not in sentence


def test_camera_and_database_name_every_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(installation, "_is_installed", lambda package: False)
    assert "needs matplotlib, numba, opencv-python-headless and scikit-image" in camera_not_installed("it")
    monkeypatch.setitem(sys.modules, "cv2", None)
    with pytest.raises(DeviceError, match="reading pictures needs opencv-python-headless"):
        opencv()
    monkeypatch.setitem(sys.modules, "psycopg", None)
    with pytest.raises(BadInput, match=r"GLOVECAL_DATABASE with PostgreSQL needs psycopg\[binary\]"):
        Database("postgresql://nobody@localhost/glovecal")
