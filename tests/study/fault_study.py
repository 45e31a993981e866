"""``python3 do.py study faults``: faults at random against a service, captures and gloves, and what was lost.

Each round is a world of its own, disturbed by groups of faults that overlap; after each group the service has
to work again, and after all of them every frame and every acknowledged write is accounted for. The plan of a
round follows from its seed alone. It is drawn here and not by Hypothesis: a round takes a minute and its
processes never meet twice in the same order, so that shrinking a failure would take hours and call it flaky;
``--seed`` and ``--faults`` run the same plan again, shorter from its end.
"""

from __future__ import annotations

import argparse
import signal
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path

from fault_catalogue import catalogue_table
from fault_history import History, check, settle
from fault_kinds import KINDS, STUDY_PACE, SUITE_PACE, Fault, Pace, impossible, inflict, plan
from fault_world import World, eventually

WORKS_WITHIN_S = 60.0
FAULTS_A_ROUND = 30
MARKS = "<!-- the fault study's table begins -->", "<!-- the fault study's table ends -->"
CATALOGUE_MARKS = "<!-- the catalogue of faults begins -->", "<!-- the catalogue of faults ends -->"


@dataclass
class Results:
    """Of all rounds."""

    times: Counter[str] = field(default_factory=Counter)
    worst_s: defaultdict[str, float] = field(default_factory=lambda: defaultdict(float))
    """From a fault's end until all worked again, by kind; other faults may have gone on meanwhile."""
    violations: list[str] = field(default_factory=list)
    violated: Counter[str] = field(default_factory=Counter)
    """Violations in rounds in which a kind was drawn."""
    histories: list[History] = field(default_factory=list)
    without: dict[str, str] = field(default_factory=dict)


def run_round(seed: int, faults: int, pace: Pace, results: Results, say: Callable[[str], None]) -> None:
    """One world and its plan; what is found is added to ``results``."""
    began = time.monotonic()
    violations: list[str] = []
    with tempfile.TemporaryDirectory(prefix="glovecal-faults-") as folder:
        with World(Path(folder), seed) as world:
            results.without = impossible(world)
            groups = plan(seed, faults, pace, tuple(results.without))
            say(f"seed {seed}: {faults} faults in {len(groups)} groups, all runs after {_since(began)}")
            number = 0
            for group in groups:
                over = inflict(world, group)
                last_ns = max(over.values())
                try:
                    eventually(
                        lambda since_ns=last_ns: not world.broken(since_ns), "it works", WORKS_WITHIN_S
                    )
                except TimeoutError:
                    broken = ", ".join(world.broken(last_ns))
                    violations.append(
                        f"does not work again within {WORKS_WITHIN_S:g} s of fault {number + 1}: {broken}"
                    )
                worked_s = time.monotonic_ns() / 1e9
                for fault in group:
                    number += 1
                    recovery_s = worked_s - over[fault] / 1e9
                    results.times[fault.kind] += 1
                    results.worst_s[fault.kind] = max(results.worst_s[fault.kind], recovery_s)
                    say(f"{number:4} {fault}: all works {recovery_s:.1f} s later")
                if violations:
                    break
            world.stop_recording()
            history = check(world, settle(world))
        violations += history.violations
        results.histories.append(history)
        if violations:
            _tell(violations, seed, faults, groups, say)
            for name in {fault.kind for group in groups for fault in group}:
                results.violated[name] += len(violations)
    results.violations += [f"seed {seed}: {violation}" for violation in violations]
    say(
        f"seed {seed}: {history.frames} frames sent, {history.takes} takes of {history.frames_in_takes} "
        f"frames compared with their logs ({history.missing} told missing, {history.nothing_recorded} told "
        f"that nothing was recorded), {history.writes} acknowledged writes; settled in "
        f"{history.settled_s:.1f} s, {len(violations)} violations, {_since(began)}"
    )


def _since(began: float) -> str:
    return f"{time.monotonic() - began:.0f} s"


def _tell(
    violations: Sequence[str],
    seed: int,
    faults: int,
    groups: Sequence[Sequence[Fault]],
    say: Callable[[str], None],
) -> None:
    for violation in violations:
        say(f"VIOLATION {violation}")
    say(f"  again: python3 do.py study faults --seed {seed} --faults {faults}; the steps:")
    for number, group in enumerate(groups, 1):
        say(f"  group {number}: " + "; ".join(map(str, group)))


def table(results: Results) -> str:
    """By kind, as Markdown."""
    lines = [
        "| fault | how often | all works again, at worst, s | violations in its rounds |",
        "|---|---|---|---|",
    ]
    for name in KINDS:
        worst = f"{results.worst_s[name]:.1f}" if results.times[name] else ""
        lines.append(f"| {name} | {results.times[name]} | {worst} | {results.violated[name]} |")
    sums = results.histories
    frames, takes = sum(each.frames for each in sums), sum(each.takes for each in sums)
    lines += [
        "",
        f"{results.times.total()} faults in {len(sums)} rounds, {frames} frames sent, {takes} takes told "
        f"complete with {sum(each.frames_in_takes for each in sums)} frames, "
        f"{sum(each.missing for each in sums)} told missing, {sum(each.writes for each in sums)} "
        f"acknowledged writes; {len(results.violations)} violations.",
    ]
    lines += [f"{name}: {sentence}." for name, sentence in results.without.items()]
    return "\n".join(lines)


def put(page: Path, marks: tuple[str, str], text: str) -> None:
    """Between its marks. Raises ValueError where the page has none."""
    begin, end = marks
    before, _, rest = page.read_text(encoding="utf-8").partition(begin)
    _, found, after = rest.partition(end)
    if not found:
        raise ValueError(f"{page} has no lines {begin} and {end}")
    page.write_text(f"{before}{begin}\n{text}\n{end}{after}", encoding="utf-8")


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="do.py study faults", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument(
        "--faults", type=int, default=FAULTS_A_ROUND, help="how many (default: one round of 30)"
    )
    parser.add_argument("--seed", type=int, default=1, help="of the first round (default: 1)")
    parser.add_argument("--minutes", type=float, help="go on with further rounds for so long")
    parser.add_argument("--page", type=Path, help="put what is printed between its marks in this page")
    parser.add_argument("--table", action="store_true", help="print the catalogue of faults, and run nothing")
    parser.add_argument("--smoke", action="store_true", help="one fault: seconds")
    options = parser.parse_args(arguments)
    if options.table:
        print(catalogue_table())
        if options.page:
            put(options.page, CATALOGUE_MARKS, catalogue_table())
        return 0
    if sys.platform != "linux":
        print(
            "study faults: it needs Linux (processes are found by their ports, gloves are emulated on ptys)"
        )
        return 1
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    results, seed = Results(), options.seed
    until = None if options.minutes is None else time.monotonic() + 60.0 * options.minutes
    left = 1 if options.smoke else options.faults
    pace = SUITE_PACE if options.smoke else STUDY_PACE
    try:
        while left > 0 if until is None else time.monotonic() < until:
            now = FAULTS_A_ROUND if until is not None else min(left, FAULTS_A_ROUND)
            run_round(seed, now, pace, results, lambda line: print(line, flush=True))
            left, seed = left - now, seed + 1
    finally:
        text = f"{table(results)}\n\nRun on {date.today().isoformat()}, seeds {options.seed} to {seed - 1}."
        print(f"\n{text}")
    if options.page:
        put(options.page, MARKS, text)
    return 1 if results.violations else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
