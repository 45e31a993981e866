"""Gaussian-process bench: training and prediction beside scikit-learn, GPy, GPBoost and GPyTorch, in one run.

    python tests/bench/gaussian_process_bench.py [--quick] [--json FILE] [--picture FILE]

One BLAS thread everywhere. Training is counted in CPU seconds of the process, prediction in wall time
(median). Every contestant's hyperparameters are judged by one dense likelihood
(``gaussian_process_reference``).
What is not installed is reported as such. ``--quick`` uses 800 frames instead of 2000.
"""

# ruff: noqa: E402  the environment must be set before numpy is imported

from __future__ import annotations

import os

for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_variable] = "1"

import argparse
import importlib
import json
import statistics
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import gaussian_process_peer_glovecal as ours
import numpy as np
from gaussian_process_data import MISSING_INPUT, OUTPUTS, Joint, one_joint, whole_glove
from gaussian_process_reference import Trained, exact_nlml

from glovecal_models.regression.training_samples import standardise
from glovecal_models.worker_processes import pin_blas_to_one_thread

PEERS = {
    "GPBoost": "gaussian_process_peer_gpboost",
    "GPy": "gaussian_process_peer_gpy",
    "scikit-learn": "gaussian_process_peer_sklearn",
    "GPyTorch": "gaussian_process_peer_gpytorch",
}
GPYTORCH = Path(__file__).resolve().parents[2] / ".tools" / "gpytorch"
"""Where ``do.py bench`` installs it."""
SPARSE_ITERATIONS = 200


