"""What ``uv build`` makes is what a stranger installs: whole, typed, licensed, one version, one name."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from collections.abc import Callable
from email.message import Message
from email.parser import HeaderParser
from pathlib import Path
from typing import NoReturn

import pytest

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = {
    "glovecal": ("service/glovecal_command",),
    "glovecal-client": ("client/glovecal_client",),
    "glovecal-models": ("models/glovecal", "models/glovecal_models"),
    "glovecal-service": ("service/glovecal_service",),
}
TYPED = ("glovecal", "glovecal_client", "glovecal_models", "glovecal_service")
LARGEST_WHEEL = 2_000_000
CAPTURE = """
import numpy as np
from glovecal_client.wire.frame import Frame, decode_frame, encode_frame
import glovecal_client, glovecal_client.capture.command, glovecal_client.pose_subscriber, serial
frame = Frame(1, 2, 3, 4, np.arange(18, dtype="<f4"))
assert decode_frame(encode_frame(frame)).readings.tolist() == list(range(18))
"""
LIBRARY = """
import glovecal, glovecal_models.effects.catalogue, glovecal_service
assert [module.__file__.startswith(sys.prefix) for module in (glovecal, glovecal_models, glovecal_service)]
assert "hysteresis" in glovecal.effects()
"""


def run(*command: str, code: int = 0, **more: str) -> subprocess.CompletedProcess[str]:
    result = subprocess.run(command, capture_output=True, text=True, timeout=150, env={**os.environ, **more})
    assert result.returncode == code, result.stderr
    return result


@pytest.fixture(scope="module")
def uv(not_here: Callable[[str], NoReturn]) -> str:
    tool = shutil.which("uv") or shutil.which("uv", path=str(ROOT / ".tools" / "bin"))
    if tool is None:
        not_here("needs uv, which python3 do.py installs")
    return tool


@pytest.fixture(scope="module")
def built(uv: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder with a source distribution of each, and a wheel made from that."""
    folder = tmp_path_factory.mktemp("dist")
    run(uv, "build", "--all-packages", "--quiet", "--out-dir", str(folder), str(ROOT))
    return folder


def wheel_of(built: Path, name: str) -> zipfile.ZipFile:
    (wheel,) = built.glob(f"{name.replace('-', '_')}-[0-9]*.whl")
    return zipfile.ZipFile(wheel)


def metadata_of(wheel: zipfile.ZipFile) -> Message:
    (name,) = [name for name in wheel.namelist() if name.endswith(".dist-info/METADATA")]
    return HeaderParser().parsestr(wheel.read(name).decode())


@pytest.mark.parametrize("name", FOLDERS)
def test_a_wheel_is_whole(built: Path, name: str) -> None:
    wheel = wheel_of(built, name)
    files = {path for path in wheel.namelist() if ".dist-info/" not in path}
    kept = {
        path.relative_to((ROOT / folder).parent).as_posix()
        for folder in FOLDERS[name]
        for path in (ROOT / folder).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert files == kept
    assert Path(str(wheel.filename)).stat().st_size < LARGEST_WHEEL
    packages = {path.partition("/")[0] for path in files}
    assert {package for package in packages & set(TYPED) if f"{package}/py.typed" not in files} == set()
    (licence,) = [path for path in wheel.namelist() if path.endswith(".dist-info/licenses/LICENSE")]
    assert wheel.read(licence) == (ROOT / "LICENSE").read_bytes()


@pytest.mark.parametrize("name", FOLDERS)
def test_a_distribution_says_what_it_is(built: Path, name: str) -> None:
    said = metadata_of(wheel_of(built, name))
    assert said["Name"] == name
    assert said["License-Expression"] == "Apache-2.0"
    assert said["Summary"].endswith(".")
    assert said["Description-Content-Type"] == "text/markdown"
    assert str(said.get_payload()).startswith("# ")
    classifiers = said.get_all("Classifier", [])
    assert "Programming Language :: Python :: 3.14" in classifiers
    least = re.findall(r"3\.(\d+)", " ".join(classifiers))[0]
    assert said["Requires-Python"].removesuffix(",<3.15") == f">=3.{least}"  # the lock is for no newer ones


def test_all_have_one_version_and_require_each_other_in_that(built: Path) -> None:
    version = metadata_of(wheel_of(built, "glovecal"))["Version"]
    for name in FOLDERS:
        said = metadata_of(wheel_of(built, name))
        assert said["Version"] == version
        ours = [line for line in said.get_all("Requires-Dist", []) if line.startswith("glovecal")]
        wrong = [line for line in ours if f"=={version}" not in line.partition(";")[0]]
        assert not wrong, f"{name} {version} requires {wrong}"


@pytest.mark.parametrize("name", FOLDERS)
def test_a_source_distribution_has_what_its_wheel_is_made_from(built: Path, name: str) -> None:
    (archive,) = built.glob(f"{name.replace('-', '_')}-[0-9]*.tar.gz")
    with tarfile.open(archive) as source:
        files = {path.partition("/")[2] for path in source.getnames()}
    assert {"LICENSE", "README.md", "PKG-INFO", "pyproject.toml"} <= files
    assert not {path for path in files if path.startswith(("tests", ".", "docs")) and path != ".gitignore"}


def test_capture_brings_what_a_glove_needs_and_no_more(built: Path, uv: str, tmp_path: Path) -> None:
    scripts = environment(uv, tmp_path)
    install(uv, scripts, "--find-links", str(built), "glovecal[capture]")
    listed = run(uv, "pip", "list", "--python", str(scripts / "python"), "--format", "json").stdout
    names = {item["name"] for item in json.loads(listed)}
    assert names == {"glovecal", "glovecal-client", "numpy", "eclipse-zenoh", "pyserial"}
    run(str(scripts / "python"), "-W", "error", "-c", CAPTURE, PYTHONPATH="")
    assert run(str(scripts / "glovecal-capture"), "--version").stdout.startswith("glovecal-capture 0.")
    refused = run(str(scripts / "glovecal"), "demo", code=1, PYTHONPATH="")
    assert "glovecal needs the service, which is not installed here: " in refused.stderr


def test_the_command_and_the_library_run_from_wheels(built: Path, uv: str, tmp_path: Path) -> None:
    """Packages of others are taken from here; none of ours is, as .pth files there are not read."""
    scripts = environment(uv, tmp_path)
    install(uv, scripts, "--no-deps", "--offline", *(str(wheel) for wheel in built.glob("*.whl")))
    others = next(path for path in sys.path if path.endswith("site-packages"))
    run(str(scripts / "python"), "-c", f"import sys{LIBRARY}", PYTHONPATH=others)
    assert run(str(scripts / "glovecal"), "--version", PYTHONPATH=others).stdout.startswith("glovecal 0.")


def environment(uv: str, folder: Path) -> Path:
    """Where the programs of a new, empty environment are."""
    run(uv, "venv", "--quiet", "--python", sys.executable, str(folder / "empty"))
    return folder / "empty" / "bin"


def install(uv: str, scripts: Path, *what: str) -> None:
    run(uv, "pip", "install", "--quiet", "--python", str(scripts / "python"), *what)
