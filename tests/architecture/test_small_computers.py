"""Capture installs on a Raspberry Pi or a Jetson from wheels alone: told from uv.lock, without a network."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from packaging.markers import Marker
from packaging.tags import Tag, compatible_tags, cpython_tags
from packaging.utils import parse_wheel_filename

ROOT = Path(__file__).resolve().parents[2]
PYTHONS = (11, 12, 13, 14)
OLDEST_GLIBC, LAST_MANYLINUX = 31, 17
"""Of Debian 11 and Ubuntu 20.04; their pip takes wheels built for any from 2.17 to that."""


@pytest.fixture(scope="module")
def lock() -> list[dict[str, Any]]:
    return tomllib.loads((ROOT / "uv.lock").read_text(encoding="utf-8"))["package"]


def environment(minor: int) -> dict[str, str]:
    """What markers are told on 64-bit ARM Linux."""
    return {
        "python_version": f"3.{minor}",
        "python_full_version": f"3.{minor}.0",
        "sys_platform": "linux",
        "platform_system": "Linux",
        "platform_machine": "aarch64",
        "os_name": "posix",
        "platform_python_implementation": "CPython",
        "implementation_name": "cpython",
    }


def tags(minor: int) -> set[Tag]:
    """Of every wheel that such a computer takes."""
    linux = [f"manylinux_2_{glibc}_aarch64" for glibc in range(OLDEST_GLIBC, LAST_MANYLINUX - 1, -1)]
    platforms = [*linux, "manylinux2014_aarch64"]
    version = (3, minor)
    return {*cpython_tags(version, platforms=platforms), *compatible_tags(version, f"cp3{minor}", platforms)}


def closure(lock: list[dict[str, Any]], minor: int) -> Iterator[dict[str, Any]]:
    """The packages that ``glovecal-client[capture]`` brings, itself left out."""
    (client,) = [package for package in lock if package["name"] == "glovecal-client"]
    waiting = [*client["dependencies"], *client["optional-dependencies"]["capture"]]
    seen: set[str] = set()
    while waiting:
        asked = waiting.pop()
        if "marker" in asked and not Marker(asked["marker"]).evaluate(environment(minor)):
            continue
        (package,) = [
            each
            for each in lock
            if each["name"] == asked["name"] and asked.get("version", each["version"]) == each["version"]
        ]
        if package["name"] not in seen:
            seen.add(package["name"])
            waiting += package.get("dependencies", [])
            yield package


@pytest.mark.parametrize("minor", PYTHONS)
def test_every_package_of_capture_has_a_wheel_for_64_bit_arm(lock: list[dict[str, Any]], minor: int) -> None:
    usable, names = tags(minor), set()
    for package in closure(lock, minor):
        files = [wheel["url"].rpartition("/")[2] for wheel in package.get("wheels", [])]
        fitting = [file for file in files if parse_wheel_filename(file)[3] & usable]
        assert fitting, f"{package['name']} {package['version']} has no wheel for aarch64, Python 3.{minor}"
        names.add(package["name"])
    assert names == {"numpy", "eclipse-zenoh", "pyserial"}
