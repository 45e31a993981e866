"""``python3 do.py study planted``: are faults that need no statistics over takes told in 20 s of readings?

Faults are planted into the readings and references of real recordings: ankle sleeves (four slow motions of 5
to 10 s in one placement) and gait (ten strides of one side). The same recordings untouched, and simulated
healthy gloves of six short takes (``--healthy``), are the control. The recordings are no part of the project:
without them only simulated gloves are asked.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from intervals import clopper_pearson
from planted_faults import FAULTS, FIRST_HEALTHY, UNTOUCHED, Marked, Session, marked, sessions

from glovecal_models.worker_processes import pin_blas_to_one_thread, work_off

HEAD = (
    "| planted | found | 95 % interval | false word | 95 % interval | called otherwise |\n" + "|---" * 6 + "|"
)


def row_of(fault: str, found: Sequence[Marked]) -> str:
    """Counts with exact intervals."""
    cells = [fault]
    for count in (sum(each.found for each in found), sum(bool(each.false) for each in found)):
        low, high = clopper_pearson(count, len(found))
        share = f"{count} of {len(found)}", f"{100 * low:.1f} to {100 * high:.1f} %"
        cells += ("", "") if fault.startswith((UNTOUCHED, "simulated")) and len(cells) == 1 else share
    cells.append(str(sum(bool(each.other) for each in found)))
    return f"| {' | '.join(cells)} |"


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="do.py study planted", description=(__doc__ or "").partition("\n")[0]
    )
    times = "of each fault in each recording (default 4)"
    parser.add_argument("--each", type=int, default=4, metavar="N", help=times)
    parser.add_argument("--only", default="", metavar="TEXT", help="faults whose name begins so")
    which = "recordings that constants were chosen on, those kept apart, or all (default all)"
    parser.add_argument("--recordings", choices=("tuned", "apart", "all"), default="all", help=which)
    gloves = f"simulated healthy gloves, from number {FIRST_HEALTHY} on (default none)"
    parser.add_argument("--healthy", type=int, default=0, metavar="N", help=gloves)
    parser.add_argument("--workers", type=int, default=2, help="processes (default 2)")
    parser.add_argument("--smoke", action="store_true", help="one simulated glove")
    options = parser.parse_args(arguments)
    pin_blas_to_one_thread()
    chosen = [
        session
        for session in (() if options.smoke else sessions())
        if options.recordings == "all" or session.is_tuned == (options.recordings == "tuned")
    ]
    faults = [name for name in FAULTS if name.startswith(options.only)]
    jobs: list[tuple[Session, str, int] | int] = [(session, UNTOUCHED, 0) for session in chosen]
    jobs += [
        (session, fault, number) for fault in faults for session in chosen for number in range(options.each)
    ]
    jobs += range(FIRST_HEALTHY, FIRST_HEALTHY + (1 if options.smoke else options.healthy))
    found: list[Marked | None] = [None] * len(jobs)

    def keep(number: int, each: Marked) -> None:
        found[number] = each
        if each.false or each.other or (each.fault in FAULTS and not each.found):
            print(each, file=sys.stderr, flush=True)

    work_off(marked, iter(jobs), options.workers, keep, "planted")
    done = [each for each in found if each is not None]
    print(HEAD)
    for fault in (UNTOUCHED, *faults):
        mine = [each for each in done if each.fault == fault and not each.session.startswith("simulated")]
        if mine:
            print(row_of(fault, mine))
    if simulated := [each for each in done if each.session.startswith("simulated")]:
        print(row_of("simulated, healthy", simulated))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
