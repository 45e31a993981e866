"""How good the automatic choice of a kernel is, on takes that had no part in anything.

    python tests/bench/kernel_choice_study.py {flex|sleeve|cyberglove|gait|ankle|thumb|static} [--seeds 10 11]

Each rotation's kernel is chosen on the training takes; every candidate is then trained on all of them and
measured on takes left out. A table of errors (degrees), and how often the choice is the best or within 5 %
of the best. The real recordings are looked for in ../shared/data.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from unknown_sensors import (
    LAYOUT,
    LINEAR_GLOVE,
    POLYNOMIAL_GLOVE,
    SLEEVE,
    UNKNOWN_GLOVE,
    flex_takes,
    sleeve_takes,
)

from glovecal_models.calibration.kernel_choice import score_candidates
from glovecal_models.calibration.sample_weight import Recorded, fit_weighted
from glovecal_models.calibration.samples import gather_samples, representative_index
from glovecal_models.errors import NotTrainable
from glovecal_models.layout import Correspondence, Layout
from glovecal_models.regression.kernel_candidates import CANDIDATES
from glovecal_models.regression.kernel_scores import KernelScores
from glovecal_models.simulation.protocol import evaluation_segment, free_segment, sampling_protocol
from glovecal_models.simulation.simulated_glove import SimulatedGlove, simulate_take
from glovecal_models.takes.clock_scan import aligned, clock_offsets
from glovecal_models.takes.table import read_takes
from glovecal_models.takes.take import Take
from glovecal_models.worker_processes import pin_blas_to_one_thread

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
SAMPLES = 1000
Split = tuple[str, Layout, Sequence[str], list[Take], list[Take]]
"""Name, layout, rotations, training takes, takes left out of everything."""


def flex(seeds: Sequence[int]) -> Iterator[Split]:
    gloves = {"linear": LINEAR_GLOVE, "polynomial": POLYNOMIAL_GLOVE, "unknown": UNKNOWN_GLOVE}
    for name, responses in gloves.items():
        for seed in seeds:
            for takes, frames in ((4, 60), (8, 150)):
                product = 0.0 if name == "linear" else 1.0
                every = flex_takes(responses, seed, takes + 6, frames, product=product)
                label = f"{name} {takes}x{frames} seed {seed}"
                yield label, LAYOUT, LAYOUT.rotations, every[:takes], every[takes:]


def sleeve(seeds: Sequence[int]) -> Iterator[Split]:
    for seed in seeds:
        for takes, frames in ((4, 50), (6, 80)):
            every = sleeve_takes(seed, takes + 6, frames)
            label = f"sleeve {takes}x{frames} seed {seed}"
            yield label, SLEEVE, SLEEVE.rotations, every[:takes], every[takes:]


def cyberglove(seeds: Sequence[int]) -> Iterator[Split]:
    for seed in seeds:
        glove = SimulatedGlove(seed)
        segments = sampling_protocol(seed)
        training = [
            simulate_take(glove, part, seed=100 * seed + k, rate_hz=60).take
            for k, part in enumerate(segments)
        ]
        tests = [evaluation_segment(seed + 7), free_segment(seed + 7)]
        left_out = [simulate_take(glove, part, seed=900 + seed, rate_hz=30).take for part in tests]
        yield f"cyberglove seed {seed}", glove.layout, training[0].rotations, training, left_out


def thirds(name: str, layout: Layout, rotations: Sequence[str], takes: list[Take]) -> Iterator[Split]:
    """Every third take left out, beginning with the first, the second, the third."""
    for start in range(3):
        rest = [take for number, take in enumerate(takes) if number % 3 != start]
        yield f"{name} without {start + 1}", layout, rotations, rest, takes[start::3]


def gait(seeds: Sequence[int]) -> Iterator[Split]:
    for person in ("P002", "P003"):
        for side in "LR":
            files = sorted((DATA / "gait").glob(f"{person}-*-{side}-*.csv"))
            takes = [take for path in files for take in read_takes(path)]
            layout = Layout.from_columns("gait", takes[0].sensors, takes[0].rotations)
            yield from thirds(f"gait {person} {side}", layout, layout.rotations, takes)


def ankle(seeds: Sequence[int]) -> Iterator[Split]:
    """Three placements of four motions each, clocks aligned."""
    for person in ("P300", "P301", "P302", "P303", "P304"):
        takes = [
            t for path in sorted((DATA / "ankle").glob(f"{person}-*.frames.csv")) for t in read_takes(path)
        ]
        takes = [aligned(t, found.offset_s) for t, found in zip(takes, clock_offsets(takes), strict=True)]
        layout = Layout.from_columns("ankle", takes[0].sensors, takes[0].rotations)
        yield from thirds(f"ankle {person}", layout, layout.rotations, takes)


def thumb(seeds: Sequence[int]) -> Iterator[Split]:
    layout = Layout.from_toml(
        'name = "thumb"\nsensors = ["G00", "G01", "G02", "G03"]\n[rotations]\n'
        + "\n".join(f'{name} = ["G00", "G01", "G02", "G03"]' for name in ("A12", "A13", "A14", "A15"))
    )
    for path in sorted((DATA / "cyberglove-robot-thumb").glob("*.csv")):
        take = read_takes(path)[0]
        frames = len(take.time_s)
        parts = [piece(take, k * frames // 9, (k + 1) * frames // 9) for k in range(9)]
        yield from thirds(f"thumb {path.stem}", layout, layout.rotations, parts)


def static(seeds: Sequence[int]) -> Iterator[Split]:
    """A flex sensor at ten known angles, 500 readings each: angles that were left out are foretold."""
    take = read_takes(next((DATA / "flex-static").glob("*.csv")))[0]
    angle = take.reference[:, 0]
    ends = np.flatnonzero(np.diff(angle)) + 1
    parts = [
        piece(take, start, end)
        for start, end in zip([0, *ends.tolist()], [*ends.tolist(), len(angle)], strict=True)
    ]
    layout = Layout.from_columns("static", take.sensors, take.rotations)
    yield from thirds("static", layout, layout.rotations, parts)


def piece(take: Take, start: int, end: int) -> Take:
    rows = slice(start, end)
    times = take.time_s[rows]
    at = np.searchsorted(take.reference_time_s, times)
    return replace(
        take, name=f"{take.name}-{start}", time_s=times, readings=take.readings[rows],
        reference_time_s=take.reference_time_s[at], reference=take.reference[at], context={}, poses=None,
    )  # fmt: skip


Row = tuple[str, KernelScores, dict[str, float], float]
"""Name and rotation, what the choice saw, errors on what it did not see (degrees), seconds."""


def study(split: Split) -> Iterator[Row]:
    name, layout, rotations, training, left_out = split
    for rotation in rotations:
        correspondence = layout.correspondence(rotation)
        recorded, new = samples_of(training, correspondence), samples_of(left_out, correspondence, 10**9)
        try:
            start = time.perf_counter()
            base = fit_weighted(recorded)
            tried = score_candidates(recorded, CANDIDATES, sample_weight=base.weight)
            seconds = time.perf_counter() - start
        except NotTrainable as error:
            print(f"{name} {rotation}: {error}")
            continue
        errors = {}
        for candidate in CANDIDATES:
            if candidate.name not in tried.optimum:
                continue
            search = (
                {"start": tried.optimum[candidate.name], "iterations": 15}
                if candidate != CANDIDATES[0]
                else {}
            )
            fitted = candidate.fit(recorded.inputs, recorded.target, sample_weight=base.weight, **search)
            error = fitted.predict(new.inputs).mean - new.target
            errors[candidate.name] = float(np.sqrt(np.mean(error**2)))
        yield f"{name} {rotation}", tried.scores, errors, seconds


def samples_of(takes: Sequence[Take], correspondence: Correspondence, most: int = SAMPLES) -> Recorded:
    found = gather_samples(takes, correspondence)
    index = representative_index(found, most)
    return Recorded(found.inputs[index], found.target[index], found.take[index], index)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", nargs="+", choices=list(SPLITS))
    parser.add_argument("--seeds", type=int, nargs="+", default=[10, 11], help="of simulated gloves")
    wanted = parser.parse_args()
    pin_blas_to_one_thread()
    rows = []
    print("errors on takes left out of everything, degrees; * chosen")
    for what in wanted.what:
        for split in SPLITS[what](wanted.seeds):
            for row in study(split):
                rows.append(row)
                print(shown(row), flush=True)
    summary(rows)


def shown(row: Row) -> str:
    """One line; in brackets evidence over the first candidate's in nats, and the error the choice saw."""
    label, scores, errors, seconds = row
    cells = []
    for item in scores.scores:
        mark = "*" if item is scores.chosen else ""
        saw = np.nan if item.held_out_rmse_deg is None else item.held_out_rmse_deg
        gain = scores.evidence_gain(item)
        cells.append(f"{item.name} {errors[item.name]:.2f}{mark} ({gain:+.0f}, {saw:.2f})")
    return f"{label} {seconds:.1f} s: " + ", ".join(cells)


def summary(rows: Sequence[Row]) -> None:
    names = [item.name for item in CANDIDATES]
    ratio = []
    for name in ("choice", *names):
        each = [
            (errors[scores.chosen.name if name == "choice" else name], min(errors.values()))
            for _, scores, errors, _ in rows
        ]
        near = np.mean([mine <= 1.05 * best for mine, best in each])
        excess = np.exp(np.mean([np.log(mine / best) for mine, best in each]))
        print(
            f"{name:20s} within 5 % of the best in {near:4.0%} of {len(each)}, on average {excess:.3f} of it"
        )
    ratio = [errors[scores.chosen.name] / errors[names[0]] for _, scores, errors, _ in rows]
    moved = [
        value for value, (_, scores, _, _) in zip(ratio, rows, strict=True) if scores.chosen.name != names[0]
    ]
    print(f"another than {names[0]} in {len(moved)}; its error over that of {names[0]}: {np.round(moved, 2)}")


SPLITS = {
    "flex": flex,
    "sleeve": sleeve,
    "cyberglove": cyberglove,
    "gait": gait,
    "ankle": ankle,
    "thumb": thumb,
    "static": static,
}

if __name__ == "__main__":
    main()
