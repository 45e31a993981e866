"""The unexplained residual and its associations, on the page and on the terminal, from a real diagnosis."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glovecal_models.diagnosis.answer import MissingEffects
from glovecal_models.diagnosis.diagnose import diagnose
from glovecal_models.diagnosis.text import missing_effects
from glovecal_models.layout import Layout
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_service.cli.terminal.presenting import present
from glovecal_service.plain import document_of
from glovecal_service.report.html import page_of

SENSORS = ("I_MCP", "I_PIP")


@pytest.fixture(scope="module")
def found() -> MissingEffects:
    """A strap pulls at one sensor, by turns; two wearings."""
    plan = SessionPlan(seed=31, sensors=SENSORS, wearings=2, takes_per_wearing=3, take_s=25.0)
    takes = []
    for number, take in enumerate(record_session(plan, ()).takes):
        pull = np.sin(take.time_s * (0.9 + 0.1 * number) + number)
        readings = take.readings + 5.0 * pull[:, None] * np.array([0.0, 1.0])
        takes.append(replace(take, readings=readings, context={"strap_n": pull}))
    return missing_effects(diagnose(takes, Layout.from_columns("two", SENSORS, SENSORS), effects=[]))


def test_the_document_has_size_and_p_value(found):
    first = document_of(found)["unexplained_residual"]["associations"][0]
    assert (first["rotation"], first["column"]) == ("I_PIP", "context strap_n")
    assert first["size_deg"] > 0.5
    assert first["p_value"] <= 0.02


def test_the_page_shows_the_columns(found):
    page = page_of(found.presentation())
    assert "unexplained residual is associated with</th>" in page
    assert "c.strap_n" in page


def test_the_command_line_shows_the_columns(found, capsys):
    present(found.presentation())
    printed = capsys.readouterr().out
    assert "No known effect explains the residual" in printed
    assert "residual is associated with" in printed
    assert "c.strap_n" in printed
