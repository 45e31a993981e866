"""What README and the pages show as printed is what their commands print."""

from __future__ import annotations

import re
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "docs"))

from transcripts.lines import Names, NoLongerPrinted, Tolerance, differs, rewritten  # noqa: E402
from transcripts.page import Command, File, read_page  # noqa: E402
from transcripts.pages import OTHER_CPU, Outcome, every_page, outcomes  # noqa: E402

README = ROOT / "README.md"
SLOW = r"do\.py demo|glovecal add-effect|glovecal (serve|capture|watch)"
"""What README's walk has and the suite has no time for, or a busy computer not within 3 s: the slow test runs
it."""
PRINTED = [
    "Model 3bc7ca31e06b, error 3.46 degrees.",
    "rotation  error",
    "I_MCP     0.995",
    "I_PIP     12.30",
    "",
]


def said(together: list[Outcome]) -> str:
    return "\n".join(str(difference) for outcome in together for difference in outcome.differences)


@pytest.fixture(autouse=True)
def bash(not_here: Callable[[str], NoReturn]) -> None:
    if shutil.which("bash") is None:
        not_here("needs bash: the pages' commands are written for it")


def test_readme_prints_what_one_gets() -> None:
    [together] = outcomes([README], leave_out=SLOW)
    assert not said(together), said(together)


@pytest.mark.slow
@pytest.mark.timeout(7200)
def test_every_page_prints_what_one_gets() -> None:
    for together in outcomes(every_page()):
        assert not said(together), said(together)


@pytest.mark.parametrize("page", every_page(), ids=lambda page: page.stem)
def test_nothing_is_shown_as_printed_that_no_command_prints(page: Path) -> None:
    read = read_page(page)
    shown = [f"{page.name}:{number + 1}: {read.lines[number]}" for number in read.unclaimed]
    assert not shown, (
        "no command prints these lines; begin the block with `$ COMMAND`, or put "
        "`<!-- printed by: COMMAND -->` before it:\n" + "\n".join(shown)
    )


@pytest.mark.parametrize("page", ["README.md", "docs/tutorial.md"])
def test_figures_in_the_text_stand_in_what_is_printed(page: str) -> None:
    read = read_page(ROOT / page)
    printed = [
        float(figure)
        for step in read.steps
        if isinstance(step, Command)
        for figure in re.findall(r"\d+\.\d+|\d+", "\n".join(step.promised))
    ]
    prose = re.sub(
        r"^```.*?^```|<!--.*?-->|!\[.*?\]", "", "\n".join(read.lines), flags=re.MULTILINE | re.DOTALL
    )
    for figure in re.findall(r"(?<![\w.])(\d+\.\d+) (?:degrees|mm)", prose):
        places = len(figure.partition(".")[2])
        rounded = {f"{value:.{places}f}" for value in printed}
        assert figure in rounded, f"{page}: {figure} is not printed by any of its commands"


def test_a_page_that_holds_stays_as_it_is() -> None:
    for promised in (
        PRINTED[:-1],
        ["...", "I_PIP     12.30"],
        ["Model 3bc7ca31e06b, error 3.46 degrees.", "..."],
        ["...", "rotation  error", "...", "I_PIP     12.30"],
        ["Model 3bc7ca31e06b, ...", "..."],
    ):
        assert rewritten(promised, [line for line in PRINTED if line], Names()) == promised


def test_figures_and_words_that_changed_are_written_and_elisions_stay() -> None:
    names = Names()
    promised = ["Model 000000000001, ... 3.62 degrees.", "...", "I_MCP     1.35", "..."]
    assert rewritten(promised, PRINTED, names) == [
        "Model 000000000001, ... 3.46 degrees.", "...", "I_MCP     0.995", "...",
    ]  # fmt: skip
    assert names.in_run("glovecal diagnose 000000000001") == "glovecal diagnose 3bc7ca31e06b"
    assert names.in_run("lmc_gpr 000000") == "lmc_gpr 3bc7ca"
    whole = ["Model 000000000001, error 3.62 degrees and no more.", "I_PIP     12.30"]
    assert rewritten(whole, PRINTED, Names())[1:] == PRINTED[1:]
    assert (
        rewritten(["...", "Model 3bc7ca31e06b, mistake 3.46 degrees.", "..."], PRINTED, Names())[1]
        == PRINTED[0]
    )


