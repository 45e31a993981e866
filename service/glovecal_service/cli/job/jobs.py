"""``glovecal job``: long work on the service."""

from __future__ import annotations

import typer

from glovecal_service.cli.terminal.connection import connect
from glovecal_service.cli.terminal.options import AsJson, Job
from glovecal_service.cli.terminal.printing import moment, out, print_facts, print_json, print_table
from glovecal_service.cli.terminal.waiting import wait_for_job

app = typer.Typer(help="Jobs (long work): state, progress, cancel.", no_args_is_help=True)


@app.command("list")
def list_jobs(as_json: AsJson = False) -> None:
    """List jobs, newest first."""
    with connect() as service:
        rows = service.get("/jobs")
    if as_json:
        print_json(rows)
        return
    shown = [
        {**row, "done": f"{100 * row['fraction']:.0f} %", "last": row["error"] or row["sentence"]}
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
    if as_json:
        print_json(document)
        return
    result = document["result"] or {}
    print_facts(
        {
            "job": document["id"],
            "kind": f"{document['kind']} {document['payload'].get('method', '')}".strip(),
            "subject": document["subject"],
            "state": document["state"],
            "done": f"{100 * document['fraction']:.0f} %",
            "last message": document["sentence"] or None,
            "error": document["error"],
            "model": result.get("model"),
            "attempt": document["attempt"],
            "created": moment(document["created_at"]),
            "started": moment(document["started_at"]),
            "finished": moment(document["finished_at"]),
        }
    )
    if document["traceback"]:
        out.print(f"\n{document['traceback'].rstrip()}")


@app.command("wait")
def wait(job: Job, as_json: AsJson = False) -> None:
    """Wait until a job ends; exit code 1 unless it is done. Ctrl-C leaves the job running."""
    with connect() as service:
        document = wait_for_job(service, job, quiet=as_json, cancel=False)
    if as_json:
        print_json(document)
    else:
        out.print(f"Job {job} is done.")


@app.command("cancel")
def cancel(job: Job) -> None:
    """Cancel a job; finished parts are kept for the next attempt."""
    with connect() as service:
        document = service.post(f"/jobs/{job}/cancel")
    if document["finished_at"] is None:
        out.print(f"Job {job} is being cancelled.")
    else:
        out.print(f"Job {job} is {document['state']}.")
