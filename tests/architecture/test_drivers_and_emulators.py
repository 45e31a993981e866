"""Drivers and emulated gloves share no code, so that one misreading cannot pass both."""

from __future__ import annotations

import ast
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DRIVERS = ROOT / "client" / "glovecal_client"
EMULATORS = ROOT / "service" / "glovecal_service" / "emulators"


def imported(file: Path) -> set[str]:
    """Dotted names of every module a file imports, inside functions too."""
    found = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file.name}: a relative import"
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def test_no_emulator_imports_a_line_of_the_client() -> None:
    files = sorted(EMULATORS.rglob("*.py"))
    assert len(files) >= 10
    for file in files:
        wrong = {name for name in imported(file) if name.startswith("glovecal_client")}
        assert not wrong, f"{file.relative_to(ROOT)} imports {sorted(wrong)}"


def test_what_emulators_share_with_the_service_knows_no_driver_either() -> None:
    for file in EMULATORS.rglob("*.py"):
        ours = {name for name in imported(file) if name.startswith(("glovecal_models", "glovecal_service"))}
        allowed = ("glovecal_service.emulators", "glovecal_models")
        assert all(name.startswith(allowed) for name in ours), f"{file.relative_to(ROOT)}: {sorted(ours)}"


def test_no_driver_imports_an_emulator() -> None:
    for file in DRIVERS.rglob("*.py"):
        assert not any("emulat" in name for name in imported(file)), file.relative_to(ROOT)
