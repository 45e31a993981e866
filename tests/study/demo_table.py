"""``python3 do.py study demos``: is anything told in the demo that is not so?

The second act of ``do.py demo`` for many seeds and effects, asked of one ``glovecal serve``; every saying is
held against what was hidden. Finished demos are kept: an interrupted table goes on.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
import time
from collections.abc import Mapping, Sequence
from datetime import date
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from finished_gloves import FinishedGloves, software_hash

from glovecal_client.rest import RestClient
from glovecal_models.diagnosis.answer import MissingEffects
from glovecal_service.demo.processes import demo_place, running_service
from glovecal_service.demo.second_act import hidden_contract, is_right, prepare, second_act, told_wrongly
from glovecal_service.first_run.hidden_session import RANDOM_EFFECTS, TAKE_S, hidden_session

SEEDS = range(1, 41)
NAMED = ("none", "unknown", "unknown:posture_locked", *RANDOM_EFFECTS)
NAMED_SEED = 1
BEGIN, END = "<!-- the demos' table begins -->", "<!-- the demos' table ends -->"
HEADS = (
    "demo", "hidden (form)", "named first", "told afterwards", "error, degrees", "floor", "told wrongly",
)  # fmt: skip
Demo = tuple[str, int]


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(prog="do.py study demos", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument(
        "demos", nargs="*", metavar="DEMO",
        help="a seed, two of them as 1-40, or EFFECT:SEED; default: 1-40, and each effect by name at seed 1",
    )  # fmt: skip
    parser.add_argument("--page", type=Path, help="put the table between its marks in this page")
    parser.add_argument("--known", action="store_true", help="ask no further demo: those that are finished")
    parser.add_argument("--folder", type=Path, default=Path(".study"), help="for answers and the table")
    parser.add_argument("--smoke", action="store_true", help="one demo of short takes: seconds")
    options = parser.parse_args(arguments)
    if options.smoke:
        with TemporaryDirectory(prefix="glovecal-study-") as folder:
            print(table(answers([("cross_coupling", 3)], Path(folder), take_s=10.0)))
        return 0
    try:
        demos = [demo for text in options.demos for demo in _demos(text)] or _usual()
    except ValueError:
        parser.error("a demo is a seed (7), some seeds (1-40), or an effect and a seed (creep:4)")
    found = answers(demos, options.folder, is_all_known=options.known)
    text = f"{summary(found)}\n\n{table(found)}"
    print(text)
    (options.folder / "demos.md").write_text(text + "\n", encoding="utf-8")
    if options.page:
        _put(options.page, text)
    return 0


def answers(
    demos: Sequence[Demo], folder: Path, *, take_s: float = TAKE_S, is_all_known: bool = False
) -> list[dict[str, Any]]:
    """What became of each demo, in order; ``is_all_known``: only of those that are finished."""
    kept = FinishedGloves(folder, "demos", software_hash())
    keys = [json.dumps({"effect": effect, "seed": seed}, sort_keys=True) for effect, seed in demos]
    waiting = [demo for demo, key in zip(demos, keys, strict=True) if kept.get(key) is None]
    if waiting and not is_all_known:
        with (
            TemporaryDirectory(prefix="glovecal-demos-") as place,
            running_service(demo_place(Path(place))) as service,
        ):
            for effect, seed in waiting:
                key, begin = json.dumps({"effect": effect, "seed": seed}, sort_keys=True), time.monotonic()
                answer = demo_answer(service, effect, seed, take_s)
                took_s = time.monotonic() - begin
                kept.keep(key, answer, took_s)
                print(f"{effect} {seed}: {took_s:.0f} s", file=sys.stderr, flush=True)
    return [answer for key in keys if (answer := kept.get(key)) is not None]


def demo_answer(service: RestClient, effect: str, seed: int, take_s: float) -> dict[str, Any]:
    """One demo, by a subject of its own: what was hidden, all that was told, and what of it is wrong."""
    hidden = hidden_session(effect, seed, take_s=take_s)
    told: list[str] = []
    with TemporaryDirectory(prefix="glovecal-demos-") as place:
        found = prepare(service, hidden, Path(place), subject=re.sub("[^a-z0-9]+", "-", f"{effect}-{seed}"))
    second_act(service, found, told.append, lambda _: None)
    figures = hidden_contract(hidden, found)
    wrong = told_wrongly(hidden, found)
    if not is_right(hidden, found):
        truth, first = figures["hidden"]["truth"], figures["hidden"]["named"]
        partly = " first" if truth in figures["hidden"]["confidence_set"] else ""
        wrong.insert(0, f"{first or 'nothing'} was named{partly}")
    again = found.diagnosis_after
    return {
        "demo": f"{effect} {seed}" if effect != "random" else str(seed),
        **figures,
        "afterwards": None if again is None else _afterwards(again),
        "told": told,
        "wrong": wrong,
    }


def _afterwards(diagnosis: MissingEffects) -> str:
    if diagnosis.named is not None:
        return f"{diagnosis.named.effect} was named"
    residual = diagnosis.unexplained_residual
    if residual is None or residual.not_identifiable:
        return "cannot tell whether anything is left"
    return "something is left" if residual.is_significant else "no more left than in healthy gloves"


def summary(found: Sequence[Mapping[str, Any]]) -> str:
    """One sentence with its date."""
    right = sum(bool(answer["hidden"]["right"]) for answer in found)
    clean = sum(not answer["wrong"] for answer in found)
    return (
        f"`python3 do.py study demos`, {date.today().isoformat()}: {len(found)} demos; first name right (or "
        f"rightly none) in {right}; in {clean} nothing was told that is not so."
    )


def table(found: Sequence[Mapping[str, Any]]) -> str:
    """One line for each demo."""
    rows = [HEADS, ("---",) * len(HEADS), *(_row(answer) for answer in found)]
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def _row(answer: Mapping[str, Any]) -> tuple[str, ...]:
    hidden, errors, floor = answer["hidden"], answer["error_fall_deg"], answer["noise_floor_deg"]
    form = f" ({hidden['form']})" if hidden["form"] else ""
    after = errors.get("with_effect")
    fall = f"{errors['lmc_gpr']:.2f}" + ("" if after is None else f" to {after:.2f}")
    return (
        answer["demo"],
        f"{hidden['truth']}{form}",
        ", ".join(hidden["confidence_set"]) or "nothing",
        answer["afterwards"] or "",
        fall,
        "" if floor is None else f"{floor:.2f}",
        "; ".join(answer["wrong"]).replace("|", "/"),
    )


def _usual() -> list[Demo]:
    return [*(("random", seed) for seed in SEEDS), *((name, NAMED_SEED) for name in NAMED)]


def _demos(text: str) -> list[Demo]:
    """Raises ValueError."""
    effect, _, seed = text.rpartition(":")
    if effect:
        return [(effect, int(seed))]
    first, _, last = text.partition("-")
    return [("random", number) for number in range(int(first), int(last or first) + 1)]


def _put(page: Path, text: str) -> None:
    """Raises ValueError where the page has no marks."""
    before, _, rest = page.read_text(encoding="utf-8").partition(BEGIN)
    _, end, after = rest.partition(END)
    if not end:
        raise ValueError(f"{page} has no lines {BEGIN} and {END}")
    page.write_text(f"{before}{BEGIN}\n{text}\n{END}{after}", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
