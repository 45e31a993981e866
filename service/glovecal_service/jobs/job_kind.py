"""What a kind of job is: a plan of independent tasks, and what to do with their results.

A new kind is one module with a ``JobKind`` and one line in ``questions/catalogue.py``.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from safetensors.numpy import load as load_arrays
from safetensors.numpy import save as save_arrays

from glovecal_models.progress import Cancel

if TYPE_CHECKING:
    from glovecal_service.store import Store
    from glovecal_service.store.records import JobRecord


@dataclass(frozen=True)
class TaskResult:
    """What a task computed, in the form in which it travels and a file can hold it."""

    arrays: dict[str, np.ndarray]
    facts: dict[str, Any]
    """JSON-able."""

    def to_bytes(self) -> bytes:
        """As safetensors, in which there is nothing to run."""
        return save_arrays(self.arrays, {"facts": json.dumps(self.facts, allow_nan=False)})

    @classmethod
    def from_bytes(cls, content: bytes) -> TaskResult:
        """Raises SafetensorError, KeyError or ValueError where ``to_bytes`` did not make it."""
        header = json.loads(content[8 : 8 + int.from_bytes(content[:8], "little")])
        return cls(load_arrays(content), json.loads(header["__metadata__"]["facts"]))


class TaskReport(Protocol):
    """How a task says how far it is: a ``Report`` that may give more than its sentence."""

    def __call__(self, sentence: str, share: float, detail: Mapping[str, Any] = ..., /) -> None:
        """``share`` of this task, 0 to 1. ``detail``: JSON-able, becomes the job's."""
        ...


@dataclass(frozen=True)
class Task:
    """One unit of work for one worker process."""

    key: str
    """Names the result: data, settings and software version hashed. A finished key is never run again."""
    label: str
    """For messages: ``I_PIP`` or ``I_PIP, fold 2``."""
    function: Callable[[Any, Cancel, TaskReport], TaskResult]
    """A function of a module (workers import it); polls the second argument and raises Cancelled. A long one
    says to the third how far it is."""
    payload: Any
    """Its first argument: plain dataclasses, numbers, texts and arrays."""
    effort: float | None = None
    """How long it takes beside the job's other tasks. None: nobody knows, and no time left is told."""


@dataclass(frozen=True)
class Step:
    """Where a job stands after a task."""

    sentence: str
    detail: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class JobPlan:
    tasks: Sequence[Task]
    step: Callable[[int, Mapping[int, TaskResult]], Step]
    """Given the number of the task that just finished and all results so far."""
    finish: Callable[[Sequence[TaskResult]], dict[str, Any]]
    """Given the results in the order of ``tasks``; its answer is the job's result. May run more than once."""
    in_this_process: bool = False
    """Tasks so short that starting workers for them would take longer than they do."""


class JobKind(Protocol):
    def plan(self, store: Store, job: JobRecord) -> JobPlan:
        """Lay out the work. Raises BadInput, NotFound ... with a sentence for the user."""
        ...
