"""What a frame, a glove, a model and a training cost on this computer, and what a large site needs by that.

    python tests/bench/capacity_bench.py [--quick] [--smoke] [--page FILE] [--json FILE]

Everything is measured in one run; the simulation of many gloves is held against the running service before it
is believed of more gloves than one computer can have.
"""

from __future__ import annotations

import argparse
import gc
import io
import json
import os
import resource
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, cast

import numpy as np
import zenoh
from effects_cost import everywhere
from large_store import Size, fill
from simulated_turns import Cost, simulate
from streaming_bench import EFFECTS, Case, free_port, helper, random_model, run

from glovecal_client import open_router
from glovecal_client.clock import clock_ns
from glovecal_client.frame_log import record_bytes
from glovecal_client.keys import GloveKeys, all_gloves
from glovecal_client.packed_log import packed_blocks
from glovecal_client.session import open_client
from glovecal_client.wire.frame import Frame, encode_frame
from glovecal_models.calibration.artifact import dump, load
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.training import train
from glovecal_models.layout import Layout
from glovecal_models.regression.regressor import ProcessRegressor
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_models.takes.take import Take
from glovecal_models.worker_processes import pin_blas_to_one_thread
from glovecal_service.incoming.arrivals import Arrival, Arrivals
from glovecal_service.realtime.lane_effects import WornGloves
from glovecal_service.realtime.pose_loop import PoseLoop
from glovecal_service.realtime.process import PosePublishers
from glovecal_service.realtime.served_model import ServedModel, ServedModels
from glovecal_service.settings import Settings
from glovecal_service.store.packing import packed
from glovecal_service.store.take_file import dump_take

RATE_HZ = 120.0
SITE_GLOVES, SITE_PEOPLE, SITE_TRAININGS, SITE_YEARS = 1000, 100_000, 500, 10
RECORDED_H, DAYS = 2.0, 250
"""A glove's hours of recording a working day, and such days a year: an assumption, to be scaled."""
SHARE, P99_MS = 0.995, 20.0
MARKS = (
    "<!-- capacity: written by python3 do.py bench capacity --page docs/capacity.md -->",
    "<!-- capacity: end -->",
)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="shorter runs, fewer frames trained with")
    parser.add_argument(
        "--smoke", action="store_true", help="only whether it runs: no figure is worth reading"
    )
    parser.add_argument("--page", type=Path, help="put what was measured between its marks in this page")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    options = parser.parse_args()
    pin_blas_to_one_thread()
    constants = measure(0.02 if options.smoke else 0.3 if options.quick else 1.0)
    text = page(constants, checked(constants, 2.0 if options.smoke else 15.0))
    print(text)
    if options.page:
        begin, end = MARKS
        before, _, rest = options.page.read_text(encoding="utf-8").partition(begin)
        options.page.write_text(f"{before}{begin}\n{text}\n{end}{rest.partition(end)[2]}", encoding="utf-8")
    if options.json:
        options.json.write_text(json.dumps(vars(constants), indent=1, default=vars))


@dataclass(frozen=True)
class Constants:
    """Seconds are of one core, bytes of one frame, row or model."""

    even: Cost
    """Of a model whose rotations have 100 nodes each."""
    trained: Cost
    nodes: str
    """What training chose, a clause."""
    training_s: float
    frames_trained: int
    model_bytes: int
    served_bytes: float
    frame_bytes: int
    pose_bytes: int
    log_bytes: int
    ledger_bytes: float
    take_bytes: float
    person_bytes: float
    row_bytes: float
    """Of a take with its recording, a model or a job: the largest of them."""


