"""``glovecal job``: long work on the service."""

from __future__ import annotations

from typing import Annotated

import typer

from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.listing import (
    AfterPlace,
    EveryRow,
    MostRows,
    Since,
    Wanted,
    Words,
    filtered,
)
from glovecal_service.cli.terminal.options import AsJson, Job, OnlySubject
from glovecal_service.cli.terminal.printing import out, print_facts, print_json, print_table, read_or_print
from glovecal_service.cli.terminal.waiting import wait_for_job
from glovecal_service.plain import read
from glovecal_service.rest.job.answer import Job as JobRow
from glovecal_service.rest.job.answer import JobRow as ListedJob
from glovecal_service.store.records import JobState

app = typer.Typer(help="Jobs (long work): state, progress, cancel.", no_args_is_help=True)


@app.command("list")
def list_jobs(
    subject: OnlySubject = None,
    kind: Annotated[str | None, typer.Option(help="Only of this kind, such as train.")] = None,
    state: Annotated[JobState | None, typer.Option(help="Only in this state.")] = None,
    text: Words = None,
    since: Since = None,
    limit: MostRows = None,
    every: EveryRow = False,
    after: AfterPlace = None,
    as_json: AsJson = False,
) -> None:
    """List jobs, newest first."""
    query = {"subject": subject, "kind": kind, "state": state, "text": text, "since": since}
    wanted = Wanted(limit, every, after, as_json)
    with connect() as service:
        rows = wanted.rows(service, ListedJob, "/jobs", filtered("job list", **query), query)
    shown = [
        {**vars(row), "done": f"{100 * row.fraction:.0f} %", "last": row.error or row.sentence}
        for row in rows
    ]
    columns = {"id": "job", "kind": "kind", "subject": "subject", "state": "state", "done": "done"}
    print_table(
        shown,
        {**columns, "last": "last message"},
        empty="No jobs yet. Start one: glovecal train --subject NAME",
    )


@app.command("show")
def show(job: Job, as_json: AsJson = False) -> None:
    """Show one job."""
    with connect() as service:
        document = service.get(f"/jobs/{job}")
    row = read_or_print(JobRow, document, as_json)
    print_facts(
        {
            "job": row.id,
            "kind": f"{row.kind} {row.payload.get('method', '')}".strip(),
            "subject": row.subject,
            "state": row.state,
            "done": f"{100 * row.fraction:.0f} %",
            "last message": row.sentence or None,
            "error": row.error,
            "model": (row.result or {}).get("model"),
            "attempt": row.attempt,
            "created": row.created_at,
            "started": row.started_at,
            "finished": row.finished_at,
        }
    )
    if row.traceback:
        out.print(f"\n{row.traceback.rstrip()}")


@app.command("wait")
def wait(job: Job, as_json: AsJson = False) -> None:
    """Wait until a job ends; exit code 1 unless it is done. Ctrl-C leaves the job running."""
    with connect() as service:
        row = wait_for_job(service, job, quiet=as_json, cancel=False)
    if as_json:
        print_json(row.model_dump(mode="json"))
    else:
        out.print(f"Job {job} is done.")


@app.command("cancel")
def cancel(job: Job) -> None:
    """Cancel a job; finished parts are kept for the next attempt."""
    with connect() as service:
        row = read(JobRow, service.post(f"/jobs/{job}/cancel"))
    if row.finished_at is None:
        out.print(f"Job {job} is being cancelled.")
    else:
        out.print(f"Job {job} is {row.state}.")
