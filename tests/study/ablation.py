"""``python3 do.py study ablation``: what every rule of the diagnosis is worth, in gloves.

The same gloves with all rules and without each: names, confidence sets and alarms that a rule puts right, and
that it spoils, on open forms, on set-aside forms and on real recordings. Finished gloves are kept.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from ablation_answer import ablation_answer
from ablation_page import ablation_page
from ablation_recordings import recorded_answers
from blind_glove import BlindGlove
from finished_gloves import FinishedGloves, software_hash
from glove_choices import RECORDED_UNNAMED, clean, effect_names, pair, unknown, unknown_names, with_cause
from glove_jobs import WORKERS, answers
from naming_figures import JUDGED_SIZE
from study_parts import LARGE_SIZE

from glovecal_models.improvement.limits import IMPROVEMENT_LIMITS
from glovecal_models.worker_processes import pin_blas_to_one_thread

PART = "ablation"
PAIRS, UNKNOWN = 4, 3
"""Of a round, beside one glove of each effect in an open and in a set-aside form."""
BETWEEN_TAKES = ("donning_shift", "temperature", "humidity", "supply_sag", "warmup_drift")
RECORDINGS = Path(__file__).resolve().parents[3] / "shared" / "data"


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="do.py study ablation", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("--rounds", type=int, default=10, help="of about 50 gloves each (default 10)")
    parser.add_argument("--minutes", type=float, help="ask no further glove after so many")
    parser.add_argument("--page", type=Path, metavar="FILE", help="write the page of the documentation")
    parser.add_argument("--workers", type=int, default=WORKERS, help="processes (default 2)")
    parser.add_argument("--recordings", type=Path, default=RECORDINGS, help="folder of real recordings")
    parser.add_argument("--folder", type=Path, default=Path(".study"), help="for answers")
    parser.add_argument("--smoke", action="store_true", help="one glove, nothing written: seconds")
    options = parser.parse_args(arguments)
    pin_blas_to_one_thread()
    if options.smoke:
        [glove, *_] = round_of_gloves(0)
        short = replace(glove, rate_hz=30.0, takes_per_wearing=3, take_s=20.0)
        print(ablation_page([(short, ablation_answer(short))], [], ""))
        return 0
    software = software_hash()
    finished = FinishedGloves(options.folder, PART, software)
    gloves = [glove for number in range(options.rounds) for glove in round_of_gloves(number)]
    until = float("inf") if options.minutes is None else time.monotonic() + 60 * options.minutes
    job = partial(ablation_answer, limits=IMPROVEMENT_LIMITS)
    rows = answers(gloves, job, finished, PART, options.workers, until)
    recorded = list(recorded_answers(options.recordings, finished))
    text = ablation_page(rows, recorded, software)
    print(text)
    if options.page:
        options.page.write_text(text, encoding="utf-8")
    return 0


def round_of_gloves(number: int) -> list[BlindGlove]:
    """One of each effect in an open and in a set-aside form, some with two effects, some with none and some
    with a cause outside the catalogue, in an order that has a little of everything at every moment."""
    return [glove for glove in _round(number) if glove is not None]


def _round(number: int) -> Iterator[BlindGlove | None]:
    outside, both = unknown_names(()), (False, True)
    more: list[BlindGlove | None] = [
        *(pair(PAIRS * number + at, LARGE_SIZE, set_aside=aside) for at in range(PAIRS) for aside in both),
        *(clean(number, linear=linear, part=PART) for linear in both),
        *(
            unknown(outside[at % len(outside)], LARGE_SIZE, 500 + at // len(outside))
            for at in range(UNKNOWN * number, UNKNOWN * (number + 1))
        ),
        *(_in_two_wearings(number, set_aside=aside) for aside in both),
        *(
            with_cause(PART, RECORDED_UNNAMED[number % 2], LARGE_SIZE, number, set_aside=aside)
            for aside in both
        ),
    ]
    for name in effect_names(()):
        for aside in both:
            yield with_cause(PART, name, JUDGED_SIZE, number, set_aside=aside)
        yield more.pop() if more else None
    yield from more


def _in_two_wearings(number: int, *, set_aside: bool) -> BlindGlove | None:
    """A cause that changes from take to take, in too few takes to decide it."""
    name = BETWEEN_TAKES[number % len(BETWEEN_TAKES)]
    found = with_cause(PART, name, LARGE_SIZE, 500 + number, set_aside=set_aside)
    return None if found is None else replace(found, wearings=2, takes_per_wearing=3, take_s=25.0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