def measure(share: float) -> Constants:
    """``share`` of the usual effort."""
    layout = Layout.built_in("cyberglove18")
    plan = SessionPlan(
        seed=3, sensors=layout.sensors, rotations=tuple(layout.rotations), wearings=2, takes_per_wearing=3,
        take_s=max(30.0 * share, 6.0),
    )  # fmt: skip
    takes = record_session(plan, ()).takes
    print(f"training from {len(takes)} takes of {plan.take_s:g} s", flush=True)
    began = time.process_time()
    model = train(takes, layout, "anna")
    training_s = time.process_time() - began
    link_s = link_cost(max(int(40 * share), 2))
    rounds = max(int(60 * share), 3)
    frames = [encode_frame(frame) for frame in frames_of(takes[0])]
    log = [record_bytes(message) for message in frames]
    ledger = sum(map(len, packed_blocks(io.BytesIO(b"".join(log)))))
    person_bytes, row_bytes = rows_of_a_store()
    return Constants(
        trained=turn_cost(model, link_s, rounds),
        even=turn_cost(random_model("nobody", 100, seed=0), link_s, rounds),
        nodes=nodes_of(model), training_s=training_s, frames_trained=sum(len(take.time_s) for take in takes),
        model_bytes=len(dump(model)), served_bytes=memory_of(model),
        frame_bytes=len(frames[0]), pose_bytes=len(pose_of(model)),
        log_bytes=len(log[0]), ledger_bytes=ledger / len(log),
        take_bytes=len(packed(dump_take(takes[0]))) / len(log),
        person_bytes=person_bytes, row_bytes=row_bytes,
    )  # fmt: skip


def nodes_of(model: CalibrationModel) -> str:
    found = [
        len(each.regressor.nodes) for each in model.rotations if isinstance(each.regressor, ProcessRegressor)
    ]
    return f"{int(np.median(found))} nodes in the median, {max(found):,} at most"


def frames_of(take: Take) -> list[Frame]:
    times = (take.time_s * 1e9).astype(np.int64)
    return [
        Frame(number, 7, int(at), int(at) + 10**18, row)
        for number, (at, row) in enumerate(zip(times, take.readings.astype(np.float32), strict=True))
    ]


class Waiting:
    """Stands for ``Arrivals``: frames that came all at once."""

    def __init__(self) -> None:
        self.left_out: set[str] = set()
        self.frames: list[Arrival] = []

    def wait(self) -> Arrival | None:
        return self.frames.pop() if self.frames else None

    def drain(self) -> list[Arrival]:
        taken, self.frames = self.frames, []
        return taken


class Loop:
    """The service's loop that turns frames into poses, in this process, with copies of a model."""

    def __init__(self, model: CalibrationModel, copies: int, gloves_each: int) -> None:
        names = model.rotation_names
        effects = tuple(everywhere(name, names, shape) for name, shape in EFFECTS.items())
        model = replace(model, effects=effects)
        models, self._waiting, self.poses = ServedModels(), Waiting(), []
        self._keys = [GloveKeys("lab", f"glove{number}") for number in range(copies * gloves_each)]
        self._readings = np.full(len(model.layout.sensors), 120.0, np.float32)
        self._sequence = 0
        for number in range(copies):
            served = ServedModel.prepare(f"{number + 1:064x}", model)
            for keys in self._keys[number * gloves_each : (number + 1) * gloves_each]:
                models.put(keys.glove, served)
        self._loop = PoseLoop(
            cast(Arrivals, self._waiting), models, lambda _, pose: self.poses.append(pose), WornGloves(),
            oldest_ns=600 * 10**9,
        )  # fmt: skip

    def round_s(self) -> float:
        """Seconds of processor time for a frame of each glove."""
        self._sequence += 1
        at = self._sequence * 8_333_333
        frames = [
            Frame(self._sequence, 7 + number, at, 10**18 + at, self._readings)
            for number in range(len(self._keys))
        ]
        now = clock_ns()
        messages = map(encode_frame, frames)
        self._waiting.frames = [
            Arrival(keys.raw, message, now) for keys, message in zip(self._keys, messages, strict=True)
        ]
        self.poses.clear()
        began = time.thread_time()
        self._loop.step()
        return time.thread_time() - began


def turn_cost(model: CalibrationModel, link_s: float, rounds: int) -> Cost:
    """Of turns with one frame and with 16, by 32 and 4 models in turn, so that none is in the cache."""
    costs = []
    for models, gloves_each in ((32, 1), (4, 16)):
        loop = Loop(model, models, gloves_each)
        loop.round_s()
        costs.append(float(np.median([loop.round_s() for _ in range(rounds)])) / models)
    frame_s = (costs[1] - costs[0]) / 15
    return Cost(costs[0] - frame_s, frame_s + link_s)


def pose_of(model: CalibrationModel) -> bytes:
    loop = Loop(model, 1, 1)
    loop.round_s()
    return loop.poses[0]


