"""README's two commands need no compiler: the lock has a wheel for every Python and system named here."""

from __future__ import annotations

import tomllib
from itertools import chain
from pathlib import Path
from typing import Any

import pytest
from packaging.markers import Marker
from packaging.tags import Tag, compatible_tags, cpython_tags, mac_platforms
from packaging.utils import parse_wheel_filename

LOCK = tomllib.loads((Path(__file__).parents[2] / "uv.lock").read_text(encoding="utf-8"))
PYTHONS = ("3.11.0", "3.11.5", "3.12.0", "3.13.0", "3.14.0")
"""The first of each, and where the lock itself draws a line."""
MANYLINUX = ("manylinux1", "manylinux2014", *(f"manylinux_2_{minor}" for minor in range(5, 37)))
"""Debian 12 has glibc 2.36, the oldest that is tried."""
SYSTEMS = {
    "Linux x86_64": ("linux", [f"{name}_x86_64" for name in MANYLINUX]),
    "Linux aarch64": ("linux", [f"{name}_aarch64" for name in MANYLINUX]),
    "Darwin arm64": ("darwin", list(mac_platforms((26, 0), "arm64"))),  # GPy's wheels ask for macOS 26
    "Windows AMD64": ("win32", ["win_amd64"]),
}
OTHER_GROUPS = ("bench",)


def locked(python: str, system: str) -> list[dict[str, Any]]:
    """Packages that ``demo`` and ``test`` install there, and all that their extras would."""
    name, machine = system.split()
    here = {
        "python_full_version": python,
        "python_version": python.rpartition(".")[0],
        "sys_platform": SYSTEMS[system][0],
        "os_name": "nt" if name == "Windows" else "posix",
        "platform_system": name,
        "platform_machine": machine,
        "platform_python_implementation": "CPython",
        "implementation_name": "cpython",
    }
    reached: dict[tuple[str, str | None], dict[str, Any]] = {}
    waiting = [{"name": name} for name in LOCK["manifest"]["members"]]
    while waiting:
        wanted = waiting.pop()
        version = wanted.get("version")
        key = (wanted["name"], version)
        if key in reached or not Marker(wanted.get("marker", "os_name != ''")).evaluate(here):
            continue
        names = (each for each in LOCK["package"] if each["name"] == key[0])
        reached[key] = package = next(each for each in names if version in (None, each.get("version")))
        groups = package.get("optional-dependencies", {}) | package.get("dev-dependencies", {})
        needed = (group for name, group in groups.items() if name not in OTHER_GROUPS)
        waiting += chain(package.get("dependencies", []), *needed)
    return [package for package in reached.values() if "registry" in package["source"]]


def usable(python: str, system: str) -> set[Tag]:
    major, minor, _ = map(int, python.split("."))
    platforms = SYSTEMS[system][1]
    compiled = cpython_tags((major, minor), platforms=platforms)
    return {*compiled, *compatible_tags((major, minor), f"cp{major}{minor}", platforms)}


@pytest.mark.parametrize("python", PYTHONS)
@pytest.mark.parametrize("system", SYSTEMS)
def test_everything_that_is_locked_has_a_wheel(python: str, system: str) -> None:
    packages, tags = locked(python, system), usable(python, system)
    assert len(packages) > 100
    files = {
        package["name"]: [each["url"].rpartition("/")[2] for each in package.get("wheels", ())]
        for package in packages
    }
    without = [
        name
        for name, wheels in files.items()
        if not any(tags & parse_wheel_filename(wheel)[3] for wheel in wheels)
    ]
    assert without == []
