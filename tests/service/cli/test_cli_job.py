"""What ``glovecal job show`` tells of a job that failed."""

from pathlib import Path

from glovecal_service.settings import Settings
from glovecal_service.store import Store
from glovecal_service.store.jobs import LONGEST_TRACEBACK


def test_a_failed_job_shows_its_traceback(run, tmp_path: Path):
    frames = "".join(f'  File "models.py", line {line}, in step\n' for line in range(1000))
    with Store.open(Settings(data=tmp_path / "data")) as store:
        job = store.jobs.create("improve", {})
        claimed = store.jobs.claim("a test")
        assert claimed is not None
        trace = f"Traceback (most recent call last):\n{frames}ZeroDivisionError: float division by zero\n"
        store.jobs.fail(job.id, claimed.attempt, "an error in Glovecal itself", trace)
    shown = run("job", "show", job.id)
    assert shown.out.rstrip().endswith("in step\nZeroDivisionError: float division by zero")
    document = run("job", "show", job.id, "--json").json
    assert len(document["traceback"]) == LONGEST_TRACEBACK
    assert document["traceback"] in trace
