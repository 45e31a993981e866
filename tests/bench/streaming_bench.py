"""Frames in, poses out, through the running service and real zenoh: latency, age, and where every frame went.

    python tests/bench/streaming_bench.py [--gloves 16,32,64] [--people N] [--processes N]
                                          [--recordings N] [--seconds S] [--quick] [--smoke] [--json FILE]

Two processes: the real-time process of the product (with ``--processes`` several), and one that stands for
all gloves and all readers of poses (``streaming_load.py``). Latency is from just before a frame's ``put`` to
the pose callback (two hops and a prediction, one machine, so one clock); age is what the pose states. Models
have 22 rotations with 100 nodes each, and are those of 8 people (``--people``: as many as there are gloves
where each is of another hand); with ``--gloves`` they hold two effects with a memory too. The overload case
serves models so large that the machine manages half of what is sent. Whether memory grows after the first
minute: ``--gloves 64 --seconds 600``.
"""

from __future__ import annotations

import argparse
import itertools
import json
import multiprocessing
import operator
import os
import socket
import tempfile
from collections import ChainMap, Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from effects_cost import FRAMES, cost_of_effects, everywhere, sentence
from streaming_load import Load, ProcessCost, drive

from glovecal_client.keys import all_services
from glovecal_client.session import ask, json_object, open_client
from glovecal_models.calibration.artifact import dump
from glovecal_models.calibration.model import CalibrationModel, RotationModel
from glovecal_models.covariance.functions import SquaredExponentialArd
from glovecal_models.layout import Correspondence, Layout
from glovecal_models.regression.regressor import ProcessRegressor
from glovecal_models.worker_processes import pin_blas_to_one_thread
from glovecal_service.serve import Lifeline, Work, more_real_time, real_time, run_part
from glovecal_service.settings import Settings
from glovecal_service.store.store import Store

ROTATIONS = 22
SPAWN = multiprocessing.get_context("spawn")


PEOPLE = 8
FIRST_MINUTE_S = 60.0
EFFECTS = {"hysteresis": (4.0,), "lag": (0.05,)}
"""Both with a memory, on every rotation, with these nonlinear parameters."""