def main(arguments: Iterable[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description="Gaussian-process bench beside other libraries")
    parser.add_argument("--quick", action="store_true", help="800 frames instead of 2000, under 90 s")
    parser.add_argument("--json", type=Path, help="write all figures here")
    parser.add_argument("--picture", type=Path, default=Path("gaussian-process-bench.png"))
    parser.add_argument("--smoke", action="store_true", help="150 frames, beside scikit-learn alone: seconds")
    options = parser.parse_args(None if arguments is None else list(arguments))
    pin_blas_to_one_thread()
    frames = 150 if options.smoke else 800 if options.quick else 2000
    peers = _installed(("scikit-learn",) if options.smoke else tuple(PEERS))
    result: dict[str, Any] = {"frames": frames, "peers": {n: _version(m) for n, m in peers.items()}}
    result["one_joint"] = _one_joint(frames, peers, options.quick)
    result["sparse"] = _sparse(frames, peers)
    result["whole_glove"], fitted = _whole_glove(frames, peers, result["one_joint"])
    result["one_frame"] = _one_frame(frames, peers, fitted)
    if options.json:
        options.json.write_text(json.dumps(result, indent=1))
    _draw(result, options.picture)
    return 0


def _installed(wanted: tuple[str, ...]) -> dict[str, ModuleType | None]:
    """By peer; None for what is not ``wanted`` or not there."""
    sys.path.append(str(GPYTORCH))  # last: what the lock file names goes first
    found: dict[str, ModuleType | None] = {}
    for name, module in PEERS.items():
        if name not in wanted:
            found[name] = None
            continue
        try:
            found[name] = importlib.import_module(module)
        except (ImportError, OSError) as error:
            print(f"{name}: not installed ({error})")
            found[name] = None
    pin_blas_to_one_thread()
    return found


def _version(module: ModuleType | None) -> str:
    return "not used" if module is None else str(module.VERSION)


def _one_joint(frames: int, peers: dict[str, ModuleType | None], quick: bool) -> list[dict[str, Any]]:
    joint = one_joint(frames)
    x, y = _units(joint)
    print(f"\nOne cross-coupled joint, N = {len(y)}, D = {x.shape[1]}, 8-bit sensors, 1 degree noise")
    repeats = [ours.train(joint.inputs, joint.target)[0] for _ in range(3)]
    runs = []
    for name, module in peers.items():
        for train in _exact_trainings(name, module, quick):
            runs.append(train(x, y))
            print(f"  {runs[-1].who}: {runs[-1].cpu_s:.2f} s", file=sys.stderr)
            repeats += [ours.train(joint.inputs, joint.target)[0] for _ in range(3)]
    middle = statistics.median(run.cpu_s for run in repeats)
    runs.insert(0, replace(repeats[0], cpu_s=middle))
    print(f"  Glovecal: median of {len(repeats)} trainings, taken before, between and after the peers'")
    rows = [_judged(run, x, y) for run in runs]
    best = min(row["nlml"] for row in rows)
    for row in rows:
        row["above_best"] = row["nlml"] - best
        row["times_ours"] = row["cpu_s"] / middle
    _table(rows, ("who", "cpu_s", "times_ours", "nlml", "above_best", "note"))
    return rows


def _exact_trainings(
    name: str, module: ModuleType | None, quick: bool
) -> list[Callable[[np.ndarray, np.ndarray], Trained]]:
    """Full trainings of one joint by a peer; GPyTorch is stopped, because its search goes on for minutes."""
    if module is None:
        return []
    if name == "GPBoost":
        return [
            lambda x, y: module.train(x, y, approximation="fitc")[0],
            lambda x, y: module.train(x, y, approximation="none")[0],
        ]
    if name == "GPyTorch":
        return [lambda x, y: module.train_exact(x, y, 40 if quick else 30)]
    if name == "scikit-learn":
        return [lambda x, y: module.train(x, y)[0]]
    return [module.train_exact]


def _sparse(frames: int, peers: dict[str, ModuleType | None]) -> list[dict[str, Any]]:
    joint = one_joint(frames)
    x, y = _units(joint)
    print(f"\nSPGP as in the paper: M = 100, pseudo-inputs moved, at most {SPARSE_ITERATIONS} iterations")
    runs = [ours.train_spgp(joint.inputs, joint.target, SPARSE_ITERATIONS)]
    if peers["GPy"] is not None:
        runs.append(peers["GPy"].train_fitc(x, y, SPARSE_ITERATIONS))
    rows: list[dict[str, Any]] = [
        {
            "who": run.who,
            "cpu_s": run.cpu_s,
            "evaluations": run.evaluations,
            "ms_per_evaluation": 1e3 * run.cpu_s / run.evaluations if run.evaluations else None,
            "objective": run.own_objective,
        }
        for run in runs
    ]
    for row in rows:
        row["times_ours"] = row["cpu_s"] / rows[0]["cpu_s"]
    _table(rows, ("who", "cpu_s", "times_ours", "evaluations", "ms_per_evaluation", "objective"))
    print("  Glovecal starts at the LMC-GPR optimum (its training counted) and ends when nothing is gained.")
    return rows


def _whole_glove(
    frames: int, peers: dict[str, ModuleType | None], single: list[dict[str, Any]]
) -> tuple[dict[str, Any], dict[str, Any]]:
    glove = whole_glove(frames)
    print(f"\nWhole glove: {len(glove)} rotations; {', '.join(MISSING_INPUT)} miss an input by construction")
    rows, fitted = [], {}
    for name, joint in glove.items():
        x, y = _units(joint)
        trained, fitted[name] = ours.train(joint.inputs, joint.target)
        row: dict[str, Any] = {"rotation": name, "D": x.shape[1], "cpu_s": trained.cpu_s}
        row["nlml"] = _judged(trained, x, y)["nlml"]
        row["missing_input_suspected"] = trained.facts["missing_input_suspected"]
        if peers["GPBoost"] is not None:
            peer, _ = peers["GPBoost"].train(x, y, approximation="fitc")
            row["gpboost_fitc_cpu_s"], row["gpboost_fitc_nlml"] = peer.cpu_s, _judged(peer, x, y)["nlml"]
            row["ours_minus_gpboost"] = row["nlml"] - row["gpboost_fitc_nlml"]
        rows.append(row)
    _table(rows, tuple(rows[0]))
    total = sum(row["cpu_s"] for row in rows)
    summary: dict[str, Any] = {"rows": rows, "cpu_s": total}
    print(f"  Glovecal, all rotations: {total:.2f} s on one core")
    if peers["GPBoost"] is not None:
        fitc = sum(row["gpboost_fitc_cpu_s"] for row in rows)
        summary |= {"gpboost_fitc_cpu_s": fitc, "gpboost_fitc_times_ours": fitc / total}
        summary["worst_against_gpboost"] = max(row["ours_minus_gpboost"] for row in rows)
        print(f"  GPBoost FITC, measured: {fitc:.1f} s, {fitc / total:.1f} x; "
              f"our NLML minus theirs at worst {summary['worst_against_gpboost']:+.4f}")  # fmt: skip
    summary["exact_peers"] = _scaled_exact_peers(glove, peers, single, total)
    return summary, fitted


def _scaled_exact_peers(
    glove: dict[str, Joint], peers: dict[str, ModuleType | None], single: list[dict[str, Any]], ours_s: float
) -> list[dict[str, Any]]:
    """Whole-glove time of exact peers from a sample: one rotation of D = 1, the joint of D = 3 for others.

    Peers whose D = 1 rotation is not measured (it takes a minute) are left out.
    """
    sample = "I_MCP"
    x, y = _units(glove[sample])
    ones = sum(joint.inputs.shape[1] == 1 for joint in glove.values())
    trainings: dict[str, Callable[[], Trained]] = {}
    if peers["GPBoost"] is not None:
        boost = peers["GPBoost"]
        trainings["GPBoost exact"] = lambda: boost.train(x, y, approximation="none")[0]
    if peers["GPy"] is not None:
        trainings["GPy exact"] = lambda gpy=peers["GPy"]: gpy.train_exact(x, y)
    rows = []
    for row in single:
        if row["who"] in trainings:
            one = trainings[row["who"]]().cpu_s
            estimate = ones * one + (len(glove) - ones) * row["cpu_s"]
            rows.append({"who": row["who"], "cpu_s": estimate, "times_ours": estimate / ours_s})
            sum_of = f"{ones} x {sample} ({one:.1f} s) + {len(glove) - ones} x the joint above"
            print(f"  {row['who']}, estimated: {sum_of} = {estimate:.0f} s, {estimate / ours_s:.0f} x")
    return rows


def _one_frame(
    frames: int, peers: dict[str, ModuleType | None], fitted: dict[str, Any]
) -> list[dict[str, Any]]:
    joint = one_joint(frames)
    x, y = _units(joint)
    count = len(OUTPUTS)
    print(f"\nOne frame, whole glove: {count} rotations, D = 3, 100 nodes each, mean and variance, wall time")
    regressor = ours.hundred_node_regressor(joint.inputs, joint.target)
    same = ours.predictor(dict.fromkeys(OUTPUTS, regressor), dict.fromkeys(OUTPUTS, OUTPUTS[joint.name]))
    calls: list[tuple[str, Callable[[], object], int]] = [
        ("Glovecal, 22 x 100 nodes", _frame_call(same, joint.inputs), 2000)
    ]
    plain = {name: item for name, item in fitted.items() if not item.evidence["missing_input_suspected"]}
    trained = ours.predictor(plain, OUTPUTS)
    calls.append((f"Glovecal, {len(plain)} well-posed as trained", _trained_call(trained), 2000))
    calls.append(
        (f"Glovecal, all {count} as trained", _trained_call(ours.whole_glove_predictor(fitted)), 200)
    )
    unit = joint.target.std() ** 2
    given = ours.hyperparameters(fitted[joint.name])
    assert np.isclose(unit, fitted[joint.name].evidence["target_scale_deg"] ** 2)
    if peers["GPy"] is not None:
        calls.append(
            (
                "GPy FITC, 22 x 100",
                peers["GPy"].glove_frame_predictor(x, y, regressor.nodes, given, count),
                50,
            )
        )
    if peers["GPyTorch"] is not None:
        predict = peers["GPyTorch"].glove_frame_predictor(x, y, regressor.nodes, given, count)
        calls.append(("GPyTorch SGPR, 22 x 100", predict, 20))
    if peers["scikit-learn"] is not None:
        few = min(400, len(y))
        _, model = peers["scikit-learn"].train(x[:few], y[:few])
        predict = peers["scikit-learn"].glove_frame_predictor(model, x, count)
        calls.append((f"scikit-learn exact, 22 x {few} samples", predict, 20))
    if peers["GPBoost"] is not None:
        _, model = peers["GPBoost"].train(x, y, approximation="fitc")
        single = peers["GPBoost"].frame_predictor(model, x)
        calls.append(("GPBoost FITC, 1 x 100, times 22", single, 5))
    rows = []
    for who, call, repeats in calls:
        median, slow = _latency(call, repeats)
        factor = count if who.endswith("times 22") else 1
        rows.append({"who": who, "median_ms": 1e3 * median * factor, "p99_ms": 1e3 * slow * factor})
    for row in rows:
        row["times_ours"] = row["median_ms"] / rows[0]["median_ms"]
    _table(rows, ("who", "median_ms", "p99_ms", "times_ours"))
    return rows


def _frame_call(predictor: Any, inputs: np.ndarray) -> Callable[[], object]:
    frame = inputs[:1].copy()
    return lambda: predictor.predict(frame)


def _trained_call(predictor: Any) -> Callable[[], object]:
    frame = np.full((1, len(predictor.sensors)), 128.0)
    return lambda: predictor.predict(frame)


def _latency(call: Callable[[], object], repeats: int) -> tuple[float, float]:
    for _ in range(3):
        call()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return statistics.median(times), float(np.quantile(times, 0.99))


def _units(joint: Joint) -> tuple[np.ndarray, np.ndarray]:
    standard = standardise(joint.inputs, joint.target)
    return standard.x, standard.y


def _judged(run: Trained, x: np.ndarray, y: np.ndarray) -> dict[str, Any]:
    assert run.hyperparameters is not None
    nlml = exact_nlml(x, y, run.hyperparameters)
    return {"who": run.who, "cpu_s": run.cpu_s, "nlml": nlml, "own": run.own_objective, "note": run.note}


def _table(rows: list[dict[str, Any]], columns: tuple[str, ...]) -> None:
    cells = [[_text(row.get(column)) for column in columns] for row in rows]
    widths = [max(len(column), *(len(line[i]) for line in cells)) for i, column in enumerate(columns)]
    for line in [list(columns), *cells]:
        print("  " + "  ".join(text.ljust(width) for text, width in zip(line, widths, strict=True)).rstrip())
    sys.stdout.flush()


def _text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4f}" if abs(value) < 10_000 else f"{value:.1f}"
    return "-" if value is None else str(value)


def _draw(result: dict[str, Any], path: Path) -> None:
    try:
        from gaussian_process_picture import draw
    except (ImportError, OSError) as error:
        print(f"picture: matplotlib is not installed ({error})")
        return
    draw(result, path)
    print(f"picture: {path}")


if __name__ == "__main__":
    sys.exit(main())
