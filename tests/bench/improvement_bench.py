"""What ``improve`` and ``diagnose`` take: processor time, the part of it in the calling process, and how the
wall time falls with further processes.

    python tests/bench/improvement_bench.py [--quick] [--smoke] [--json FILE]

Processor time hardly depends on what else the computer does. Each run is an interpreter of its own, whose
imports count. *On paper* a run lasts as long as its calling process and an equal share of what its workers
do, which is what it would with a core for each. Results are held against each other to the last digit.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import resource
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

SIX = ("T_MCP", "I_MCP", "I_PIP", "M_MCP", "M_PIP", "R_MCP")
TEN = (*SIX, "T_IP", "R_PIP", "P_MCP", "P_PIP")
STRENGTH_DEG = 2.6
FOUR_TO_TWO = 0.6
"""Largest ratio of the time on paper of four processes to that of two."""


class Case(NamedTuple):
    """What is simulated, and what is done with it."""

    words: str
    plan: Mapping[str, Any]
    causes: Sequence[str]
    processes: Sequence[int] = (1, 2, 4)
    ceiling: bool = False
    layout: str | None = None
    """Whose gloves are diagnosed only."""


CASES = {
    "six": Case(
        "improve, 6 sensors, 60 Hz, 12 takes, 3 wearings, hysteresis, with the ceiling",
        {"seed": 11, "sensors": SIX},
        ("hysteresis",),
        ceiling=True,
    ),
    "ten": Case(
        "improve, 10 sensors, 100 Hz, 12 takes, 4 wearings, cross-coupling and creep",
        {"seed": 12, "sensors": TEN, "wearings": 4, "takes_per_wearing": 3, "rate_hz": 100.0},
        ("cross_coupling", "creep"),
    ),
    "glove": Case(
        "diagnose, 22 rotations, 18 sensors, 12 takes, hysteresis",
        {"seed": 13},
        ("hysteresis",),
        (1,),
        layout="cyberglove18",
    ),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="takes of 16 s in place of 32")
    parser.add_argument("--smoke", action="store_true", help="takes of 6 s, one and two processes")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--one", nargs=3, metavar=("CASE", "SECONDS", "PROCESSES"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        name, take_s, processes = options.one
        print(json.dumps(measured(CASES[name], float(take_s), int(processes))))
        return
    take_s = 6.0 if options.smoke else 16.0 if options.quick else 32.0
    figures = {name: of_case(name, take_s, most=2 if options.smoke else 4) for name in CASES}
    if options.json:
        options.json.write_text(json.dumps(figures, indent=1))


def of_case(name: str, take_s: float, most: int) -> dict[str, Any]:
    """Figures by the number of processes, told as they come."""
    case, found = CASES[name], {}
    print(f"{case.words}, {take_s:g} s each", flush=True)
    for processes in (count for count in case.processes if count <= most):
        run = [sys.executable, __file__, "--one", name, str(take_s), str(processes)]
        found[processes] = json.loads(subprocess.run(run, check=True, stdout=subprocess.PIPE).stdout)
        caller, workers, wall = (found[processes][key] for key in ("caller_s", "workers_s", "wall_s"))
        print(
            f"  processes {processes}: processor time {caller + workers:.1f} s, of it {caller:.1f} s in the"
            f" caller; wall time {wall:.1f} s; {', '.join(found[processes]['outcome']) or 'nothing'} named",
            flush=True,
        )
    figures: dict[str, Any] = {"case": case.words, "take_s": take_s, "processes": found}
    if len(found) > 1:
        figures["same"] = len({item["digest"] for item in found.values()}) == 1
        print(f"  {'same' if figures['same'] else 'NOT THE SAME'} to the last digit")
    if {2, 4} <= set(found):
        two, four = (found[count]["caller_s"] + found[count]["workers_s"] / count for count in (2, 4))
        figures["four_to_two"] = four / two
        met = "met" if four <= FOUR_TO_TWO * two else "MISSED"
        print(f"  four processes to two, on paper: {four / two:.2f} (at most {FOUR_TO_TWO}: {met})")
    return figures


def measured(case: Case, take_s: float, processes: int) -> dict[str, Any]:
    """Seconds of processor and wall time, what came out, and its digest."""
    from glovecal_models.worker_processes import pin_blas_to_one_thread

    pin_blas_to_one_thread()
    from glovecal_models.calibration.artifact import dump
    from glovecal_models.diagnosis.diagnose import diagnose
    from glovecal_models.improvement.improve import improve
    from glovecal_models.improvement.text import improved
    from glovecal_models.layout import Layout

    imported_s = time.process_time()
    from glovecal_models.simulation.causes.form import Cause
    from glovecal_models.simulation.session import record_session
    from glovecal_models.simulation.session_plan import SessionPlan

    choices = {"take_s": take_s, **case.plan}
    plan = SessionPlan.of_layout(case.layout, **choices) if case.layout else SessionPlan(**choices)
    takes = record_session(plan, [Cause(name, strength_deg=STRENGTH_DEG) for name in case.causes]).takes
    began_s, began_wall_s = time.process_time(), time.monotonic()
    if case.layout:
        naming = diagnose(takes, Layout.built_in(case.layout)).naming
        outcome, result = list(naming.confidence_set), repr(naming).encode()
    else:
        layout = Layout.from_columns("bench", plan.sensors, plan.rotations)
        found = improve(takes, layout, "bench", ceiling=case.ceiling, workers=processes)
        outcome = [step.added.effect for step in found.steps if step.added]
        result = b"".join([*map(dump, found.models), repr(improved(found)).encode()])
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return {
        "caller_s": imported_s + time.process_time() - began_s,
        "workers_s": children.ru_utime + children.ru_stime,
        "wall_s": time.monotonic() - began_wall_s,
        "outcome": outcome,
        "digest": hashlib.sha256(result).hexdigest(),
    }


if __name__ == "__main__":
    main()
