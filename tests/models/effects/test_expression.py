"""The language of declared effects: what it computes, and what it refuses with which words."""

from __future__ import annotations

import ast
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glovecal_models.effects.declared.declaration import Declaration
from glovecal_models.effects.declared.expression_effect import Evaluation, Memory
from glovecal_models.errors import BadInput
from glovecal_models.expression import check_names, parse_expressions


def worth(text: str, **names: float) -> float:
    """The value of one expression in one frame."""
    [node] = parse_expressions(text)
    arrays = {name.replace("c_", "c."): np.array([[value]]) for name, value in names.items()}
    return float(Evaluation(arrays, np.zeros(1), 1, Memory()).value(node)[0, 0])


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1 + 2 * 3 - 4 / 2", 5.0),
        ("(1 + 2) * 3", 9.0),
        ("2 - 3 - 4", -5.0),
        ("24 / 4 / 2", 3.0),
        ("-2 ^ 2", -4.0),
        ("2 ^ 3 ^ 2", 512.0),
        ("2 ^ -1", 0.5),
        ("--3 + +2", 5.0),
        ("1.5e2 + .5 + 2.", 152.5),
        ("exp(1) + log(2) + sqrt(9)", math.e + math.log(2) + 3),
        ("abs(-2) + tanh(0.5) + sin(1) + cos(1)", 2 + math.tanh(0.5) + math.sin(1) + math.cos(1)),
        ("min(2, 3) + max(2, 3) * 10 + clip(7, 0, 5) * 100", 532.0),
        ("c.strap_n * own", 21.0),
    ],
)
def test_arithmetic(text, value):
    assert worth(text, own=7.0, c_strap_n=3.0) == pytest.approx(value, rel=1e-15)


def joined(parts: tuple[str, str, str]) -> str:
    return f"({''.join(parts)})"


NUMBERS = st.floats(0.125, 8).map(lambda value: f"{value:.3f}")
SUMS = st.recursive(
    NUMBERS, lambda inner: st.tuples(inner, st.sampled_from("+-*"), inner).map(joined), max_leaves=12
)


@given(SUMS)
def test_it_agrees_with_python(text):
    assert worth(text) == pytest.approx(by_python(ast.parse(text, mode="eval").body), rel=1e-12, abs=1e-12)


@given(st.lists(st.sampled_from([*"+-*/^(),. 17e", "own", "c.x", "exp(", "lowpass(", "min("]), max_size=40))
def test_any_text_is_read_or_refused(pieces):
    text = "".join(pieces)
    try:
        nodes = parse_expressions(text)
    except BadInput as refused:
        assert str(refused).startswith("expression: ")  # noqa: PT017
    else:
        names = {name: np.array([[0.5]]) for node in nodes for name in node.names}
        evaluation = Evaluation(names, np.zeros(1), 1, Memory())
        values = [float(evaluation.value(node)[0, 0]) for node in nodes]
        assert not any(np.isinf(values))
        assert evaluation.undefined is not None or not any(np.isnan(values))


def by_python(node: ast.AST) -> float:
    """The value of Python's own syntax tree."""
    if isinstance(node, ast.BinOp):
        left, right = by_python(node.left), by_python(node.right)
        return {ast.Add: left + right, ast.Sub: left - right, ast.Mult: left * right}[type(node.op)]
    assert isinstance(node, ast.Constant)
    return float(str(node.value))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("own *", "expected a number, a name or '\\(', not 'the end' at character 6"),
        ("", "not 'the end' at character 1"),
        ("own own", "expected an operator, a comma or the end, not 'own' at character 5"),
        ("own $ 2", "cannot read '\\$ 2' at character 5"),
        ("(own", "expected '\\)', not 'the end'"),
        ("open(own)", "no function 'open'; there are exp, log"),
        ("own.__class__", "cannot read '.__class__'"),
        ("sin own", "expected '\\('"),
        ("clip(own, 1)", "clip takes 3 arguments, not 2"),
        ("1e999", "1e999 is too large a number"),
        ("(" * 40 + "1" + ")" * 40, "at most 30 levels deep"),
        ("-" * 60 + "1", "at most 30 levels deep"),
        ("^".join("2" * 60), "at most 30 levels deep"),
        ("+".join("1" * 150), "at most 200 parts"),
        ("1" * 501, "at most 500 characters, this has 501"),
    ],
)
def test_what_cannot_be_read_is_named(text, message):
    with pytest.raises(BadInput, match=message):
        parse_expressions(text)


