"""``python3 do.py study``: does the diagnosis name what was hidden in gloves it has never seen?

Simulated gloves with one effect, with two, with none and with causes outside the catalogue; figures with
95 % intervals beside what is demanded, and pictures. Finished gloves are kept: an interrupted study goes on.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from confusion_picture import draw_confusion
from error_fall_picture import draw_error_fall
from finished_gloves import FinishedGloves, software_hash
from glove_choices import effect_names
from glove_jobs import WORKERS, Row, answers
from study_figure import StudyFigure, table
from study_limits import digest, other_limits, read_limits
from study_parts import PARTS, StudyChoices

from glovecal_models.errors import BadInput
from glovecal_models.improvement.limits import IMPROVEMENT_LIMITS
from glovecal_models.threads import pin_blas_to_one_thread

SET_ASIDE = (
    "use the test generators' set-aside forms instead of the open ones; "
    "nobody may look at set-aside results while tuning"
)
LIMITS = (
    "other limits, by name, as a TOML file with the tables diagnosis, comparison and improvement; "
    "docs/thresholds.md lists them"
)
PICTURES = (".png", ".svg")
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
    choices = StudyChoices(options.gloves, options.clean, options.pairs, wanted, options.set_aside, limits)
    parts = [name for name in PARTS if not options.parts or name in options.parts]
    try:
        return 0 if run(parts, choices, options.folder, options.workers) else 1
    except KeyboardInterrupt:
        print("\nstopped; the same command goes on with what is finished", file=sys.stderr)
        return 130


def run(parts: Sequence[str], choices: StudyChoices, folder: Path, workers: int = WORKERS) -> bool:
    """Run parts and write what they found into ``folder``. Whether every glove could be judged."""
    software = software_hash()
    judged = digest(software, choices.limits)
    figures: dict[str, list[StudyFigure]] = {}
    confused: list[Row] = []
    complete = True
    ending = "-set-aside" if choices.set_aside else ""
    for name in parts:
        part = PARTS[name]
        print(f"\n== {name}: {part.sentence} ==", flush=True)
        gloves = part.gloves(choices)
        finished = FinishedGloves(folder, name, judged)
        rows = answers(gloves, partial(part.job, limits=choices.limits), finished, name, workers)
        complete &= len(rows) == len(gloves)
        figures[name] = part.figures(rows)
        print(table(figures[name]), flush=True)
        if part.confusion:
            confused += rows
        if name == "repair" and rows:
            title = f"Blind study: what is left once the missing effect is added{ending.replace('-', ' ', 1)}"
            for suffix in PICTURES:
                draw_error_fall(rows, title, folder / f"error-fall{ending}{suffix}")
        if software_hash() != software:
            print(
                f"the programs changed while {name} ran: its answers are mixed, run it again", file=sys.stderr
            )
            return False
    if confused:
        _draw(confused, folder, ending)
    _write(figures, choices, judged, folder / f"study{ending}")
    return complete


def _draw(rows: Sequence[Row], folder: Path, ending: str) -> None:
    """One matrix for each size of effect; healthy gloves stand in all of them."""
    sizes = sorted({glove.size for glove, _ in rows if glove.size}) or [0.0]
    for size in sizes:
        some = [row for row in rows if row[0].size in (size, 0.0)]
        title = f"Blind study: effects of {size:g} x the noise floor" if size else "Blind study: clean gloves"
        for suffix in PICTURES:
            draw_confusion(
                some, title + ending.replace("-", " ", 1), folder / f"confusion-{size:g}{ending}{suffix}"
            )


def _write(figures: dict[str, list[StudyFigure]], choices: StudyChoices, software: str, path: Path) -> None:
    """Parts that were not run now keep what they found with the same programs."""
    kept = _earlier(path.with_suffix(".json"), software) | figures
    forms = "set-aside forms" if choices.set_aside else "open forms"
    others = other_limits(choices.limits)
    told = "".join(f"; {name} = {value:g}" for name, value in others.items())
    head = f"# Blind study of the diagnosis\n\nSimulated gloves, {forms}; programs {software[:10]}{told}.\n"
    parts = [(name, part, kept[name]) for name, part in PARTS.items() if name in kept]
    text = [head, *(f"## {name}\n\n{part.sentence}\n\n{table(some)}\n" for name, part, some in parts)]
    path.with_suffix(".md").write_text("\n".join(text), encoding="utf-8")
    document = {
        "software": software,
        "set_aside": choices.set_aside,
        "limits": others,
        "figures": {name: [figure.to_document() for figure in some] for name, _, some in parts},
    }
    path.with_suffix(".json").write_text(json.dumps(document, indent=1), encoding="utf-8")
    print(f"\nwritten: {path.with_suffix('.md')}, {path.with_suffix('.json')} and pictures beside them")


def _earlier(path: Path, software: str) -> dict[str, list[StudyFigure]]:
    document = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    if document.get("software") != software:
        return {}
    return {
        name: [StudyFigure.from_document(each) for each in some] for name, some in document["figures"].items()
    }


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="do.py study", description=(__doc__ or "").partition("\n")[0])
    lines = "; ".join(f"{name}: {part.sentence}" for name, part in PARTS.items())
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"default: all. {lines}")
    parser.add_argument("--gloves", type=int, default=20, help="per effect and size (default 20)")
    parser.add_argument("--clean", type=int, default=150, help="clean gloves per base (default 150)")
    parser.add_argument("--pairs", type=int, default=24, help="gloves with two effects per size (default 24)")
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
