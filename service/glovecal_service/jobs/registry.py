"""All kinds of jobs, by the name in the job's row."""

from __future__ import annotations

from glovecal_service.jobs.add_effect import AddEffectJob
from glovecal_service.jobs.ceiling import CeilingJob
from glovecal_service.jobs.detectability import DetectabilityJob
from glovecal_service.jobs.diagnose import DiagnoseJob
from glovecal_service.jobs.improve import ImproveJob
from glovecal_service.jobs.job_kind import JobKind
from glovecal_service.jobs.remove_effect import RemoveEffectJob
from glovecal_service.jobs.train import TrainJob

KINDS: dict[str, JobKind] = {
    "train": TrainJob(),
    "diagnose": DiagnoseJob(),
    "detectability": DetectabilityJob(),
    "ceiling": CeilingJob(),
    "add_effect": AddEffectJob(),
    "remove_effect": RemoveEffectJob(),
    "improve": ImproveJob(),
}