def test_unknown_names_are_answered_with_the_known_ones():
    nodes = parse_expressions("own + c.grip, THUMB")
    assert [name for node in nodes for name in node.names] == ["own", "c.grip", "THUMB"]
    with pytest.raises(BadInput, match=r"e: no context column 'c.grip'; known are own, c.load"):
        check_names(nodes, ["own", "c.load"], source="e")
    with pytest.raises(BadInput, match=r"e: no signal or parameter 'THUMB'; known are own, c.grip"):
        check_names(nodes, ["own", "c.grip"], source="e")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("columns = own", "name is missing; write name = ..."),
        ("name = a", "columns is missing; write columns = ..."),
        ("name = A b; columns = own", "'A b' is not allowed"),
        ("name = a; columns = own; colour = red", "cannot read 'colour = red'; write name"),
        ("name = a; name = b; columns = own", "name is given twice"),
        ("name = a; columns = own; parameter tau s 1", "write parameter NAME UNIT LOW HIGH = START"),
        ("name = a; columns = own; parameter tau s 5 1", "needs low < high and a start between"),
        ("name = a; columns = own; parameter tau s one 2", "must be a number, not 'one'"),
        ("name = a; columns = own; parameter own s 1 2", "cannot be called 'own'; that name is taken"),
        ("name = a; columns = own; parameter x 1 1 2; parameter y 1 1 2; parameter z 1 1 2",
         "at most 2 parameters"),
        ("name = a; columns = own; range strap 0 1", "write range c.NAME LOW HIGH"),
        ("name = a; columns = own; range c.strap 0 1", "a range is given for c.strap, which no column reads"),
        ("name = a; columns = c.x; range c.x 2 1", "the range of c.x must rise, not 2 to 1"),
        ("name = a; columns = own; control = lies", "no control 'lies'; there are time-reversed"),
        ("name = a; columns = own; unit = very long unit", "a unit is a short word"),
        ("name = a; columns = lowpass(own, own)", "time constant 'own' of a low pass may hold numbers"),
        ("name = a; columns = own,own,own,own,own,own,own,own,own", "at most 8 columns, not 9"),
        ("x" * 2001, "at most 2000 characters"),
    ],
)  # fmt: skip
def test_a_wrong_declaration_is_answered_with_what_would_be_right(text, message):
    with pytest.raises(BadInput, match=message):
        Declaration.parse(text)


def test_text_and_document_say_the_same():
    text = """
        name = strap
        columns = c.strap_n * own, lowpass(c.strap_n, tau) + INDEX
        unit = deg/N; parameter tau s 0.1 5 = 1; range c.strap_n 0 50
        control = context of other takes; explanation = The strap presses.
    """
    declared = Declaration.parse(text)
    assert declared.signals == ("INDEX",)
    assert declared.context == ("strap_n",)
    assert declared.ranges == (("strap_n", 0.0, 50.0),)
    assert declared.starts == (1.0,)
    assert declared.control == "context of other takes"
    again = Declaration.from_document(declared.to_document())
    assert again.to_document() == declared.to_document()
    assert again == declared


@pytest.mark.parametrize(
    "document",
    [
        {"name": "a", "columns": ["own"]},
        {"name": "a", "columns": "own", "parameters": "tau"},
        {"name": "a", "columns": "own", "parameters": [{"name": "tau", "low": 0.0, "high": float("nan")}]},
        {"name": "a", "columns": "c.x", "ranges": {"x": 3}},
        {"name": "a", "columns": "own", "evil": 1},
        {"name": 7, "columns": "own"},
    ],
)
def test_a_wrong_document_is_refused(document):
    with pytest.raises(BadInput):
        Declaration.from_document(document)