def memory_of(model: CalibrationModel) -> float:
    """Of one more prepared model, bytes."""
    content, before = dump(model), _resident()
    kept = [ServedModel.prepare(f"{number + 1:064x}", load(content)) for number in range(10)]
    gc.collect()
    return (_resident() - before) / len(kept)


def _resident() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()


def link_cost(rounds: int) -> float:
    """Seconds to take a frame from zenoh and to hand it a pose, with 128 at once, over TCP."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    gloves = [f"glove{number}" for number in range(128)]
    with open_router([endpoint]) as session, helper(other_end, endpoint, gloves) as (pipe, _):
        arrivals, publishers = Arrivals(session, all_gloves("lab", "raw")), PosePublishers(session, "lab")
        pipe.recv()
        spent, count = 0.0, 0
        for number in range(rounds + 2):
            pipe.send("frames")
            pipe.recv()
            time.sleep(0.05)
            began = time.thread_time()
            taken = arrivals.drain()
            for glove in gloves:
                publishers.publish(glove, bytes(300))
            if number >= 2:  # the first ones declare their publishers
                spent, count = spent + time.thread_time() - began, count + len(taken)
        arrivals.close()
    return spent / count


def other_end(pipe: Any, endpoint: str, gloves: list[str]) -> None:
    """Hears poses and sends a frame of each glove when it is told to."""
    with open_client([endpoint]) as session:
        heard = session.declare_subscriber(all_gloves("lab", "pose"), zenoh.handlers.RingChannel(100))
        senders = [session.declare_publisher(GloveKeys("lab", glove).raw) for glove in gloves]
        time.sleep(0.5)
        pipe.send("ready")
        while True:
            try:
                pipe.recv()
            except EOFError:
                break
            for sender in senders:
                sender.put(bytes(124))
            pipe.send("sent")
        heard.undeclare()


def rows_of_a_store() -> tuple[float, float]:
    """Bytes of a database for one more person, and for one more row of the largest kind."""
    few = Size(subjects=200, models=200, takes=200, jobs=200, samplings=0)
    sizes = [few] + [replace(few, **{kind: 2200}) for kind in ("subjects", "models", "takes", "jobs")]
    bytes_of = []
    for size in sizes:
        with tempfile.TemporaryDirectory(prefix="glovecal-bench-") as folder:
            fill(Settings(data=Path(folder)), size)
            bytes_of.append(sum(each.stat().st_size for each in Path(folder).glob("*.sqlite3*")))
    each = [(more - bytes_of[0]) / 2000 for more in bytes_of[1:]]
    return each[0], max(each[1:])


@dataclass(frozen=True)
class Checked:
    name: str
    measured: tuple[float, float]
    simulated: tuple[float, float]
    """Share predicted, 99th percentile of the age in ms."""


def checked(constants: Constants, seconds: float) -> list[Checked]:
    """The running service beside the simulation, models with 100 nodes."""
    found = []
    for gloves, people in ((16, 16), (24, 24), (64, 8), (128, 8)):
        print(f"the service with {gloves} gloves of {people} models", flush=True)
        case = Case("", gloves, RATE_HZ, seconds, effects=True, people=people)
        figures = run(case)
        outcome = simulate(gloves, gloves // people, constants.even, rate_hz=RATE_HZ)
        found.append(
            Checked(
                f"{gloves} gloves, {people} models",
                (figures["predicted_share"], figures["age_p99_ms"]),
                (outcome.share, outcome.p99_ms),
            )
        )
    return found


def fewest_processes(gloves: int, cost: Cost) -> int:
    """That predict ``SHARE`` of the frames, their 99th percentile ``P99_MS`` old; a model for each glove."""
    lone = max(1, int(gloves * RATE_HZ * cost.of(1)))
    for number in range(max(1, lone // 4), 4 * lone + 2):
        outcome = simulate(gloves, 1, cost, processes=number, rate_hz=RATE_HZ, seconds=2.0)
        if outcome.share >= SHARE and outcome.p99_ms <= P99_MS:
            return number
    raise RuntimeError("no number of processes is enough")


def page(known: Constants, held: list[Checked]) -> str:
    day = datetime.now(UTC).strftime("%Y-%m-%d")
    load = f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}"
    costs = {
        "a turn of a model with 22 rotations of 100 nodes, hysteresis and lag": _us(known.even.turn_s),
        "... and each frame in such a turn": _us(known.even.frame_s),
        f"a turn of a model as training made it ({known.nodes})": _us(known.trained.turn_s),
        "... and each frame in that one": _us(known.trained.frame_s),
        "a frame of 18 sensors, on the wire": f"{known.frame_bytes} bytes",
        "a pose of 22 rotations, on the wire": f"{known.pose_bytes} bytes",
        "a frame in a capture log": f"{known.log_bytes} bytes",
        "a frame in the packed ledger of a recording": f"{known.ledger_bytes:.0f} bytes",
        "a frame in a packed take, with a reference of 18 angles": f"{known.take_bytes:.0f} bytes",
        f"a training from {known.frames_trained:,} frames": f"{known.training_s:.0f} s of a core",
        "that model, stored": f"{known.model_bytes / 1e6:.1f} MB",
        "that model, ready for prediction": f"{known.served_bytes / 1e6:.0f} MB of memory",
        "a person in the database": f"{known.person_bytes:.0f} bytes",
        "a take with its recording, a model or a job there, at most": f"{known.row_bytes:.0f} bytes",
    }
    beside = [
        f"| {each.name} | {100 * each.measured[0]:.1f} % | {100 * each.simulated[0]:.1f} % | "
        f"{each.measured[1]:.1f} ms | {each.simulated[1]:.1f} ms |"
        for each in held
    ]
    return "\n".join(
        [
            f"`python3 do.py bench capacity`, {day}, {load}.",
            "",
            *_table("what", "costs", costs),
            "",
            "The simulation beside the running service, whose load generator has the same cores:",
            "",
            "| gloves at 120 Hz | predicted, service | simulated | age p99, service | simulated |",
            "|---|---|---|---|---|",
            *beside,
            "",
            f"{SITE_GLOVES:,} gloves at 120 Hz, each of another hand, {SITE_PEOPLE:,} people, "
            f"{SITE_TRAININGS} trainings a day, {SITE_YEARS} years of {DAYS} days, every glove "
            f"recorded for {RECORDED_H:g} hours of each:",
            "",
            *_table("what", "needs", _needs(known)),
        ]
    )


def _needs(known: Constants) -> dict[str, str]:
    trained, even = (fewest_processes(SITE_GLOVES, cost) for cost in (known.trained, known.even))
    a_second, days = SITE_GLOVES * RATE_HZ, DAYS * SITE_YEARS
    to_mbit = 8e-6 * a_second
    frames = a_second * 3600 * RECORDED_H * days
    rows = known.person_bytes * SITE_PEOPLE + 3 * known.row_bytes * SITE_TRAININGS * days
    cores = f"{100 * SHARE:.1f} % predicted, p99 of the age {P99_MS:.0f} ms"
    return {
        f"real-time processes, a core each, models with 100 nodes ({cores})": f"{even}",
        "gloves a core with those": f"{SITE_GLOVES / even:.0f}",
        "real-time processes, models as training made them": f"{trained}",
        "gloves a core with these": f"{SITE_GLOVES / trained:.0f}",
        "network, frames in": f"{to_mbit * known.frame_bytes:.0f} Mbit/s and what zenoh adds",
        "network, poses to one who sees all": f"{to_mbit * known.pose_bytes:.0f} Mbit/s and what zenoh adds",
        "written while all record": f"{1e-6 * a_second * known.log_bytes:.0f} MB/s",
        "recordings and takes, packed": f"{1e-12 * frames * (known.ledger_bytes + known.take_bytes):.0f} TB",
        "models, none removed": f"{1e-12 * known.model_bytes * SITE_TRAININGS * days:.1f} TB",
        "database": f"{1e-9 * rows:.0f} GB",
        "training, within eight hours": f"{known.training_s * SITE_TRAININGS / (8 * 3600):.1f} cores",
    }


def _us(seconds: float) -> str:
    return f"{1e6 * seconds:.0f} us of a core"


def _table(left: str, right: str, rows: Mapping[str, str]) -> list[str]:
    return [f"| {left} | {right} |", "|---|---|", *(f"| {what} | {said} |" for what, said in rows.items())]


if __name__ == "__main__":
    main()
