"""``glovecal job``: long work on the service."""

from __future__ import annotations

from typing import Annotated

import typer

from glovecal_service.cli.connection import connect
from glovecal_service.cli.options import AsJson
from glovecal_service.cli.printing import out, print_facts, print_json, print_table
from glovecal_service.cli.waiting import wait_for_job

app = typer.Typer(help="Long work: state, progress, cancel.", no_args_is_help=True)

Job = Annotated[str, typer.Argument(help="Job id.")]


@app.command("list")
def list_jobs(as_json: AsJson = False) -> None:
    """List jobs, newest first."""
    with connect() as service:
        rows = service.get("/jobs")
    if as_json:
        print_json(rows)
        return
    columns = {"id": "job", "kind": "kind", "subject": "subject", "state": "state", "sentence": "last word"}
    print_table(rows, columns, empty="No jobs.")


@app.command("show")
def show(job: Job, as_json: AsJson = False) -> None:
    """Show one job."""
    with connect() as service:
        document = service.get(f"/jobs/{job}")
    print_json(document) if as_json else print_facts(document)


@app.command("wait")
def wait(job: Job) -> None:
    """Wait until a job has ended."""
    with connect() as service:
        wait_for_job(service, job)
    out.print(f"Job {job} is done.")


@app.command("cancel")
def cancel(job: Job) -> None:
    """Stop a job; what it finished so far is kept for the next try."""
    with connect() as service:
        service.post(f"/jobs/{job}/cancel")
    out.print(f"Job {job} is being cancelled.")
