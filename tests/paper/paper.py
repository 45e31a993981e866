"""``python3 do.py paper``: Wang & Neff 2013 on the simulated glove, each table and figure beside the paper's.

Writes one HTML page that needs nothing else, and keeps each part's figures as JSON: a part is not computed
twice by the same programs unless ``--again`` asks for it, and an interrupted run goes on.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from kept_results import KeptResults, programs_hash
from paper_job import PaperJob, PaperResult
from paper_machine import commit
from paper_page.page import paper_page
from paper_parts import PARTS
from paper_workers import work_off

WORKERS = 2
SMOKE_PART = "table-1"


def main(arguments: Sequence[str]) -> int:
    options = _parser().parse_args(arguments)
    if options.smoke:
        with TemporaryDirectory(prefix="glovecal-paper-") as folder:
            return main(["--part", SMOKE_PART, "--quick", "--workers", "1", "--folder", folder])
    unknown = [name for name in options.part or () if name not in PARTS]
    if unknown:
        _parser().error(f"there is no part {unknown[0]!r}; there are {', '.join(PARTS)}")
    if options.seed < 0 or options.workers < 1:
        _parser().error(f"seed {options.seed} and {options.workers} workers: at least 0 and 1 are possible")
    wanted = options.part or [name for name, part in PARTS.items() if not part.asked_for]
    kept = KeptResults(options.folder, programs_hash())
    try:
        failed = compute(wanted, kept, options.seed, options.quick, options.again, options.workers)
    except KeyboardInterrupt:
        print("\nstopped; the same command goes on with what is finished", file=sys.stderr)
        return 130
    page = options.folder / f"paper{'-quick' if options.quick else ''}.html"
    found = results(kept, options.seed, options.quick)
    page.write_text(
        paper_page(found, date=time.strftime("%Y-%m-%d %H:%M"), commit=commit()), encoding="utf-8"
    )
    print(f"written: {page}")
    return 1 if failed else 0


def compute(
    parts: Sequence[str], kept: KeptResults, seed: int, quick: bool, again: bool, workers: int
) -> list[str]:
    """The jobs of ``parts`` that are not kept yet; the names of those that failed."""
    jobs = _jobs(parts)
    waiting = [job for job in jobs if again or kept.get(job.name, seed, quick) is None]
    if len(waiting) < len(jobs):
        print(f"{len(jobs) - len(waiting)} of {len(jobs)} are known; --again computes them anew")
    waiting.sort(key=lambda job: -job.weight)
    return work_off(waiting, seed, quick, workers, kept.keep)


def results(kept: KeptResults, seed: int, quick: bool) -> dict[str, PaperResult]:
    """What is known by the name of the job, computed now or before."""
    known = {job.name: kept.get(job.name, seed, quick) for job in _jobs(list(PARTS))}
    return {name: result for name, result in known.items() if result is not None}


def _jobs(parts: Sequence[str]) -> list[PaperJob]:
    """Each once, though parts share them."""
    return list({job.name: job for part in parts for job in PARTS[part].jobs}.values())


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="do.py paper", description=(__doc__ or "").partition("\n")[0])
    named = f"one part, may be repeated: {', '.join(PARTS)}; default: all but colour-glove"
    parser.add_argument("--part", action="append", metavar="NAME", help=named)
    parser.add_argument("--quick", action="store_true", help="few samples: to see that it works")
    smoke = f"{SMOKE_PART} with few samples, in a temporary folder: seconds"
    parser.add_argument("--smoke", action="store_true", help=smoke)
    parser.add_argument("--again", action="store_true", help="compute anew what is known")
    parser.add_argument("--seed", type=int, default=1, help="of the simulated person and glove (default 1)")
    parser.add_argument("--workers", type=int, default=WORKERS, help="processes (default 2)")
    parser.add_argument("--folder", type=Path, default=Path(".paper"), help="for figures and page")
    return parser


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
