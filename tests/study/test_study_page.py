"""A study that is stopped by the clock, goes on later, and writes its page from what is there."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import Any

import pytest
import study
from blind_glove import BlindGlove
from finished_gloves import FinishedGloves
from glove_choices import clean
from glove_jobs import answers
from study_figure import StudyFigure
from study_page import write_page
from study_parts import PARTS, StudyChoices
from study_results import PartResults, StudyResults
from study_time import estimate, share_of_time

SOFTWARE = "a" * 64


def test_every_part_gets_its_share_of_the_time() -> None:
    assert share_of_time(90.0, [100.0, 200.0]) == pytest.approx(30.0)
    assert share_of_time(60.0, [200.0]) == pytest.approx(60.0)
    assert share_of_time(-5.0, [1.0, 1.0]) == 0.0
    assert share_of_time(5.0, [0.0, 1.0]) == 0.0
    assert share_of_time(5.0, [0.0]) == 5.0
    assert estimate([3600.0, 7200.0], 2) == "about 3.0 h of processor time, 1.5 h with 2 processes"
    whole = sum(part.glove_s * len(part.gloves(StudyChoices())) for part in PARTS.values())
    assert whole / 2 <= 8 * 3600


def test_what_gloves_took_tells_what_the_others_will_cost(tmp_path: Path) -> None:
    finished = FinishedGloves(tmp_path, "names", SOFTWARE)
    for number, took_s in enumerate([10.0, 20.0, 30.0, 40.0, 50.0]):
        assert finished.glove_s is None
        finished.keep(clean(number, linear=False).key, {}, took_s)
    assert finished.glove_s == pytest.approx(30.0)
    assert FinishedGloves(tmp_path, "names", SOFTWARE).glove_s == pytest.approx(30.0)


def test_no_glove_is_asked_after_the_time_and_the_others_are_asked_later(tmp_path: Path) -> None:
    gloves = [clean(number, linear=False) for number in range(40)]
    finished = FinishedGloves(tmp_path, "names", SOFTWARE)
    job = BlindGlove.to_document
    assert answers(gloves, job, finished, "none", 1, until=time.monotonic() - 1) == []
    until = time.monotonic() + 1.0

    def slow(glove: BlindGlove) -> dict[str, Any]:
        """The third takes until there is no time left."""
        time.sleep(max(0.0, until - time.monotonic()) if glove is gloves[2] else 0.0)
        return job(glove)

    some = answers(gloves, slow, finished, "some", 1, until=until)
    assert 0 < len(some) <= 3
    assert [glove for glove, _ in some] == gloves[: len(some)]
    again = FinishedGloves(tmp_path, "names", SOFTWARE)
    assert [glove.key for glove in gloves if again.get(glove.key)] == [glove.key for glove, _ in some]
    every = answers(gloves, job, again, "all", 1, until=math.inf)
    assert [answer["number"] for _, answer in every] == list(range(40))


def results(*, set_aside: bool = False) -> StudyResults:
    first = StudyFigure.share(
        "first of all", [True] * 97 + [False] * 3, at_least=0.97, headline="right first"
    )
    each = StudyFigure.share("first, lag", [True] * 10, reaches=0.85)
    clean_ones = StudyFigure.share("added", [True, False], at_most=0.01, headline="effect added")
    parts = {
        "clean": PartResults(4, 2, [clean_ones]),
        "names": PartResults(120, 100, [first, each]),
    }
    return StudyResults(SOFTWARE, set_aside, {}, parts, {"confusion-1.3.png": "A matrix"})


def test_the_page_tells_what_is_demanded_first_and_joins_set_aside_forms(tmp_path: Path) -> None:
    folder = tmp_path / "answers"
    folder.mkdir()
    (folder / "confusion-1.3.png").write_bytes(b"drawn")
    for aside, name in ((False, "study"), (True, "study-set-aside")):
        results(set_aside=aside).write(folder / name)
    found = [StudyResults.read(folder / name, SOFTWARE) for name in ("study", "study-set-aside")]
    page = tmp_path / "docs" / "study.md"
    write_page(page, [each for each in found if each is not None], folder)
    text = page.read_text()
    assert text.startswith("# The blind study\n")
    assert "All gloves are simulated." in text
    label = "| The right effect first, 1.3 x floor, "
    measured = "right first >= 97 % | 97.0 % (97 of 100 gloves; 91.5 to 99.0 %) | yes |"
    assert f"{label}open forms | {measured}" in text
    assert f"{label}set-aside forms | {measured}" in text
    assert text.count("| Clean gloves |") == 1  # they are the same gloves
    assert "| effect added <= 1 % | 50.0 % (1 of 2 gloves; 9.5 to 90.5 %) | **no** |" in text
    for part in PARTS.values():
        rows = text.count(f"\n| {part.demanded}, ") + text.count(f"\n| {part.demanded} |")
        assert not part.demanded or rows == (2 if part.of_forms else 1)
    assert "| Two effects, open forms |  | not measured |" in text
    assert "Open forms: 102 of 124 gloves done; programs `aaaaaaaaaa`." in text
    assert "Open forms: 100 of 120 gloves, 20 missing." in text
    assert text.index("| demanded |") < text.index("![A matrix](pictures/study-confusion-1.3.png)")
    assert text.index("![A matrix]") < text.index("## names") < text.index("first, lag")
    assert (page.parent / "pictures" / "study-confusion-1.3.png").read_bytes() == b"drawn"


def test_results_of_other_programs_are_not_shown(tmp_path: Path) -> None:
    results().write(tmp_path / "study")
    assert StudyResults.read(tmp_path / "study", "b" * 64) is None
    assert StudyResults.read(tmp_path / "nothing", SOFTWARE) is None
    found = StudyResults.read(tmp_path / "study", SOFTWARE)
    assert found is not None
    found.write(tmp_path / "again")
    assert (tmp_path / "again.md").read_text() == (tmp_path / "study.md").read_text()
    assert StudyResults.read(tmp_path / "again", SOFTWARE) == found


def test_a_page_is_written_without_asking_a_glove(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = tmp_path / "study.md"
    done = study.main(["names", "delays", "--quick", "--folder", str(tmp_path), "--page", str(page)])
    assert done == 0
    assert "0 of 27 gloves done" in page.read_text()
    assert "| The right effect first, 1.3 x floor, open forms |" in page.read_text()
    assert "0 of 18 gloves, 18 missing." in capsys.readouterr().out
