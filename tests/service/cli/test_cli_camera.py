"""The colour glove's sheets and a camera's calibration through the command line."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pypdfium2
from cli_running import Run

WITHOUT = """
import sys
class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] == "numba":
            raise ModuleNotFoundError("No module named 'numba'", name="numba")
sys.meta_path.insert(0, Missing())
from glovecal_service.cli.command import main
main(["camera", "sheets", "--out", sys.argv[1]])
"""


def test_sheets_are_written_for_a_subject(run: Run, tmp_path: Path) -> None:
    assert run("subject", "add", "pia", "--hand", "left", "--hand-length-mm", 172).code == 0
    written = run("camera", "sheets", "--subject", "pia", "--out", tmp_path / "print", "--json")
    assert written.code == 0, written.err
    assert (written.json["hand"], written.json["hand_length_mm"]) == ("left", 172)
    for files in written.json["files"].values():
        document = pypdfium2.PdfDocument(files[0])
        sizes = [sorted(round(side / 72 * 25.4, 1) for side in page.get_size()) for page in document]
        document.close()
        assert sizes == [[210.0, 297.0]] * (len(files) - 1)
        assert all(Path(svg).stat().st_size > 1000 for svg in files[1:])


def test_what_cannot_be_printed_is_said(run: Run, tmp_path: Path) -> None:
    small = run("camera", "sheets", "--out", tmp_path, "--hand-length-mm", 17)
    assert (small.code, "between 60 and 300 mm" in small.said) == (1, True)
    (tmp_path / "own.json").write_text(json.dumps({"colours": [1, 2]}))
    pattern = run("camera", "sheets", "--out", tmp_path, "--pattern", tmp_path / "own.json")
    assert (pattern.code, "20 numbers of 1 to 10" in pattern.said) == (1, True)
    assert list(tmp_path.glob("*.pdf")) == []


def test_without_the_extra_it_says_how_to_install_it(tmp_path: Path) -> None:
    found = subprocess.run(
        [sys.executable, "-c", WITHOUT, str(tmp_path)], capture_output=True, text=True, timeout=60
    )
    assert found.returncode == 1
    assert "needs numba" in found.stderr
    assert "pip install 'glovecal-service[camera]'" in found.stderr
