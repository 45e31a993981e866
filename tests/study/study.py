"""``python3 do.py study``: does the diagnosis name what was hidden in gloves it has never seen?

Simulated gloves with one effect, with two, with none and with causes outside the catalogue; figures with
95 % intervals beside what is demanded, pictures, and a page of the documentation. Finished gloves are kept:
an interrupted study goes on.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from confusion_picture import draw_confusion
from error_fall_picture import draw_error_fall
from finished_gloves import FinishedGloves, software_hash
from glove_choices import effect_names
from glove_jobs import WORKERS, Row, answers
from study_figure import table
from study_limits import digest, other_limits, read_limits
from study_page import write_page
from study_parts import PARTS, QUICK, StudyChoices
from study_results import PartResults, StudyResults, counts
from study_time import estimate, share_of_time

from glovecal_models.errors import BadInput
from glovecal_models.improvement.limits import IMPROVEMENT_LIMITS
from glovecal_models.worker_processes import pin_blas_to_one_thread

SET_ASIDE = (
    "use the test generators' set-aside forms instead of the open ones; "
    "nobody may look at set-aside results while tuning"
)
LIMITS = (
    "other limits, by name, as a TOML file with the tables diagnosis, comparison and improvement; "
    "docs/thresholds.md lists them"
)
MINUTES = "ask no further glove after so many; each part gets its share of them"
PAGE = (
    "write the page of the documentation from the answers at hand (also of set-aside forms); "
    "asks no further glove unless --minutes is given"
)
COUNTS = {
    "gloves": "per effect and size",
    "clean": "clean gloves per base",
    "few_takes": "healthy gloves with few short takes",
    "repairs": "gloves with one effect at 2.6 floors to be repaired, per effect",
    "pairs": "gloves with two effects per size",
    "second_names": "gloves with one effect through improve, in all",
    "ceilings": "gloves asked for their ceiling, in all; half of them clean",
    "recorded": "gloves with a recorded cause without a name, in all; a quarter of them is left out",
}
SMOKE = ("names", "--effects", "lag", "--gloves", "1", "--workers", "1")


def main(arguments: Sequence[str]) -> int:
    options = _parser().parse_args(arguments)
    if options.smoke:
        with TemporaryDirectory(prefix="glovecal-study-") as folder:
            return main([*SMOKE, "--folder", folder])
    unknown = [name for name in options.parts if name not in PARTS]
    if unknown:
        _parser().error(f"there is no part {unknown[0]!r}; there are {', '.join(PARTS)}")
    wanted = tuple(name for name in options.effects.split(",") if name)
    try:
        effect_names(wanted)
        limits = IMPROVEMENT_LIMITS if options.limits is None else read_limits(options.limits)
    except (ValueError, OSError, BadInput) as problem:
        _parser().error(str(problem))
    pin_blas_to_one_thread()
    usual = QUICK if options.quick else StudyChoices()
    numbers = {name: getattr(options, name) for name in COUNTS if getattr(options, name) is not None}
    choices = replace(usual, **numbers, effects=wanted, set_aside=options.set_aside, limits=limits)
    parts = [name for name in PARTS if not options.parts or name in options.parts]
    minutes = 0.0 if options.page and options.minutes is None else options.minutes
    try:
        complete = run(parts, choices, options.folder, options.workers, minutes)
    except KeyboardInterrupt:
        print("\nstopped; the same command goes on with what is finished", file=sys.stderr)
        return 130
    if options.page and complete is not None:
        _page(options.page, options.folder, digest(software_hash(), limits))
    return 0 if complete else 1


def run(
    parts: Sequence[str],
    choices: StudyChoices,
    folder: Path,
    workers: int = WORKERS,
    minutes: float | None = None,
) -> bool | None:
    """Run parts and write what they found into ``folder``.

    Whether every glove could be judged, but for those that were not reached in ``minutes``. None: the
    programs changed meanwhile.
    """
    software = software_hash()
    judged = digest(software, choices.limits)
    end = math.inf if minutes is None else time.monotonic() + 60 * minutes
    gloves = {name: PARTS[name].gloves(choices) for name in parts}
    kept = {name: FinishedGloves(folder, name, judged) for name in parts}
    costs = [
        (kept[name].glove_s or PARTS[name].glove_s)
        * sum(kept[name].get(glove.key) is None for glove in gloves[name])
        for name in parts
    ]
    print(f"{sum(map(len, gloves.values()))} gloves; for what is missing {estimate(costs, workers)}")
    ending = "-set-aside" if choices.set_aside else ""
    path = folder / f"study{ending}"
    results = StudyResults.read(path, judged) or StudyResults(
        judged, choices.set_aside, other_limits(choices.limits)
    )
    confused: list[Row] = []
    complete = True
    for place, name in enumerate(parts):
        part = PARTS[name]
        print(f"\n== {name}: {part.sentence} ==", flush=True)
        now = time.monotonic()
        until = end if math.isinf(end) else now + share_of_time(end - now, costs[place:])
        job = partial(part.job, limits=choices.limits)
        rows = answers(gloves[name], job, kept[name], name, workers, until)
        complete &= len(rows) == len(gloves[name]) or time.monotonic() >= until
        found = PartResults(len(gloves[name]), len(rows), part.figures(rows) if rows else [])
        results.parts[name] = found
        print(f"{counts(found)}\n{table(found.figures)}", flush=True)
        if part.confusion:
            confused += rows
        if name == "repair" and rows:
            title = f"Blind study: what is left once the missing effect is added{ending.replace('-', ' ', 1)}"
            draw_error_fall(rows, title, folder / f"error-fall{ending}.png")
            results.pictures[f"error-fall{ending}.png"] = title
        if software_hash() != software:
            print(
                f"the programs changed while {name} ran: its answers are mixed, run it again", file=sys.stderr
            )
            return None
    results.pictures |= _draw(confused, folder, ending)
    results.write(path)
    print(f"\nwritten: {path.with_suffix('.md')}, {path.with_suffix('.json')} and pictures beside them")
    return complete


def _draw(rows: Sequence[Row], folder: Path, ending: str) -> dict[str, str]:
    """One matrix for each size of effect, healthy gloves in all of them. Titles by the name of the file."""
    sizes = sorted({glove.size for glove, _ in rows if glove.size}) or [0.0]
    drawn = {}
    for size in sizes if rows else []:
        some = [row for row in rows if row[0].size in (size, 0.0)]
        title = f"Blind study: effects of {size:g} x the noise floor" if size else "Blind study: clean gloves"
        title, name = title + ending.replace("-", " ", 1), f"confusion-{size:g}{ending}.png"
        draw_confusion(some, title, folder / name)
        drawn[name] = title
    return drawn


def _page(page: Path, folder: Path, judged: str) -> None:
    found = [StudyResults.read(folder / f"study{ending}", judged) for ending in ("", "-set-aside")]
    write_page(page, [each for each in found if each is not None], folder)
    print(f"written: {page}")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="do.py study", description=(__doc__ or "").partition("\n")[0])
    lines = "; ".join(f"{name}: {part.sentence}" for name, part in PARTS.items())
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"default: all. {lines}")
    for name, meaning in COUNTS.items():
        text = f"{meaning} (default {getattr(StudyChoices(), name)})"
        parser.add_argument(f"--{name.replace('_', '-')}", type=int, metavar="N", help=text)
    parser.add_argument("--quick", action="store_true", help="everything with one or two gloves")
    parser.add_argument("--minutes", type=float, metavar="N", help=MINUTES)
    parser.add_argument("--page", type=Path, metavar="FILE", help=PAGE)
    parser.add_argument("--effects", default="", help="only these, separated by commas")
    parser.add_argument("--set-aside", action="store_true", help=SET_ASIDE)
    parser.add_argument("--limits", type=Path, metavar="FILE", help=LIMITS)
    smoke = "one glove with one effect, in a temporary folder: seconds"
    parser.add_argument("--smoke", action="store_true", help=smoke)
    parser.add_argument("--workers", type=int, default=WORKERS, help="processes (default 2)")
    parser.add_argument("--folder", type=Path, default=Path(".study"), help="for answers, figures, pictures")
    return parser


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
