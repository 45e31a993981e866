"""Frames in, poses out, through the running service and real zenoh: latency, age, and where every frame went.

    python tests/bench/streaming_bench.py [--quick] [--json FILE]

Three processes: the real-time process of the product, a publisher of all gloves' frames, a subscriber of
their poses. Latency is from just before a frame's ``put`` to the pose callback (two hops and a prediction,
one machine, so one clock); age is what the pose states. Every glove has a calibration model of its own, 22
rotations with 100 nodes each; the overload case serves models so large that the machine manages half of
what is sent. Before that, without any network: what two effects with a memory add to a frame.
"""

from __future__ import annotations

import argparse
import gc
import json
import multiprocessing
import os
import secrets
import signal
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import zenoh
from effects_cost import cost_of_effects, sentence

from glovecal_client.keys import GloveKeys, all_gloves, all_services
from glovecal_client.queries import ask_json
from glovecal_client.session import open_client
from glovecal_client.wire.frame import Frame, encode_frame
from glovecal_client.wire.pose import decode_pose
from glovecal_models.calibration.artifact import dump
from glovecal_models.calibration.model import CalibrationModel, RotationModel
from glovecal_models.covariance.squared_exponential_ard import SquaredExponentialArd
from glovecal_models.layout import Correspondence, Layout
from glovecal_models.regression.process_regressor import ProcessRegressor
from glovecal_models.threads import pin_blas_to_one_thread
from glovecal_service.serve import real_time, run_part
from glovecal_service.settings import Settings
from glovecal_service.store.store import Store

ROTATIONS = 22
SPAWN = multiprocessing.get_context("spawn")


@dataclass(frozen=True)
class Case:
    """One run of the bench."""

    name: str
    gloves: int
    rate_hz: float
    seconds: float
    nodes: int = 100
    targets: tuple[tuple[str, str, float], ...] = ()
    """(figure, "<=" or "==", value)."""


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="shorter runs")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    arguments = parser.parse_args()
    pin_blas_to_one_thread()
    effects = cost_of_effects(random_model("nobody", 100, seed=0))
    print(sentence(effects), flush=True)
    results = run_all(quick=arguments.quick)
    print_table(results)
    if arguments.json:
        arguments.json.write_text(json.dumps([effects, *results], indent=1))


def run_all(*, quick: bool) -> list[dict[str, Any]]:
    """All cases in turn; figures with their targets."""
    long, short = (10.0, 5.0) if quick else (60.0, 20.0)
    two = Case(
        "2 gloves at 120 Hz", 2, 120.0, long,
        targets=(("latency_p50_ms", "<=", 1.0), ("lost", "==", 0), ("unaccounted", "==", 0)),
    )  # fmt: skip
    sixteen = Case(
        "16 gloves at 120 Hz", 16, 120.0, short,
        targets=(("age_p99_ms", "<=", 25.0), ("unaccounted", "==", 0)),
    )  # fmt: skip
    results = [run(two), run(sixteen)]
    capacity = run(Case("large models, as many frames as it can", 8, 250.0, 5.0, nodes=400))
    per_second = capacity["predicted"] / capacity["seconds"]
    overload = Case(
        f"twice what it can ({2 * per_second:.0f} frames/s)", 8, 2 * per_second / 8, short, nodes=400,
        targets=(("age_max_ms", "<=", 50.0), ("unaccounted", "==", 0)),
    )  # fmt: skip
    return [*results, capacity, run(overload)]


def run(case: Case) -> dict[str, Any]:
    """One case in a fresh service."""
    with tempfile.TemporaryDirectory(prefix="glovecal-bench-") as folder, ExitStack() as running:
        settings = Settings(data=Path(folder), zenoh=f"tcp/127.0.0.1:{_free_port()}")
        _store_models(settings, case)
        running.enter_context(_service(settings))
        watcher = running.enter_context(_helper(_watch, settings))
        watcher.recv()
        publisher = running.enter_context(_helper(_publish, settings, case))
        sent = publisher.recv()
        status = _service_status(settings)
        watcher.send("enough")
        latency_ms, age_ms = watcher.recv()
        publisher.send("enough")
    return _figures(case, sent, status, latency_ms, age_ms)


def _figures(
    case: Case, sent: int, status: dict[str, Any], latency_ms: np.ndarray, age_ms: np.ndarray
) -> dict[str, Any]:
    gloves = status["gloves"].values()
    counts = {name: sum(glove[name] for glove in gloves) for name in ("received", "predicted", "skipped")}
    refused = sum(sum(glove["refused"].values()) for glove in gloves)
    figures = {
        "case": case.name,
        "seconds": case.seconds,
        "sent": sent,
        **counts,
        "refused": refused,
        "poses": len(latency_ms),
        "lost": sent - len(latency_ms) - counts["skipped"] - refused,
        "unaccounted": counts["received"] - counts["predicted"] - counts["skipped"] - refused,
        **_percentiles("latency", latency_ms),
        **_percentiles("age", age_ms),
    }
    figures["targets"] = [
        {"figure": name, "is": relation, "value": value, "met": bool(_holds(figures[name], relation, value))}
        for name, relation, value in case.targets
    ]
    return figures


def _percentiles(name: str, values: np.ndarray) -> dict[str, float]:
    if not len(values):
        return {f"{name}_{part}_ms": float("nan") for part in ("p50", "p99", "max")}
    p50, p99, largest = np.percentile(values, [50, 99, 100])
    return {f"{name}_p50_ms": p50, f"{name}_p99_ms": p99, f"{name}_max_ms": largest}