@dataclass(frozen=True)
class Case:
    """One run of the bench."""

    name: str
    gloves: int
    rate_hz: float
    seconds: float
    nodes: int = 100
    effects: bool = False
    processes: int = 1
    people: int = PEOPLE
    """Who have a model each; gloves of one share it."""
    recordings: int = 0
    """Begun a second, meanwhile, and each ended a second later."""
    targets: tuple[tuple[str, str, float], ...] = ()
    """(figure, "<=", ">=" or "==", value)."""


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--gloves", type=_numbers, help="only so many gloves with effects, such as 16,32,64")
    parser.add_argument("--processes", type=int, default=1, help="that predict, with --gloves; default 1")
    parser.add_argument("--people", type=int, default=PEOPLE, help="who have a model each, with --gloves")
    parser.add_argument(
        "--recordings", type=int, default=0, help="begun a second meanwhile, with --gloves; default 0"
    )
    parser.add_argument("--seconds", type=float, help="length of a run with --gloves; default 20")
    parser.add_argument("--quick", action="store_true", help="shorter runs")
    parser.add_argument(
        "--smoke", action="store_true", help="only whether it runs: no figure is worth reading"
    )
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    arguments = parser.parse_args()
    pin_blas_to_one_thread()
    effects = cost_of_effects(random_model("nobody", 100, seed=0), 20 if arguments.smoke else FRAMES)
    print(sentence(effects), flush=True)
    results: list[dict[str, Any]] = []
    smoke = map(run, [Case("2 gloves, smoke test", 2, 120.0, 1.0, nodes=10, effects=True)])
    if arguments.gloves:
        seconds = arguments.seconds or (5.0 if arguments.quick else 20.0)
        chosen = {name: getattr(arguments, name) for name in ("processes", "people", "recordings")}
        cases = (run(_gloves_case(count, seconds, **chosen)) for count in arguments.gloves)
    else:
        cases = run_all(quick=arguments.quick)
    for result in smoke if arguments.smoke else cases:
        print_result(result)
        results.append(result)
    print(f"\nload of the machine during the last minute: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    if arguments.json:
        arguments.json.write_text(json.dumps([effects, *results], indent=1))


def _numbers(text: str) -> list[int]:
    return [int(part) for part in text.split(",")]


def run_all(*, quick: bool) -> Iterator[dict[str, Any]]:
    """The cases in turn; figures with their targets."""
    long, short = (10.0, 5.0) if quick else (60.0, 20.0)
    two = Case(
        "2 gloves at 120 Hz", 2, 120.0, long,
        targets=(("latency_p50_ms", "<=", 1.0), ("lost", "==", 0), ("unaccounted", "==", 0)),
    )  # fmt: skip
    yield run(two)
    for count in (16, 32, 64):
        yield run(_gloves_case(count, short))
    yield run(_gloves_case(24, short, people=24))
    capacity = run(Case("large models, as many frames as it can", 8, 250.0, 5.0, nodes=400))
    yield capacity
    per_second = capacity["predicted"] / capacity["seconds"]
    overload = Case(
        f"twice what it can ({2 * per_second:.0f} frames/s)", 8, 2 * per_second / 8, short, nodes=400,
        targets=(("age_max_ms", "<=", 50.0), ("unaccounted", "==", 0)),
    )  # fmt: skip
    yield run(overload)


def _gloves_case(
    count: int, seconds: float, processes: int = 1, people: int = PEOPLE, recordings: int = 0
) -> Case:
    targets = [("age_p99_ms", "<=", 20.0), ("predicted_share", ">=", 0.995), ("unaccounted", "==", 0)]
    if seconds > FIRST_MINUTE_S:
        targets.append(("memory_growth_mib", "<=", 5.0))
    name = f"{count} gloves at 120 Hz, {people} models with {' and '.join(EFFECTS)}"
    name += f", {processes} processes" if processes > 1 else ""
    name += f", {recordings} recordings begun a second" if recordings else ""
    return Case(
        name, count, 120.0, seconds, effects=True, processes=processes, people=people, recordings=recordings,
        targets=tuple(targets),
    )  # fmt: skip


def run(case: Case) -> dict[str, Any]:
    """One case in a fresh service."""
    with tempfile.TemporaryDirectory(prefix="glovecal-bench-") as folder, ExitStack() as running:
        settings = Settings(data=Path(folder), zenoh=f"tcp/127.0.0.1:{free_port()}")
        store_models(settings, case)
        first = running.enter_context(service(settings))
        more = [running.enter_context(service(settings, more_real_time)) for _ in range(1, case.processes)]
        load = Load(settings.zenoh, settings.site, case.gloves, case.people, case.rate_hz, case.seconds)
        driver, driving = running.enter_context(helper(drive, load))
        driver.recv()
        if case.recordings:
            asking, _ = running.enter_context(helper(ask_for_recordings, settings, case))
            asking.recv()
        costs = [ProcessCost(process) for process in (first, *more)]
        with ProcessCost(driving) as load_cost, ExitStack() as counting:
            for cost in costs:
                counting.enter_context(cost)
            driver.send("start")
            sent = driver.recv()
        status = _service_status(settings)
        driver.send("enough")
        latency_ms, age_ms = driver.recv()
    figures = _figures(case, sent, status, latency_ms, age_ms) | _cost_figures(case, costs, status)
    figures["load_cpu_cores"] = sum(load_cost.cpu_s.values()) / case.seconds
    return figures | {"targets": _targets(case, figures)}


def _figures(
    case: Case, sent: int, status: dict[str, Any], latency_ms: np.ndarray, age_ms: np.ndarray
) -> dict[str, Any]:
    gloves = status["gloves"].values()
    counts = {name: sum(glove[name] for glove in gloves) for name in ("received", "predicted", "skipped")}
    refused = sum(sum(glove["refused"].values()) for glove in gloves)
    never_came, never_arrived = sent - counts["received"], counts["predicted"] - len(latency_ms)
    return {
        "case": case.name,
        "seconds": case.seconds,
        "sent": sent,
        **counts,
        "refused": refused,
        "poses": len(latency_ms),
        "lost": never_came + never_arrived,
        "lost_before": never_came,
        "lost_after": never_arrived,
        "unaccounted": counts["received"] - counts["predicted"] - counts["skipped"] - refused,
        "predicted_share": counts["predicted"] / sent,
        **_percentiles("latency", latency_ms),
        **_percentiles("age", age_ms),
    }


def _cost_figures(case: Case, costs: list[ProcessCost], status: dict[str, Any]) -> dict[str, Any]:
    """Memory is that of the first process."""
    predicted = sum(glove["predicted"] for glove in status["gloves"].values())
    by_thread = Counter[str]()
    for cost in costs:
        by_thread.update(cost.cpu_s)
    return {
        "cpu_cores": sum(by_thread.values()) / case.seconds,
        "cpu_us_per_frame": 1e6 * sum(by_thread.values()) / max(predicted, 1),
        "cpu_s_by_thread": {name: round(spent, 2) for name, spent in sorted(by_thread.items())},
        "memory_mib": [round(mib, 1) for _, mib in costs[0].memory],
        "memory_growth_mib": costs[0].growth_mib(FIRST_MINUTE_S),
    }


def _percentiles(name: str, values: np.ndarray) -> dict[str, float]:
    if not len(values):
        return {f"{name}_{part}_ms": float("nan") for part in ("p50", "p99", "max")}
    p50, p99, largest = np.percentile(values, [50, 99, 100])
    return {f"{name}_p50_ms": p50, f"{name}_p99_ms": p99, f"{name}_max_ms": largest}


def _targets(case: Case, figures: dict[str, Any]) -> list[dict[str, Any]]:
    return [
        {
            "figure": name,
            "is": relation,
            "value": value,
            "met": bool(_COMPARED[relation](figures[name], value)),
        }
        for name, relation, value in case.targets
    ]


_COMPARED: dict[str, Callable[[float, float], bool]] = {
    "<=": operator.le,
    ">=": operator.ge,
    "==": operator.eq,
}


def print_result(result: dict[str, Any]) -> None:
    """Counts, milliseconds, cost, and each target beside what was reached."""
    counts = ("sent", "received", "predicted", "skipped", "refused", "poses", "lost_before", "lost_after")
    times = ("latency_p50_ms", "latency_p99_ms", "age_p50_ms", "age_p99_ms", "age_max_ms")
    memory = result["memory_mib"] or [float("nan")]
    print(f"\n{result['case']}, {result['seconds']:.0f} s")
    print("  " + ", ".join(f"{name} {result[name]}" for name in (*counts, "unaccounted")))
    print("  " + ", ".join(f"{name.removesuffix('_ms')} {result[name]:.2f} ms" for name in times))
    print(
        f"  real-time process: {result['cpu_cores']:.2f} of a core, {result['cpu_us_per_frame']:.0f} us a "
        f"predicted frame, CPU seconds by thread {result['cpu_s_by_thread']}; "
        f"the load itself: {result['load_cpu_cores']:.2f} of a core"
    )
    print(f"  memory: {memory[0]:.0f} MiB after 1 s, {max(memory):.0f} at most, {memory[-1]:.0f} at the end")
    for target in result["targets"]:
        print(
            f"  {'met   ' if target['met'] else 'MISSED'} {target['figure']} {target['is']} "
            f"{target['value']:g}: {result[target['figure']]:.2f}",
            flush=True,
        )


def store_models(settings: Settings, case: Case) -> None:
    with Store.open(settings) as store:
        for number in range(min(case.gloves, case.people)):
            subject = f"person{number}"
            store.subjects.create(subject)
            model = random_model(subject, case.nodes, seed=number)
            if case.effects:
                names = model.rotation_names
                effects = tuple(everywhere(name, names, shape) for name, shape in EFFECTS.items())
                model = replace(model, effects=effects)
            record = store.models.add(
                dump(model), subject=subject, layout=model.layout.name, method="spgp", parent=None, facts={}
            )
            store.models.activate(record.id)


def ask_for_recordings(pipe: Any, settings: Settings, case: Case) -> None:
    """Send "ready", then ask for recordings until the other end of the pipe is closed."""
    with Store.open(settings) as store:
        for number in range(case.gloves):
            store.gloves.assign(f"glove{number}", f"person{number % case.people}", wearing="first")
        pipe.send("ready")
        open_ones: list[str] = []
        for number in itertools.count():
            if pipe.poll(1.0 / case.recordings):
                return
            asked = store.recordings.request(f"glove{number % case.gloves}", name=f"take {number}")
            open_ones.append(asked.id)
            if len(open_ones) > case.recordings:
                store.recordings.update(open_ones.pop(0), state="failed")


def random_model(subject: str, nodes: int, *, seed: int) -> CalibrationModel:
    """A valid model of cyberglove18 that nobody trained; prediction costs what a trained one costs."""
    random = np.random.default_rng(seed)
    layout = Layout.built_in("cyberglove18")
    rotations = tuple(
        _random_rotation(correspondence, nodes, random)
        for correspondence in layout.correspondences[:ROTATIONS]
    )
    return CalibrationModel(layout, subject, "spgp", rotations, ())


def _random_rotation(
    correspondence: Correspondence, nodes: int, random: np.random.Generator
) -> RotationModel:
    dimensions = len(correspondence.inputs)
    covariance = SquaredExponentialArd()
    theta = np.log(np.r_[80.0, np.full(dimensions, 1.5)])
    at = random.normal(size=(nodes, dimensions))
    gram = covariance(theta, at, at)
    inverse = np.linalg.inv(gram + 2.0 * np.eye(nodes))
    regressor = ProcessRegressor(
        method="spgp",
        input_shift=np.full(dimensions, 120.0),
        input_scale=np.full(dimensions, 40.0),
        slope=random.normal(size=dimensions) * 10,
        intercept=30.0,
        covariance=covariance,
        theta=theta,
        nodes=at,
        weights=inverse @ (random.normal(size=nodes) * 10),
        variance_root=np.linalg.cholesky(inverse),
        noise_variance=2.0,
        jitter=0.0,
    )
    low, high = np.full(dimensions, 20.0), np.full(dimensions, 230.0)
    return RotationModel(correspondence, regressor, low, high, 4.0, None, nodes)


@contextmanager
def service(settings: Settings, work: Work = real_time) -> Iterator[int]:
    """The id of the real-time process."""
    ready = SPAWN.Event()
    end, held = SPAWN.Pipe(duplex=False)
    process = SPAWN.Process(target=run_part, args=(work, settings, ready, Lifeline(end, None)))
    process.start()
    try:
        if not ready.wait(60) or process.pid is None:
            raise RuntimeError("the real-time process did not start")
        yield process.pid
    finally:
        held.close()
        process.join(15)


@contextmanager
def helper(work: Callable[..., None], *arguments: Any) -> Iterator[tuple[Any, int]]:
    """A process with a pipe to it, and its id."""
    here, there = SPAWN.Pipe()
    process = SPAWN.Process(target=work, args=(there, *arguments))
    process.start()
    there.close()  # or nobody would hear that it died
    try:
        assert process.pid is not None
        yield here, process.pid
    finally:
        here.close()
        process.join(10)
        if process.is_alive():
            process.terminate()
            process.join()


def _service_status(settings: Settings) -> dict[str, Any]:
    with open_client([settings.zenoh]) as session:
        key = all_services(settings.site).removesuffix("alive") + "status"
        told = (json_object(answer.payload.to_bytes()) or {} for answer in ask(session, key, timeout_s=5.0))
        return {"gloves": dict(ChainMap(*(each["gloves"] for each in told)))}


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


if __name__ == "__main__":
    main()
