"""What ``uv build`` makes is what a stranger installs: whole, typed, licensed, one version, one name."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import zipfile
from collections.abc import Callable
from configparser import ConfigParser
from email.message import Message
from email.parser import HeaderParser
from pathlib import Path
from typing import NoReturn

import pytest
from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = {
    "glovecal": ("service/glovecal_command",),
    "glovecal-client": ("client/glovecal_client",),
    "glovecal-models": ("models/glovecal", "models/glovecal_models"),
    "glovecal-service": ("service/glovecal_service",),
}
OTHERS = Path(sysconfig.get_path("purelib"))
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


def run(*command: str, code: int = 0, folder: Path = ROOT, **more: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, **more}
    result = subprocess.run(command, capture_output=True, text=True, timeout=150, env=environment, cwd=folder)
    assert result.returncode == code, result.stderr
    return result


@pytest.fixture(scope="module")
def uv(not_here: Callable[[str], NoReturn]) -> str:
    tool = shutil.which("uv") or shutil.which("uv", path=str(ROOT / ".tools" / "bin"))
    if tool is None:
        not_here("needs uv, which python3 do.py installs")
    return tool


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder with a source distribution of each, and a wheel made from that, as ``uv build`` does it."""
    dist, unpacked = tmp_path_factory.mktemp("dist"), tmp_path_factory.mktemp("unpacked")
    hatchling = (sys.executable, "-m", "hatchling", "build", "--directory", str(dist), "--target")
    for folder in (ROOT, ROOT / "client", ROOT / "models", ROOT / "service"):
        run(*hatchling, "sdist", folder=folder)
    for archive in dist.glob("*.tar.gz"):
        run("tar", "-xf", str(archive), folder=unpacked)
        run(*hatchling, "wheel", folder=unpacked / archive.name.removesuffix(".tar.gz"))
    return dist


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
    assert set(said["Requires-Python"].split(",")) - {"<3.15"} == {f">=3.{least}"}  # the lock ends at 3.14


def test_all_have_one_version_and_require_each_other_in_that(built: Path) -> None:
    version = metadata_of(wheel_of(built, "glovecal"))["Version"]
    for name in FOLDERS:
        said = metadata_of(wheel_of(built, name))
        assert said["Version"] == version
        ours = [line for line in said.get_all("Requires-Dist", []) if line.startswith("glovecal")]
        wrong = [line for line in ours if f"=={version}" not in line.partition(";")[0]]
        assert not wrong, f"{name} {version} requires {wrong}"


def test_a_command_is_the_same_by_whatever_name_it_was_installed(built: Path) -> None:
    capture = {
        scripts_of(wheel_of(built, name))["glovecal-capture"] for name in ("glovecal", "glovecal-client")
    }
    assert capture == {"glovecal_client.capture.command:script"}
    service = scripts_of(wheel_of(built, "glovecal-service"))["glovecal"]
    assert service == "glovecal_service.cli.command:script"
    launcher = wheel_of(built, "glovecal").read("glovecal_command/__init__.py").decode()
    assert "from glovecal_service.cli.command import script" in launcher


def scripts_of(wheel: zipfile.ZipFile) -> dict[str, str]:
    """The wheel's commands, each with the function it runs."""
    (name,) = [name for name in wheel.namelist() if name.endswith(".dist-info/entry_points.txt")]
    points = ConfigParser()
    points.read_string(wheel.read(name).decode())
    return dict(points["console_scripts"])


@pytest.mark.parametrize("name", FOLDERS)
def test_a_source_distribution_has_what_its_wheel_is_made_from(built: Path, name: str) -> None:
    (archive,) = built.glob(f"{name.replace('-', '_')}-[0-9]*.tar.gz")
    with tarfile.open(archive) as source:
        files = {path.partition("/")[2] for path in source.getnames()}
    assert {"LICENSE", "README.md", "PKG-INFO", "pyproject.toml"} <= files
    assert not {path for path in files if path.startswith(("tests", ".", "docs")) and path != ".gitignore"}


def test_capture_brings_what_a_glove_needs_and_no_more(built: Path, uv: str, tmp_path: Path) -> None:
    said = {name: metadata_of(wheel_of(built, name)) for name in ("glovecal", "glovecal-client")}
    asked, names = [("glovecal", "capture")], set()
    while asked:
        name, extra = asked.pop()
        names.add(name)
        for line in said[name].get_all("Requires-Dist", []) if name in said else ():
            needed = Requirement(line)
            if needed.marker is None or needed.marker.evaluate({"extra": extra}):
                asked += [(needed.name, each) for each in needed.extras or {""}]
    assert names == {"glovecal", "glovecal-client", "numpy", "eclipse-zenoh", "pyserial"}

    scripts, others = environment(uv, tmp_path), tmp_path / "others"
    install(uv, scripts, wheel_of(built, "glovecal"), wheel_of(built, "glovecal-client"))
    others.mkdir()
    for package in ("numpy", "numpy.libs", "zenoh", "serial"):
        if (OTHERS / package).is_dir():
            (others / package).symlink_to(OTHERS / package)
    run(str(scripts / "python"), "-W", "error", "-c", CAPTURE, PYTHONPATH=str(others))
    told = run(str(scripts / "glovecal-capture"), "--version", PYTHONPATH=str(others))
    assert told.stdout.startswith("glovecal-capture 0.")
    refused = run(str(scripts / "glovecal"), "demo", code=1, PYTHONPATH=str(others))
    assert "glovecal needs the service, which is not installed here: " in refused.stderr


def test_the_command_and_the_library_run_from_wheels(built: Path, uv: str, tmp_path: Path) -> None:
    """Packages of others are taken from here; none of ours is, as .pth files there are not read."""
    scripts = environment(uv, tmp_path)
    install(uv, scripts, *(wheel_of(built, name) for name in FOLDERS))
    run(str(scripts / "python"), "-c", f"import sys{LIBRARY}", PYTHONPATH=str(OTHERS))
    assert run(str(scripts / "glovecal"), "--version", PYTHONPATH=str(OTHERS)).stdout.startswith(
        "glovecal 0."
    )


def environment(uv: str, folder: Path) -> Path:
    """Where the programs of a new, empty environment are."""
    run(uv, "venv", "--quiet", "--no-cache", "--python", sys.executable, str(folder / "empty"))
    return folder / "empty" / "bin"


def install(uv: str, scripts: Path, *wheels: zipfile.ZipFile) -> None:
    """These wheels and nothing else; no network."""
    files = [str(wheel.filename) for wheel in wheels]
    options = ("--quiet", "--no-cache", "--offline", "--no-deps", "--python", str(scripts / "python"))
    run(uv, "pip", "install", *options, *files)
