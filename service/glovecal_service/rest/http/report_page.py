"""An answer with its pictures, as one HTML file or as a PDF file."""

from __future__ import annotations

import re
from typing import Annotated, Any, Literal

from fastapi import Query, Response

from glovecal_models.presentation.document import Presentation

ReportFormat = Annotated[
    Literal["html", "pdf"],
    Query(alias="format", description="One HTML file that needs nothing else, or PDF."),
]
REPORT: dict[int | str, dict[str, Any]] = {
    200: {
        "description": "The report; each picture has a sentence that says what it shows.",
        "content": {
            "text/html": {"schema": {"type": "string"}},
            "application/pdf": {"schema": {"type": "string", "format": "binary"}},
        },
    }
}
"""What such a route answers."""


def report_response(shown: Presentation, form: Literal["html", "pdf"]) -> Response:
    if form == "html":
        from glovecal_service.report.html import page_of  # draws: few requests need it

        return Response(page_of(shown), media_type="text/html; charset=utf-8")
    from glovecal_service.report.pdf import pdf_of

    name = re.sub(r"[^A-Za-z0-9]+", "-", shown.title).strip("-")[:80] or "report"
    headers = {"Content-Disposition": f'inline; filename="{name}.pdf"'}
    return Response(pdf_of(shown), media_type="application/pdf", headers=headers)
