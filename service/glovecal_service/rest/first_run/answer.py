"""What somebody without a glove can try, as REST gives it."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from glovecal_service.plain import Row


class SimulatedGloveView(Row):
    glove: str
    subject: str = Field(description="Who wears it: nobody, it is simulated.")
    is_on: bool
    sentence: str = Field(description="The last that its capture said: why it ended by itself.")
    left_s: float = Field(description="Until it ends by itself.")
    job: str | None = Field(description="That trains the model of its hand, while it runs.")
    model: str | None = Field(description="From which its poses come; null while that is trained.")


class HiddenEffectView(Row):
    """A simulated subject in whose glove one effect of the catalogue is hidden."""

    subject: str
    seed: int = Field(description="`glovecal demo --seed` hides the same effect in the same glove.")
    job: str | None = Field(description="That trains the first model, while it runs.")
    models: list[str] = Field(description="The subject's, oldest first: the first knows of no effect.")
    added: list[str] = Field(description="Effects of the newest version that has any.")
    verdict: Literal["right", "partly right", "wrong"] | None = Field(
        description="Null until an effect was added."
    )
    sentences: list[str] = Field(
        description="Whether what was added is what was hidden, and what that was: empty until an effect was "
        "added, or `reveal` was asked for."
    )
