"""A REST application with something of everything stored in it, with names that mean something elsewhere."""

from __future__ import annotations

import dataclasses
import io
import json
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

import httpx
import numpy as np
from anyio.from_thread import start_blocking_portal
from stored_takes import LAYOUT, make_take

from glovecal_client.capture.cyberglove import find_port
from glovecal_models.calibration.artifact import dump
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.sampling.catalogue import make_protocol
from glovecal_models.sampling.engine import begin_sampling
from glovecal_models.takes.take import Take
from glovecal_models.takes.write_table import write_takes
from glovecal_service.jobs.dispatcher import Dispatcher
from glovecal_service.rest.app import create_app
from glovecal_service.rest.in_process import PortalTransport
from glovecal_service.settings import Settings
from glovecal_service.store.store import Store

ODD = "fist ${\\frac{ %s <b>$"
"""A take's name that mathtext, printf and HTML read otherwise."""
META = {"layout": LAYOUT.name, "run_id": "r", "hand": "left", "sensors": list(LAYOUT.sensors)}


@dataclass(frozen=True)
class StoredService:
    http: httpx.Client
    known: dict[str, Any]
    """Right values for fields and path parameters, by name."""
    files: dict[str, bytes]
    """One of each kind that is read."""


@contextmanager
def stored_service(folder: Path, zenoh: str) -> Iterator[StoredService]:
    """Subject anna with three takes, a linear model, a glove, and one job, recording and sampling each."""
    app = create_app(Settings(data=folder / "data", upload_limit_mb=1, zenoh=zenoh))
    with (
        patch.object(Dispatcher, "start"),  # jobs that are begun wait: what they do has its own tests
        patch.object(find_port, "_listed_ports", dict),  # those of this computer are nobody's business
        start_blocking_portal() as portal,
        portal.wrap_async_context_manager(app.router.lifespan_context(app)),
        httpx.Client(
            transport=PortalTransport(app, portal), base_url="http://localhost/v1", timeout=600
        ) as http,
    ):
        yield fill(app.state.parts.store, http, folder)


def fill(
    store: Store, http: httpx.Client, folder: Path, *, subject: str = "anna", glove: str = "left"
) -> StoredService:
    """What ``stored_service`` has; for another subject and glove beside it."""
    store.subjects.create(subject)
    store.layouts.put(LAYOUT)
    takes = [_odd(number) for number in range(3)]
    rows = store.takes.add_all(takes, subject=subject, layout=LAYOUT.name, source="import")
    hashes = [row.artifact for row in rows]
    model = dump(train(takes, LAYOUT, subject, TrainingSettings("linear"), take_hashes=hashes))
    facts = {"takes": [{"id": row.id, "name": row.name, "artifact": row.artifact} for row in rows]}
    record = store.models.add(
        model, subject=subject, layout=LAYOUT.name, method="linear", parent=None, facts=facts
    )
    store.models.activate(record.id)
    job = store.jobs.create("train", {"takes": []}, subject=subject)
    store.gloves.seen(glove, META)
    recording = store.recordings.request(glove, name="walk", subject=subject, wearing="w")
    going_on = begin_sampling(make_protocol("fk_only", LAYOUT), LAYOUT.sensors).to_document()
    sampling = store.samplings.create(
        glove=glove, subject=subject, wearing="w", layout=LAYOUT.name, document=going_on
    )
    files = _files(folder, model, takes[0])
    kind = {"Content-Type": "application/octet-stream"}
    video = http.post("/uploads", content=files["video"], headers=kind).json()["sha256"]
    ids = {
        "id": rows[0].id, "take": rows[0].id, "takes": [row.id for row in rows], "model": record.id,
        "model.id": record.id, "models": [record.id], "beside": [record.id], "job.id": job.id,
        "sampling.id": sampling.id, "recording.id": recording.id, "upload": video,
    }  # fmt: skip
    known = {
        "subject": subject, "name": subject, "layout": LAYOUT.name, "glove": glove, "wearing": "w",
        "sensors": list(LAYOUT.sensors), "readings": [[90.0, 120.0, 130.0]], "rotation": "I_PIP",
        "rotations": ["I_PIP"], "rotations[]": "I_PIP", "column": "angle", "method": "linear",
        "effect": "nonlinearity", "effects": ["nonlinearity"], "effect.name": "nonlinearity",
        "declaration": "name = strap; columns = c.supply_v * own; unit = deg", "event": "pause",
        "still": {rows[0].id: "IM_ABD"}, "range_takes": None, "keys": ["hand_length"],
        "simulated": {"I_DIP": "2/3 * I_PIP"}, "text": CALIBRATION, "right": ["A"], "left": ["A"],
        "source": "tape:1",  # a right one would start a camera
    }  # fmt: skip
    return StoredService(http, known | ids, files)


CALIBRATION = "{'cyberglove_calibration': [['I_MCP', [[10, 0], [200, 90]]]]}"


def _odd(number: int) -> Take:
    take = make_take(number, f"{ODD} {number}")
    return dataclasses.replace(take, wearing="$x^{$", context={**take.context, "odd": take.time_s})


def _files(folder: Path, model: bytes, take: Take) -> dict[str, bytes]:
    table, parquet = folder / "t.csv", folder / "t.parquet"
    for file in (table, parquet):
        write_takes([dataclasses.replace(take, name="t", wearing="w")], file)
    trc = (
        "PathFileType\t4\t(X/Y/Z)\tb.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\t"
        "OrigDataStartFrame\tOrigNumFrames\n60\t60\t2\t1\tmm\t60\t1\t2\nFrame#\tTime\tA\t\t\n\t\tX1\tY1\tZ1\n\n"
        "1\t0.0\t1\t2\t3\n2\t4.9\t1\t2\t3\n"
    )
    layout = 'name = "odd"\nsensors = ["A", "B"]\ncounts = [1, 255]\n[rotations]\nI_MCP = ["A"]\n'
    video, estimates = io.BytesIO(), io.BytesIO()
    with zipfile.ZipFile(video, "w") as file:
        file.writestr("000000.jpg", b"\xff\xd8\xff\xe0")
        about = {"source": "camera", "simulated": True, "computer": "x", "times_s": [0.5]}
        file.writestr("video.json", json.dumps(about))
    time_s = np.arange(200) / 30
    np.savez(
        estimates, version=1, time_s=time_s, rotations=np.array(["I_PIP"]), simulated=True,
        angles_deg=np.sin(time_s)[:, None], sd_deg=np.ones((200, 1)), accepted=np.ones((200, 1), bool),
        patches=np.full(200, -1),
    )  # fmt: skip
    return {
        "model": model, "table": table.read_bytes(), "parquet": parquet.read_bytes(), "trc": trc.encode(),
        "video": video.getvalue(), "estimates": estimates.getvalue(), "layout": layout.encode(),
    }  # fmt: skip
