"""The page of ``do.py paper``: every table and figure of the paper beside ours, in one file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape

from paper_job import PaperResult
from paper_page.parts import listed
from paper_page.section import Section
from paper_parts import PARTS, PaperPart

from glovecal_service.report.html import whole_page

REMARK = (
    "The paper's figures are of a real CyberGlove on real hands. Ours are of a <b>simulated</b> glove on a "
    "simulated hand, made as hard by figures from publications (sizes of the stretch, noise, shift between "
    "wearings). What is compared is the method: whether it does for a glove of this kind what it did for "
    "theirs. Times are of different computers."
)


def paper_page(found: Mapping[str, PaperResult], *, date: str, commit: str) -> str:
    """``found``: results by the name of the job; a part without all of its jobs is told to be missing."""
    sections = {
        name: _section(part, [found[job.name] for job in part.jobs])
        for name, part in PARTS.items()
        if all(job.name in found for job in part.jobs)
    }
    parts = [
        "<h1>Wang &amp; Neff 2013 on a simulated glove</h1>",
        f'<p class="note">{REMARK}</p>',
        _quick(list(found.values())),
        f"<p>{escape(_facts(list(found.values()), date, commit))}</p>",
        _demands(list(sections.values())),
    ]
    for name, part in PARTS.items():
        parts.append(f"<h2>{escape(part.title)}</h2>")
        if name in sections:
            results = [found[job.name] for job in part.jobs]
            parts += [*sections[name].parts, f"<p><small>{escape(_computed(results))}</small></p>"]
        else:
            parts.append(f"<p>Not computed: <code>python3 do.py paper --part {name}</code>.</p>")
    return whole_page("the paper's tables and figures", parts)


def _section(part: PaperPart, results: Sequence[PaperResult]) -> Section:
    """Rows of each kind from all jobs, in the order of the jobs."""
    rows = [
        [kind(**row) for result in results for row in result.rows[name]] for name, kind in part.kinds.items()
    ]
    return part.section(*rows)


def _quick(results: Sequence[PaperResult]) -> str:
    if not any(result.quick for result in results):
        return ""
    return (
        '<p class="note">A <b>quick</b> run with few samples: it shows that everything works, its figures '
        "are not to be cited.</p>"
    )


def _facts(results: Sequence[PaperResult], date: str, commit: str) -> str:
    seeds = ", ".join(str(seed) for seed in sorted({result.seed for result in results})) or "none"
    computers = ", ".join(sorted({result.computer for result in results})) or "none"
    return (
        f"Written {date}, programs {commit}, seed {seeds}. Computer: {computers}, one BLAS thread a process."
    )


def _demands(sections: Sequence[Section]) -> str:
    demands = [demand for section in sections for demand in section.demands]
    if not demands:
        return ""
    missed = [demand.sentence() for demand in demands if not demand.is_reached]
    reached = (
        f"<p><b>{len(demands) - len(missed)} of {len(demands)}</b> figures that must be reached are.</p>"
    )
    if not missed:
        return reached
    return f'{reached}<div class="note">Missed:{listed(missed)}</div>'


def _computed(results: Sequence[PaperResult]) -> str:
    first = results[0]
    took = sum(result.took_s for result in results)
    commits = ", ".join(dict.fromkeys(result.commit for result in results))
    return f"Computed {first.computed} in {took:.0f} s, programs {commits}, seed {first.seed}."
