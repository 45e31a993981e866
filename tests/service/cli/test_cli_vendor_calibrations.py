"""Another program's calibration through the command line: in, kept like any model, and out again."""

from __future__ import annotations

from pathlib import Path

from cli_running import Run

from glovecal_models.layout import Layout
from glovecal_service.exports.vendor_calibrations import cyberglove
from glovecal_service.exports.vendor_calibrations.calibration_format import Counts, SensorLine

SENSORS = Layout.built_in("cyberglove22").sensors


def test_the_command_imports_and_exports(run: Run, tmp_path: Path) -> None:
    text = cyberglove.write_asr(dict.fromkeys(SENSORS, SensorLine(0.8, 60.0)), Counts(1.0, 255.0), "right")
    (tmp_path / "right.cal").write_text(text)
    chosen = ("--format", "asr", "--layout", "cyberglove22", "-s", "anna", "--create-subject")
    imported = run("model", "import", tmp_path / "right.cal", *chosen)
    assert imported.code == 0, imported.err
    assert "was imported" in imported.out
    models = run("model", "list", "--json")
    model = models.json[0]["id"]
    assert "scale (°/count)" in run("model", "show", model).out
    exported = run("model", "export", model, tmp_path / "again.cal", "--format", "asr")
    assert exported.code == 0, exported.err
    assert (tmp_path / "again.cal").read_text() == text
    alone = run("model", "import", tmp_path / "right.cal", "--format", "asr")
    assert "--layout and --subject go together" in alone.said
    (tmp_path / "wrong.cal").write_text("no calibration")
    refused = run("model", "import", tmp_path / "wrong.cal", *chosen)
    assert refused.code == 1
    assert "1 line; an ASR calibration has 22 of two points each" in refused.said
