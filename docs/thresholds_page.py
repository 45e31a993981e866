"""``docs/thresholds.md`` is written by this program, from the limits themselves.

``python3 do.py docs`` runs it; a test holds the page against it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from glovecal_models.calibration.limits import TrainingLimits
from glovecal_models.ceiling.limits import CeilingLimits
from glovecal_models.comparison.limits import ComparisonLimits
from glovecal_models.diagnosis.limits import DiagnosisLimits
from glovecal_models.effects.base.limits import SignificanceLimits
from glovecal_models.effects.catalogue import catalogue
from glovecal_models.improvement.limits import ImprovementLimits
from glovecal_models.limit import described_limits
from glovecal_models.sampling.limits import SamplingLimits

PAGE = Path(__file__).resolve().parent / "thresholds.md"
STAGES: Mapping[str, type[Any]] = {
    "Effects": SignificanceLimits,
    "Diagnosis": DiagnosisLimits,
    "Noise floors and where a model fails": ComparisonLimits,
    "Ceiling": CeilingLimits,
    "Improvement": ImprovementLimits,
    "Sampling": SamplingLimits,
    "Training": TrainingLimits,
}
ENTRY = """\
# Thresholds

After this page you know every limit that decides what Glovecal tells you, and what fixed it. \
[Effects and diagnosis](effects.md) and [Compare](compare.md) say where these sentences appear.

The page is made from the code by `python3 do.py docs`. The limits are frozen dataclasses in \
`models/glovecal_models/`, one set a stage; functions such as `diagnose`, `improve` and `rotation_noise` \
take another set as `limits`. The blind study runs with other values by name; those of effects stand under \
`[diagnosis]`:

```
python3 do.py study clean --limits stricter.toml
```

```toml
[diagnosis]
clear_share = 0.3

[comparison]
at_floor_times = 1.1
```

"Not tuned; chosen" means that no study or recording is known to have fixed the value. Numerical tolerances \
and the parameters of algorithms are not listed; they stand where they are used."""
DECLARED = """\
## Declared by effects

Causes that change from take to take are held against chance by dealing the takes in other ways. Each effect \
declares the p value that suffices where it saves a clear share (`clear_share`), and where it saves less."""


def thresholds_page() -> str:
    """The page as Markdown."""
    return "\n\n".join([ENTRY, *_stages(), DECLARED, _declared()]) + "\n"


def _stages() -> Iterator[str]:
    for title, limits in STAGES.items():
        inherited = {
            name for base in limits.__bases__ if base is not object for name in described_limits(base)
        }
        found = {name: item for name, item in described_limits(limits).items() if name not in inherited}
        place = limits.__module__.replace(".", "/")
        yield f"## {title}\n\n`{limits.__name__}` in `models/{place}.py`."
        head = ("limit", "value", "unit", "meaning", "what fixed it")
        rows = [
            (f"`{name}`", f"{value:g}", about.unit, about.meaning, about.fixed_by)
            for name, (value, about) in found.items()
        ]
        yield _table(head, rows)


def _declared() -> str:
    effects = [
        effect
        for effect in catalogue().values()
        if effect.changes_between_takes and type(effect).__module__.startswith("glovecal_models.effects.")
    ]
    by_limits: dict[Any, list[str]] = {}
    for effect in sorted(effects, key=lambda item: item.name):
        by_limits.setdefault(effect.certainty, []).append(f"`{effect.name}`")
    return _table(
        ("effects", "p value, clear", "p value, less", "why"),
        [
            (", ".join(names), f"{item.clear:g}", f"{item.faint:g}", item.why)
            for item, names in by_limits.items()
        ],
    )


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in line)} |" for line in lines)


if __name__ == "__main__":
    PAGE.write_text(thresholds_page(), encoding="utf-8")