def _holds(figure: float, relation: str, value: float) -> bool:
    return figure <= value if relation == "<=" else figure == value


def print_table(results: list[dict[str, Any]]) -> None:
    """Counts, milliseconds, and each target beside what was reached."""
    columns = ("sent", "received", "predicted", "skipped", "poses", "lost", "unaccounted")
    times = ("latency_p50_ms", "latency_p99_ms", "age_p50_ms", "age_p99_ms", "age_max_ms")
    for result in results:
        print(f"\n{result['case']}, {result['seconds']:.0f} s")
        print("  " + ", ".join(f"{name} {result[name]}" for name in columns))
        print("  " + ", ".join(f"{name.removesuffix('_ms')} {result[name]:.2f} ms" for name in times))
        for target in result["targets"]:
            reached = result[target["figure"]]
            print(
                f"  {'met   ' if target['met'] else 'MISSED'} {target['figure']} {target['is']} "
                f"{target['value']:g}: {reached:.2f}"
            )
    print(f"\nload of the machine during the last minute: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")


def _store_models(settings: Settings, case: Case) -> None:
    with Store.open(settings) as store:
        for number in range(case.gloves):
            subject = f"person{number}"
            store.subjects.create(subject)
            model = random_model(subject, case.nodes, seed=number)
            record = store.models.add(
                dump(model), subject=subject, layout=model.layout.name, method="spgp", parent=None, facts={}
            )
            store.models.activate(record.id)


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
def _service(settings: Settings) -> Iterator[None]:
    ready = SPAWN.Event()
    process = SPAWN.Process(target=run_part, args=(real_time, settings, ready, os.getpid()))
    process.start()
    try:
        if not ready.wait(60):
            raise RuntimeError("the real-time process did not start")
        yield
    finally:
        process.terminate()
        process.join(15)


@contextmanager
def _helper(work: Callable[..., None], *arguments: Any) -> Iterator[Any]:
    here, there = SPAWN.Pipe()
    process = SPAWN.Process(target=work, args=(there, *arguments))
    process.start()
    try:
        yield here
    finally:
        process.join(10)
        if process.is_alive():
            process.terminate()
            process.join()


def _publish(pipe: Any, settings: Settings, case: Case) -> None:
    """All gloves' capture: meta first, then frames at even spacing, and how many were sent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    layout = Layout.built_in("cyberglove18")
    readings = np.random.default_rng(1).uniform(60, 190, (64, len(layout.sensors))).astype("<f4")
    with open_client([settings.zenoh]) as session:
        gloves = [GloveKeys(settings.site, f"glove{number}") for number in range(case.gloves)]
        runs = [secrets.randbits(64) for _ in gloves]
        publishers = [
            session.declare_publisher(keys.raw, priority=zenoh.Priority.INTERACTIVE_HIGH, express=True)
            for keys in gloves
        ]
        for number, keys in enumerate(gloves):
            meta = _meta(layout, f"person{number}", runs[number])
            session.put(keys.meta, json.dumps({**meta, "glove": keys.glove}))
        _wait_until_calibrated(session, gloves)
        gc.disable()
        period, start = 1 / case.rate_hz, time.monotonic() + 0.1
        total = int(case.rate_hz * case.seconds)
        for sequence in range(total):
            for number, publisher in enumerate(publishers):
                wait = start + (sequence + number / len(publishers)) * period - time.monotonic()
                if wait > 0:
                    time.sleep(wait)
                values = readings[sequence % len(readings)]
                now = time.monotonic_ns()
                publisher.put(encode_frame(Frame(sequence, runs[number], now, time.time_ns(), values)))
        time.sleep(0.4)
        pipe.send(total * len(publishers))
        pipe.recv()


def _meta(layout: Layout, subject: str, run_id: int) -> dict[str, Any]:
    return {
        "layout": layout.name,
        "sensors": list(layout.sensors),
        "context": [],
        "subject": subject,
        "wearing": "bench",
        "simulated": False,
        "run_id": f"{run_id:016x}",
    }


def _wait_until_calibrated(session: zenoh.Session, gloves: list[GloveKeys]) -> None:
    deadline = time.monotonic() + 60
    for keys in gloves:
        while True:
            try:
                if ask_json(session, keys.pose_meta, timeout_s=1.0)["state"] == "calibrated":
                    break
            except Exception:
                if time.monotonic() > deadline:
                    raise
            time.sleep(0.1)


def _watch(pipe: Any, settings: Settings) -> None:
    """All poses: latency and age in milliseconds of those that are not repeated as stale."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    latency: list[int] = []
    age: list[int] = []

    def hear(sample: zenoh.Sample) -> None:
        now = time.monotonic_ns()
        pose = decode_pose(sample.payload.to_bytes())
        if not pose.stale:
            latency.append(now - pose.monotonic_ns)
            age.append(pose.age_us)

    with open_client([settings.zenoh]) as session:
        handler = zenoh.handlers.Callback(hear, indirect=False)
        subscriber = session.declare_subscriber(all_gloves(settings.site, "pose"), handler)
        gc.disable()
        pipe.send("ready")
        pipe.recv()
        subscriber.undeclare()
        pipe.send((np.array(latency) / 1e6, np.array(age) / 1e3))


def _service_status(settings: Settings) -> dict[str, Any]:
    with open_client([settings.zenoh]) as session:
        key = all_services(settings.site).removesuffix("alive") + "status"
        return ask_json(session, key, timeout_s=5.0)


def _free_port() -> int:
    import socket

    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


if __name__ == "__main__":
    assert threading.current_thread() is threading.main_thread()
    main()
