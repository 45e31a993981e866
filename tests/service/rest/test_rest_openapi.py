"""Schemathesis against the published description: no 5xx, no answer that is not documented.

It does not send NaN, lone surrogates or hostile paths; the hand-made corpora beside this file do.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from glovecal_client.rest import RestClient
from glovecal_service.rest.http.health import REALTIME_ALIVE
from glovecal_service.settings import Settings

CHECKS = [
    "not_a_server_error",
    "status_code_conformance",
    "content_type_conformance",
    "response_headers_conformance",
    "response_schema_conformance",
    "negative_data_rejection",
    "allow_header_conformance",
    "use_after_free",
    "ensure_resource_availability",
]
CONFIG = """
[checks.negative_data_rejection]
expected-statuses = ["403", "404", "405", "409", "413", "415", "422"]

[[operations]]
include-path-regex = "^/v1/takes/"
parameters = {{ "path.id" = "{take}" }}

[[operations]]
include-path-regex = "^/v1/models/.id."
parameters = {{ "path.id" = "{model}" }}

[[operations]]
include-path-regex = "^/v1/jobs/"
parameters = {{ "path.id" = "{job}" }}
"""


@pytest.mark.slow  # a minute; test_rest_wild_bodies.py holds every route's refusals in the usual run
def test_schemathesis(
    serve: Callable[..., str], settings: Settings, write_table: Callable[..., Path]
) -> None:
    url = serve(settings)
    with RestClient(url) as client:
        client.post("/subjects", {"name": "anna"})
        answer = client.upload_takes(write_table(), subject="anna")
        body = {"subject": "anna", "layout": answer["layout"], "method": "linear"}
        job = client.wait_for_job(client.post("/models/train", body)["id"], patience_s=300)
        description = client.get("/openapi.json")  # schemathesis itself waits 10 s for it and no longer
    described = settings.data / "openapi.json"
    described.write_text(json.dumps(description))
    config = settings.data / "schemathesis.toml"
    config.write_text(CONFIG.format(take=answer["imported"][0], model=job["result"]["model"], job=job["id"]))
    alive = settings.data / REALTIME_ALIVE  # real time is another process, which these tests do without
    alive.touch()
    os.utime(alive, (2e9, 2e9))
    run = subprocess.run(
        [
            str(Path(sys.executable).with_name("schemathesis")),
            f"--config-file={config}",
            "run",
            str(described),
            f"--url={url}",
            f"--checks={','.join(CHECKS)}",
            # its 20,000 x 512 readings take longer to make than to refuse
            "--exclude-path=/v1/models/{id}/predict",
            # started cameras build databases for minutes
            "--exclude-path=/v1/cameras",
            # each makes twelve takes and trains a model
            "--exclude-path=/v1/hidden-effects",
            "--phases=coverage,fuzzing",
            "--max-examples=1",
            "--generation-deterministic",
            "--continue-on-failure",
            "--request-timeout=60",
            "--warnings=off",
            "--no-color",
        ],
        cwd=settings.data,
        capture_output=True,
        text=True,
        timeout=1800,
        check=False,
    )
    summary = run.stdout[run.stdout.find("FAILURES") :]
    assert run.returncode == 0, summary[:6000] + run.stderr[:2000]
