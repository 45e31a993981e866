"""The site: README.md, docs/ and the wire format as they stand, and two references made from the code.

``docs/thresholds.md`` is made from the code too, but kept in the repository (``thresholds_page.py``).

Built by ``python3 do.py docs``. The source folder is the repository, so that a link from one page to
another is the same on the site and in the repository.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from sphinx.application import Sphinx

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

project = "Glovecal"
extensions = ["myst_parser"]
root_doc = "README"
include_patterns = [
    "README.md",
    "ARCHITECTURE.md",
    "CHANGELOG.md",
    "docs/*.md",
    "client/glovecal_client/wire/README.md",
]
exclude_patterns = [
    folder.name
    for folder in HERE.parent.iterdir()
    if folder.is_dir() and folder.name not in ("docs", "client")
]
highlight_language = "text"
smartquotes = False  # it would make one dash of the two of an option
myst_heading_anchors = 4

html_theme = "furo"
html_title = "Glovecal"
html_static_path = ["site.css"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_copyright = False
html_use_index = False
html_show_search_summary = False  # a page opened as a file may not read others: the search names them

STUDY = ["The blind study <docs/study>"] if (HERE / "study.md").exists() else []
TRIED = ("What was tried <docs/study-tried>", "What each rule is worth <docs/ablation>")
"""``python3 do.py study --page docs/study.md`` writes that page once the study has run."""

NAVIGATION = {
    "Start": ["Tutorial <docs/tutorial>", "docs/first-day", "docs/trouble", "docs/glossary"],
    "Tasks": [
        "docs/capture",
        "Gloves and their options <docs/gloves>",
        "Add your glove <docs/own-glove>",
        "Two gloves <docs/two-gloves>",
        "docs/recording-with-others",
        "docs/references",
        "The colour glove <docs/colour-glove>",
        "Train <docs/train>",
        "Template calibration <docs/template-calibration>",
        "Compare <docs/compare>",
        "docs/effects",
        "An effect of your own <docs/own-effect>",
        "In a notebook <docs/notebook>",
        "docs/studio",
        "docs/live",
        "docs/bridges",
        "docs/blender",
        "docs/exports",
        "docs/applications",
        "docs/deploy",
        "docs/keys",
        "docs/security",
        "docs/privacy",
    ],
    "Reference": [
        "Commands <docs/commands>",
        "REST <docs/rest>",
        "The library <docs/library>",
        "docs/thresholds",
        "Messages on the wire <client/glovecal_client/wire/README>",
    ],
    "Project": [
        "As measured <docs/measured>",
        "Capacity <docs/capacity>",
        "Faults <docs/faults>",
        *STUDY,
        *TRIED,
        "ARCHITECTURE",
        "CHANGELOG",
    ],
}


def _complete(app: Sphinx, page: str, source: list[str]) -> None:
    """Give the front page its navigation, and the two references what the code says."""
    from command_reference import command_reference
    from rest_reference import rest_reference

    if page == root_doc:
        source[0] += "".join(
            f"\n\n```{{toctree}}\n:hidden:\n:caption: {caption}\n\n" + "\n".join(pages) + "\n```"
            for caption, pages in NAVIGATION.items()
        )
    elif page == "docs/commands":
        source[0] += "\n\n" + command_reference()
    elif page == "docs/rest":
        with tempfile.TemporaryDirectory() as data:
            source[0] += "\n\n" + rest_reference(Path(data))


def _front_page(app: Sphinx, error: Exception | None) -> None:
    """``index.html`` leads to the front page: the site is opened as a folder, without a web server."""
    if error is None:
        leads = f'<meta http-equiv="refresh" content="0; url={root_doc}.html"><title>{project}</title>'
        (Path(app.outdir) / "index.html").write_text(f"<!doctype html>{leads}\n", encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("source-read", _complete)
    app.connect("build-finished", _front_page)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
