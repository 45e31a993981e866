"""Builds the Blender extension: its files, and the wheels that Blender unpacks beside them.

``python3 do.py blender`` calls it. Nothing of Blender is needed for that.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
import zipfile
from importlib.metadata import version
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SOURCE = Path(__file__).resolve().parent / "glovecal_blender"
PLATFORMS = {
    "linux-x64": ("manylinux_2_28_x86_64", "manylinux_2_17_x86_64", "manylinux2014_x86_64"),
    "windows-x64": ("win_amd64",),
    "macos-arm64": ("macosx_11_0_arm64",),
    "macos-x64": ("macosx_10_12_x86_64", "macosx_10_9_x86_64"),
}
"""Blender's names, and pip's."""
HERE = {"linux": "linux-x64", "win32": "windows-x64", "darwin": "macos-arm64"}.get(sys.platform, "linux-x64")
OWN = ("client", "models")
OLDEST_PYTHON = "3.11"
"""That of Blender 4.2."""


def own_wheels(folder: Path) -> list[Path]:
    """Of the distributions that the extension is built on; without what they are not asked for here, such as
    scipy: Blender brings numpy alone."""
    for name in OWN:
        command = [
            sys.executable,
            "-m",
            "hatchling",
            "build",
            "--target",
            "wheel",
            "--directory",
            str(folder),
        ]
        subprocess.run(command, cwd=ROOT / name, check=True, capture_output=True)
    return sorted(folder.glob("glovecal_*.whl"))


def zenoh_wheel(pip: str, platform: str, folder: Path) -> Path:
    """The version that is locked."""
    wanted = f"eclipse-zenoh=={version('eclipse-zenoh')}"
    command = [
        pip, "-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-deps", "--only-binary",
        ":all:", "--python-version", OLDEST_PYTHON, "--dest", str(folder), wanted,
    ]  # fmt: skip
    for name in PLATFORMS[platform]:
        command += ["--platform", name]
    subprocess.run(command, check=True)
    return next(folder.glob("eclipse_zenoh*.whl"))


def build(pip: str, platform: str, into: Path) -> Path:
    """The zip."""
    into.mkdir(parents=True, exist_ok=True)
    made = into / f"glovecal-{version('glovecal-client')}-{platform}.zip"
    with tempfile.TemporaryDirectory(prefix="glovecal-blender-") as temporary:
        wheels = own_wheels(Path(temporary, "own"))
        wheels.append(zenoh_wheel(pip, platform, Path(temporary, "others")))
        manifest = (SOURCE / "blender_manifest.toml").read_text(encoding="utf-8")
        listed = ", ".join(f'"./wheels/{wheel.name}"' for wheel in wheels)
        for name, value in {
            "VERSION": version("glovecal-client"), "PLATFORMS": f'["{platform}"]', "WHEELS": f"[{listed}]"
        }.items():  # fmt: skip
            manifest = manifest.replace(name, value)
        part = made.with_suffix(".part")
        with zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("blender_manifest.toml", manifest)
            for source in sorted(SOURCE.glob("*.py")):
                archive.write(source, source.name)
            archive.write(ROOT / "LICENSE", "LICENSE")
            for wheel in wheels:
                archive.write(wheel, f"wheels/{wheel.name}", zipfile.ZIP_STORED)
        shutil.move(part, made)
    return made


def main() -> int:
    parser = argparse.ArgumentParser(prog="python3 do.py blender", description=__doc__)
    parser.add_argument("--platform", choices=[*PLATFORMS, "all"], default=HERE)
    parser.add_argument("--pip", default=sys.executable, help="a Python that has pip")
    parser.add_argument("--into", type=Path, default=ROOT / "dist")
    asked = parser.parse_args()
    for platform in PLATFORMS if asked.platform == "all" else [asked.platform]:
        made = build(asked.pip, platform, asked.into)
        print(f"{made} ({made.stat().st_size / 1e6:.1f} MB)")
    print("In Blender: Edit > Preferences > Get Extensions > Install from Disk.")
    return 0


if __name__ == "__main__":
    sys.exit(main())
