"""What is asked of every answer of REST, whatever was sent and whatever is broken."""

from __future__ import annotations

import json
import re

import httpx
import pytest
from wild_requests import Operation

NOT_WORKING = {"GET /v1/health/ready": 503}
"""Real time is another process, which these tests do without."""
FOREIGN = re.compile(
    r"Traceback|\w+Error\b|Exception|Errno|object has no|not supported between|codec can't|Expecting \w|"
    r"Input should|Field required|should match|numpy|pydantic|sqlalchemy|psycopg|sqlite3\.|<class|"
    r"0x[0-9a-f]{6}|NoneType|invalid literal|could not convert|unhashable|list index|truth value|"
    r"operands|broadcast|recursion|unexpected keyword|positional argument|magic number|"
    r"Expected '='|mismatched tag|not well-formed|Invalid control|parquet magic|Exceeds the limit"
)
"""Words of Python and of libraries, which are for the log."""
REMEDY = re.compile(
    r"\b(give|use|send|name|choose|ask|leave|needs?|needed|expected|must|at most|at least|there (is|are)|"
    r"it has|they have|has no|have no|stop|start|record|train|import|makes?|remove|correct|save|try|free|"
    r"is no|is a|is it|not found|does not answer|look|allowed|answers to|belongs|already|between|columns are|"
    r"write|begin|says why|divide|only|first|cannot|nothing)\b"
)


def require_lawful(operation: Operation, answer: httpx.Response) -> None:
    if answer.status_code >= 400:
        allowed = NOT_WORKING.get(str(operation))
        assert answer.status_code < 500 or answer.status_code == allowed, answer.text[:500]
        for sentence in sentences_of(answer):
            assert REMEDY.search(sentence), sentence


def sentences_of(answer: httpx.Response) -> list[str]:
    """Of a problem document; each is ours."""
    problem = json.loads(answer.text, parse_constant=lambda word: pytest.fail(f"{word} in an answer"))
    sentences = [problem["detail"], *(item["problem"] for item in problem.get("errors", []))]
    for sentence in sentences:
        assert len(sentence) > 20 or problem["type"].endswith("invalid-request"), problem
        assert not FOREIGN.search(sentence), sentence
    assert len(answer.content) < 20_000
    return sentences