def test_a_line_that_nothing_comes_near_to_is_told() -> None:
    with pytest.raises(NoLongerPrinted) as told:
        rewritten(
            ["Model 3bc7ca31e06b, error 3.46 degrees.", "...", "Missing: hysteresis on I_PIP", "..."],
            PRINTED,
            Names(),
        )
    assert told.value.place == 2
    with pytest.raises(NoLongerPrinted):
        rewritten(["rotation  error", "Missing: hysteresis on I_PIP", "..."], PRINTED, Names())
    form = rewritten(['"form": "several_plays",', "..."], ['"form": "relays",', '"stage": 1'], Names())
    assert form == ['"form": "relays",', "..."]


@pytest.mark.parametrize(
    ("promised", "now", "is_told"),
    [
        ("3.46 degrees", "3.62 degrees", True),
        ("3.46 degrees", "3.47 degrees", False),
        ("3.46 degrees", "3.4 degrees", True),
        ("0.995  yes", " 1.00  yes", False),
        ("0.6  I_PIP", "0.601  I_PIP", False),
        ("0.6  I_PIP", "0.611  I_PIP", True),
        ("0.59-0.66", "0.59-0.65", False),
        ("hysteresis 3.46", "creep 3.46", True),
        ("trained 2026-11-25 20:14", "trained 2027-01-02 08:00", False),
        ("Model 3bc7ca31e06b", "Model 000000000001", True),
        ("9 takes", "10 takes", True),
        ("73 % of errors", "74 % of errors", False),
        ("73 % of errors", "76 % of errors", True),
        ("a", "a b", True),
    ],
)  # fmt: skip
def test_another_processor_may_change_last_digits_and_nothing_else(
    promised: str, now: str, is_told: bool
) -> None:
    assert differs(promised, now, OTHER_CPU) == is_told
    assert not differs("age_ms 0.678", "age_ms 91.2", Tolerance(None))


def test_a_page_is_read_as_its_comments_say(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "Text.\n<!-- goes on from other.md -->\n<!--\n$ prepare\n-->\n"
        "<!-- file: a.py -->\n```python\n1\n```\n"
        "<!-- figures vary -->\n<!-- printed by: python a.py -->\n```\n1\n```\n"
        "```\n$ glove   # needs a glove\nangle\n$ after\n```\n"
        "```\n$ serve &\n```\n```\nnobody prints this\n```\n"
    )
    read = read_page(page)
    assert read.goes_on_from == tmp_path / "other.md"
    assert [(step.text, step.is_run) for step in read.steps if isinstance(step, Command)] == [
        ("prepare", True),
        ("python a.py", True),
        ("glove   # needs a glove", False),
        ("after", False),
        ("serve &", True),
    ]
    assert File("a.py", "1\n") in read.steps
    printed = read.steps[2]
    assert isinstance(printed, Command)
    assert (printed.promised, printed.figures_vary) == (["1"], True)
    assert read.lines[printed.first : printed.last] == ["1"]
    assert [read.lines[number] for number in read.unclaimed] == ["nobody prints this"]


def test_a_wrong_figure_is_told_with_file_line_command_and_remedy(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("```\n$ echo error 3.46 degrees\nerror 3.62 degrees\n$ no-such-command\n```\n")
    [[outcome]] = outcomes([page])
    wrong, failed = map(str, outcome.differences)
    assert wrong.splitlines()[0].endswith("page.md:3: echo error 3.46 degrees")
    assert "page:    error 3.62 degrees\n  printed: error 3.46 degrees\n" in wrong
    assert f"python3 do.py docs --write {page}" in wrong
    assert "page.md:4: no-such-command" in failed
    outcome.write()
    assert "\nerror 3.46 degrees\n" in page.read_text()
