"""``docs/thresholds.md`` is written by this program, from the limits themselves.

``python3 do.py docs`` runs it; a test holds the page against it.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import glovecal_models
from glovecal_models.calibration.order_confounding import TrainingLimits
from glovecal_models.ceiling.ceiling import CeilingLimits
from glovecal_models.comparison.limits import ComparisonLimits
from glovecal_models.diagnosis.limits import DiagnosisLimits
from glovecal_models.effects.base.effect import CorrectionEffect
from glovecal_models.effects.base.limits import SignificanceLimits
from glovecal_models.effects.between import TABLE
from glovecal_models.effects.catalogue import catalogue
from glovecal_models.improvement.limits import ImprovementLimits
from glovecal_models.limit import described_limits
from glovecal_models.sampling.limits import SamplingLimits

PAGE = Path(__file__).resolve().parent / "thresholds.md"
MODELS = Path(glovecal_models.__file__).resolve().parent
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

"Not tuned; chosen" means that no study or recording is known to have fixed the value. What each rule of the \
diagnosis is worth stands in [its own page](ablation.md)."""
BETWEEN = """\
## What stands between two effects

`TABLE` in `models/glovecal_models/effects/between.py`, checked when effects are loaded. An effect of your \
own brings its rows along ([An effect of your own](own-effect.md)).

Rivals: the same takes may not tell two effects apart. The recording that does is asked for when both \
are possible; where the row for the other order is different, the effect that explains more decides."""
WHOLES = """\
An effect that is known by its signature may let others seem to explain a part of it. Who saves more of the \
squared error than this share is no part of it."""
REMAINDERS = """\
What the form of an effect misses may look like another one: beside it that one has to save more \
(`beside_alike_share`), and those that it hardly looks like may save less (`beside_unlike_share`)."""
DECLARED = """\
## Declared by effects

Causes that change from take to take are held against chance by dealing the takes in other ways. Each effect \
declares the p value that suffices where it saves a clear share (`clear_share`), and where it saves less."""

WHERE_USED = """\
## Where they are used

Numbers of the diagnosis and of single effects that something is compared with, and that belong to one file \
alone. Most were chosen with the first version of their file; where a study or recordings fixed one, its \
meaning says so."""
JUDGING = ("diagnosis", "effects")
"""Folders of models whose numbers decide what is named."""


def thresholds_page() -> str:
    """The page as Markdown."""
    used = _table(("limit", "value", "file", "meaning"), [limit.row for limit in limits_where_used()])
    every = [ENTRY, *_stages(), DECLARED, _declared(), BETWEEN, *_between(), WHERE_USED, used]
    return "\n\n".join(every) + "\n"


class LimitWhereUsed(NamedTuple):
    """A number that one file compares something with."""

    name: str
    value: float
    file: str
    meaning: str

    @property
    def row(self) -> tuple[str, ...]:
        return f"`{self.name}`", f"{self.value:g}", f"`{self.file}`", self.meaning


def limits_where_used() -> Iterator[LimitWhereUsed]:
    """Constants of the files that judge, as far as a comparison reads them, there or where imported."""
    trees = {
        path: ast.parse(path.read_text(encoding="utf-8"))
        for folder in JUDGING
        for path in sorted((MODELS / folder).rglob("*.py"))
    }
    compared = {path: _compared(tree) for path, tree in trees.items()}
    elsewhere = {
        (node.module, name.name)
        for path, tree in trees.items()
        for node in tree.body
        if isinstance(node, ast.ImportFrom)
        for name in node.names
        if name.name in compared[path]
    }
    for path, tree in trees.items():
        file = path.relative_to(MODELS)
        module = ".".join((MODELS.name, *file.with_suffix("").parts))
        for name, (value, meaning) in _constants(tree).items():
            if name in compared[path] or (module, name) in elsewhere:
                yield LimitWhereUsed(name, value, file.as_posix(), meaning)


def _compared(tree: ast.Module) -> set[str]:
    """Names that a comparison reads."""
    comparisons = [node for node in ast.walk(tree) if isinstance(node, ast.Compare)]
    return {name.id for node in comparisons for name in ast.walk(node) if isinstance(name, ast.Name)}


def _constants(tree: ast.Module) -> dict[str, tuple[float, str]]:
    """Value and docstring of each number at the top of a file, by name."""
    found: dict[str, tuple[float, str]] = {}
    for node, following in zip(tree.body, [*tree.body[1:], None], strict=True):
        if not isinstance(node, ast.Assign) or not isinstance(node.targets[0], ast.Name):
            continue
        try:
            value = ast.literal_eval(node.value)
        except ValueError:
            continue
        if isinstance(value, int | float) and not isinstance(value, bool):
            said = following.value if isinstance(following, ast.Expr) else None
            text = said.value if isinstance(said, ast.Constant) and isinstance(said.value, str) else ""
            found[node.targets[0].id] = value, " ".join(text.split())
    return found


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
        if isinstance(effect, CorrectionEffect)
        and effect.comparison.changes_between_takes
        and type(effect).__module__.startswith("glovecal_models.effects.")
    ]
    by_limits: dict[Any, list[str]] = {}
    for effect in sorted(effects, key=lambda item: item.name):
        by_limits.setdefault(effect.comparison.certainty, []).append(f"`{effect.name}`")
    return _table(
        ("effects", "p value, clear", "p value, less", "why"),
        [
            (", ".join(names), f"{item.clear:g}", f"{item.faint:g}", item.why)
            for item, names in by_limits.items()
        ],
    )


def _between() -> Iterator[str]:
    by_recording: dict[tuple[str, str], list[str]] = {}
    for row in TABLE.rivals:
        by_recording.setdefault((row.effect, row.told_apart_by.name), []).append(row.rival)
    rows = [(f"`{one}`", _names(others), motion) for (one, motion), others in by_recording.items()]
    yield _table(("effect", "rivals", "recording"), rows)
    for group in TABLE.alike:
        yield (
            f"Look-alikes: {_names(group)}. What a correction of one leaves looks like the others: these are"
            " not asked for once a model has the one, and which comes first is decided by the form of the"
            " delay."
        )
    for found, other in TABLE.alike_between_levels:
        yield f"One pass over known angles held one after another cannot tell `{found}` from `{other}`."
    for found, other in TABLE.taken_for:
        yield f"What is found of `{found}` may be `{other}`: both are told where that saves error."
    for found, other in TABLE.alike_at_several:
        yield (
            f"What is found of `{found}` at one sensor and may be `{other}` is not told where that is found"
            " at others too."
        )
    yield WHOLES
    rows = [(f"`{row.effect}`", _names(row.parts), f"{row.share:g}", row.why) for row in TABLE.wholes]
    yield _table(("effect", "seem to explain a part of it", "share", "why"), rows)
    yield REMAINDERS
    rows = [(f"`{row.effect}`", _names(row.like), _names(row.unlike), row.why) for row in TABLE.remainders]
    yield _table(("beside", "have to save more", "may save less", "why"), rows)
    for effect, what in TABLE.unrecorded:
        yield f"`{effect}`: {what}."
    for effect, method in TABLE.of_the_base:
        yield f"`{effect}` is learned by the base itself with `--method {method}`."


def _names(effects: Sequence[str]) -> str:
    return ", ".join(f"`{name}`" for name in effects)


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in line)} |" for line in lines)


if __name__ == "__main__":
    PAGE.write_text(thresholds_page(), encoding="utf-8")
