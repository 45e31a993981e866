"""One description of a result gives its text, its HTML and its frame."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec

import numpy as np
import pytest

import glovecal
from glovecal._table import Column, Table
from glovecal_models.installation import not_installed

TABLE = Table.of(
    [Column("name"), Column("rmse_deg", 1), Column("frames"), Column("significant")],
    [("a<b", 1.25, 10, True), ("c", None, 7, False), ("d", float("nan"), 0, True)],
    before=["Title & more"],
    after=["A sentence."],
)


@pytest.fixture
def results(session, model, takes):
    return [session, takes, model, glovecal.predict(model, takes[0]), glovecal.effects()]


def test_the_text_is_a_table():
    assert TABLE.to_text().splitlines() == [
        "Title & more",
        "",
        "name  rmse_deg  frames  significant",
        "a<b        1.2      10          yes",
        "c            -       7           no",
        "d            -       0          yes",
        "",
        "A sentence.",
    ]


def test_the_html_is_escaped():
    text = TABLE.to_html()
    assert "a&lt;b" in text
    assert "Title &amp; more" in text
    assert "a<b" not in text


def test_a_name_from_outside_cannot_write_into_the_page():
    take = glovecal.Take("<script>alert(1)</script>", "", ("S",), np.arange(3.0), np.zeros((3, 1)))
    assert "<script>" not in glovecal.Takes([take])._repr_html_()


def test_long_and_wide_tables_are_cut_where_they_are_printed():
    rows = [tuple(float(value) for value in range(20)) for _ in range(500)]
    table = Table.of([Column(f"c{number}") for number in range(20)], rows)
    lines = table.to_text().splitlines()
    assert len(lines) == 12
    assert lines[0].split() == [*(f"c{number}" for number in range(12)), "..."]
    assert len(table.rows) == 500


def test_every_result_shows_the_same_columns_everywhere(results):
    for result in results:
        table = result.table()
        assert all(len(row) == len(table.columns) for row in table.rows)
        assert str(result) == repr(result) == table.to_text()
        for name in table.names[:5]:
            assert name in str(result)
            assert f">{name}</th>" in result._repr_html_()


def test_what_changed_a_model_is_printed_and_shown_with_its_pictures(addition, improvement):
    for result, there in ((addition, addition.sentence), (improvement, "hysteresis on I_PIP")):
        assert str(result) == repr(result)
        assert there in str(result)
        assert there in result._repr_html_()
        assert ("<svg" in result._repr_html_()) is (find_spec("matplotlib") is not None)
    if find_spec("pandas") is not None:
        frame = addition.to_frame()
        assert list(frame["rotation"]) == ["I_PIP"]
        assert frame["after_rmse_deg"][0] < frame["before_rmse_deg"][0]
        assert list(improvement.to_frame()["rmse_deg"]) == [*improvement.rmse_deg]


def test_an_answer_is_printed_and_shown_with_its_pictures(model, takes, diagnosis):
    compared, failures = glovecal.compare(model, takes), glovecal.where(model, takes)
    found = (compared, "NLPD"), (failures, failures.rotations[0].sentence), (diagnosis, "is missing")
    for result, there in found:
        assert str(result) == repr(result)
        assert there in str(result)
        assert there in result._repr_html_()
        assert ("<svg" in result._repr_html_()) is (find_spec("matplotlib") is not None)
    if find_spec("pandas") is not None:
        frame = compared.to_frame()
        assert list(frame["rotation"]) == [*compared.rotations, "all rotations"]
        assert list(frame["rmse_deg"]) == [*compared.per_rotation_deg.values(), compared.rmse_deg]
        assert list(failures.to_frame()["rotation"]) == [item.rotation for item in failures.rotations]
        tried = diagnosis.to_frame()
        assert list(tried.columns) == [
            *("effect", "rotations", "rmse_deg", "with_effect_rmse_deg", "with_control_rmse_deg"),
            *("p_value", "significant"),
        ]
        assert list(tried["effect"]) == [item.effect for item in diagnosis.inner.ranked_assessments]
        assert list(tried["rmse_deg"]) == [
            item.rmse_deg.before for item in diagnosis.inner.ranked_assessments
        ]


def test_a_frame_or_the_sentence(results):
    for result in results:
        if find_spec("pandas") is None:
            with pytest.raises(ImportError, match=r"pip install .*pandas"):
                result.to_frame()
        else:
            frame = result.to_frame()
            assert tuple(frame.columns) == result.table().names
            assert len(frame) == len(result.table().rows)


def test_what_is_hidden_in_a_session_is_not_told(session):
    assert "SIMULATED" in str(session)
    assert "hysteresis" not in str(session)


def widths(axes) -> list[float]:
    """Of all bars."""
    return [bar.get_width() for bar in axes.patches]


@pytest.mark.usefixtures("drawn")
def test_pictures_give_their_axes_back(model, takes, diagnosis, addition, improvement):
    from matplotlib import pyplot
    from matplotlib.axes import Axes

    comparison, failures = glovecal.compare(model, takes), glovecal.where(model, takes)
    angles = glovecal.predict(model, takes[0])
    for result in (comparison, failures, diagnosis, addition, improvement, angles):
        assert isinstance(result.plot(), Axes)
        _, ax = pyplot.subplots()
        assert result.plot(ax=ax) is ax
        assert ax.get_xlabel()
        assert ax.get_legend() is not None
    assert widths(comparison.plot()) == pytest.approx([*comparison.per_rotation_deg.values()])
    assert [bar.get_height() for bar in improvement.plot().containers[0]][-2:] == pytest.approx(
        improvement.rmse_deg
    )
    assert failures.plot("I_MCP", "speed").get_xlabel() == "speed (deg/s)"
    assert angles.plot(["I_PIP"]).get_legend_handles_labels()[1] == ["I_PIP"]


@pytest.mark.usefixtures("drawn")
def test_what_was_not_tested_is_not_drawn(model, takes):
    failures = glovecal.where(model, takes)
    with pytest.raises(glovecal.BadInput, match="no rotation 'THUMB' was measured; there are"):
        failures.plot("THUMB")
    with pytest.raises(glovecal.BadInput, match="column 'moon' was not tested; there are"):
        failures.plot(column="moon")
    with pytest.raises(glovecal.BadInput, match="no rotation 'THUMB' was predicted"):
        glovecal.predict(model, takes[0]).plot(["THUMB"])


def test_without_pandas_and_matplotlib_a_sentence_says_what_to_install():
    program = """
import sys
class Block:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in ("pandas", "matplotlib"):
            raise ImportError("blocked: " + name)
sys.meta_path.insert(0, Block())
import glovecal
takes = glovecal.simulate(None, sensors=["I_PIP"], wearings=1, takes_per_wearing=2, take_s=5.0).takes
result = glovecal.compare(glovecal.train(takes, method="linear", folds=0), takes)
for call in (result.to_frame, result.plot):
    try:
        call()
    except ImportError as error:
        print(error)
"""
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert run.stdout.splitlines() == [
        not_installed("to_frame()", "pandas"),
        not_installed("plot()", "matplotlib"),
    ]
