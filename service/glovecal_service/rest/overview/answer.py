"""What there is, and what to do next."""

from __future__ import annotations

from pydantic import Field

from glovecal_service.plain import Row


class NextStep(Row):
    sentence: str
    command: str = Field(description="At the command line.")
    page: str = Field(description="Below the studio's address.")
    label: str = Field(description="Of a button that leads there.")


class Overview(Row):
    subjects: int
    takes: int
    teaching_takes: int = Field(description="Of the newest 500, those from which a calibration can learn.")
    models: int
    active_models: int
    unfinished_jobs: int
    sentence: str
    steps: list[NextStep] = Field(description="The first one is the usual one.")


IMPORT = NextStep(
    sentence="Drop a recording of a glove on any page of the studio.",
    command="glovecal take look FILE", page="takes", label="Import a recording",
)  # fmt: skip
CONNECT = NextStep(
    sentence="Connect a glove, and see which sensor answers which finger.",
    command="glovecal find-port", page="start#connect", label="Connect a glove",
)  # fmt: skip
SIMULATED = NextStep(
    sentence="No glove at hand: a simulated one streams, and its hand moves.",
    command="glovecal capture --device simulated --glove right",
    page="start", label="Try a simulated glove",
)  # fmt: skip
DEMO = NextStep(
    sentence="Walk the demo: find the effect that a simulated glove hides, and see the error fall.",
    command="glovecal demo", page="start#hidden", label="Find a hidden effect",
)  # fmt: skip
FIRST_STEPS = (IMPORT, CONNECT, SIMULATED, DEMO)
"""Where nothing is yet."""
