"""What every rule is worth, as a page: verdicts that it puts right and that it spoils, with intervals."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from ablation_answer import OFF
from blind_glove import BlindGlove
from diagnosis_answer import NOTHING
from glove_jobs import Row
from intervals import clopper_pearson
from naming_figures import SAME_IN_TAKES
from scipy.stats import binomtest

from glovecal_models.diagnosis.rules import RULES

HEAD = """\
# What each rule of the diagnosis is worth

After this page you know every rule by which the diagnosis decides, in the order in which it is asked, and \
how many verdicts it puts right or spoils on gloves and recordings.

A diagnosis is a list of rules (`models/glovecal_models/diagnosis/rules.py`): evidence first, then rules \
that discount it, rank it and add rivals. `glovecal diagnose --explain` prints the ones that decided. \
`python3 do.py study ablation` asks the same gloves with all rules and without each, from the evidence on.

A glove is asked twice where its first name is right: by its takes alone, and beside that effect, as \
`improve` asks. A verdict is right where

- the name is: the hidden effect first, nothing on a healthy glove, nothing beside a right effect (of two \
hidden ones: the other one);
- nothing else is named first: the right name, or none;
- the set is: it has what is hidden, and is empty where nothing is;
- it is single: the name is right and no other is possible;
- the alarm is: none on a healthy glove and after a right name, one where a cause outside the catalogue is \
hidden.

+3 -1 means: right on three gloves only with the rule, on one only without it. The gain is their \
difference over names, in percent of the gloves that were asked, with the exact 95 % interval of a binomial \
among the gloves that changed. A rule pays where names and alarms together, or sets, are put right \
significantly more often than spoiled (two-sided sign test, p <= 0.05). A rule of which too few gloves tell \
is kept.

Not asked here: a camera as the reference (`python3 do.py study camera`), which alone the rule `camera` is \
of. `rare_share`, `beside_known_rest_share` and `own_column` were fixed on one to three gloves; the tables \
say on how many others they decide. Set-aside forms were read here once more, and prove less since.\
"""
KINDS = ("name", "nothing else", "set", "single", "alarm")
GROUPS = ("open", "set-aside", "real")
MEMBERS_OF_PAIR = 2
SIGNIFICANT = 0.05


@dataclass(frozen=True)
class Judged:
    """One verdict with a rule, and without it."""

    group: str
    rule: str
    right: dict[str, bool]
    without: dict[str, bool]

    def changed(self, kind: str) -> int:
        """1 where only the rule makes it right, -1 where it spoils it, else 0; 0 where one of both is not
        judged."""
        if kind not in self.right or kind not in self.without:
            return 0
        return int(self.right[kind]) - int(self.without[kind])


def ablation_page(
    rows: Sequence[Row], recorded: Sequence[tuple[Any, str | None, dict[str, Any]]], software: str
) -> str:
    """Markdown. ``recorded``: real recordings, what is true of each, and its verdicts."""
    judged = [*_of_gloves(rows), *_of_recordings(recorded)]
    gloves = {group: sum(_group(glove) == group for glove, _ in rows) for group in GROUPS[:2]}
    told = (
        f"{gloves['open']} gloves with open forms, without a cause or with one outside the catalogue, "
        f"{gloves['set-aside']} with set-aside forms, {len({item.name for item, _, _ in recorded})} real"
        f" recordings; effects at 1.3 noise floors, two at once at 2.6; programs `{software[:10]}`."
    )
    names = [rule.name for rule in RULES if not rule.is_evidence]
    rules = _table(names, judged, gloves)
    limits = _table(list(OFF), judged, gloves)
    why = "\n".join(f"- `{rule.name}`: {_meaning(rule)}" for rule in RULES)
    return (
        "\n\n".join(
            [
                HEAD,
                told,
                "## Rules",
                rules,
                "## Limits that are a rule by themselves",
                limits,
                "## What each does",
                why,
            ]
        )
        + "\n"
    )


def _meaning(rule: Any) -> str:
    return " ".join((rule.apply.__doc__ or "").split())


def _table(names: Sequence[str], judged: Sequence[Judged], gloves: dict[str, int]) -> str:
    head = [
        "rule",
        "decided on (open, set-aside, real)",
        *KINDS,
        "gain in names, open",
        "gain in names, set-aside",
        "so far",
    ]
    lines = [head, ["---"] * len(head)]
    for name in names:
        mine = [item for item in judged if item.rule == name]
        fired = ", ".join(str(sum(item.group == group for item in mine)) for group in GROUPS)
        counts = [_counts([item.changed(kind) for item in mine]) for kind in KINDS]
        gains = [
            _gain([item.changed("name") for item in mine if item.group == group], gloves[group])
            for group in GROUPS[:2]
        ]
        lines.append([f"`{name}`", fired, *counts, *gains, _so_far(mine)])
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _so_far(mine: Sequence[Judged]) -> str:
    """What the counts say of a rule in ``mine``, the verdicts on which it decided."""
    if not mine:
        return "never decided"
    changed = {kind: [item.changed(kind) for item in mine] for kind in KINDS}
    told = [*changed["name"], *changed["alarm"]]
    for some in (told, changed["set"]):
        better, worse = some.count(1), some.count(-1)
        if better + worse and binomtest(better, better + worse).pvalue <= SIGNIFICANT:
            return "pays" if better > worse else "costs"
    if not any(any(some) for some in changed.values()):
        most = clopper_pearson(0, len(mine))[1]
        return f"put no verdict right or wrong (with 95 %: fewer than {100 * most:.0f} % of those it decides)"
    return "too few"


def _counts(changed: Sequence[int]) -> str:
    better, worse = changed.count(1), changed.count(-1)
    return f"+{better} -{worse}" if better or worse else "0"


def _gain(changed: Sequence[int], total: int) -> str:
    """Percent of all gloves; the interval is of the share among those that changed."""
    better, worse = changed.count(1), changed.count(-1)
    both = better + worse
    if not total:
        return ""
    if not both:
        return "0 %"
    low, high = (100 * (2 * share - 1) * both / total for share in clopper_pearson(better, both))
    return f"{100 * (better - worse) / total:+.1f} % ({low:+.1f} to {high:+.1f} %)"


def _of_gloves(rows: Sequence[Row]) -> Iterator[Judged]:
    for glove, answer in rows:
        alone = list(answer["right"])
        left = [name for name in alone if name not in answer.get("known", ())]
        for part, right in (("alone", alone), ("beside", left)):
            if part in answer:
                yield from _judged(_group(glove), answer[part], right, glove)


def _of_recordings(recorded: Sequence[tuple[Any, str | None, dict[str, Any]]]) -> Iterator[Judged]:
    for _, truth, answer in recorded:
        yield from _judged("real", answer, [] if truth is None else [truth], None)


def _judged(
    group: str, answer: dict[str, Any], right: Sequence[str], glove: BlindGlove | None
) -> Iterator[Judged]:
    usual = answer["with"]
    for name in dict.fromkeys((*answer["fired"], *answer["without"])):
        other = answer["without"].get(name, usual)
        yield Judged(group, name, _marks(usual, right, glove), _marks(other, right, glove))


def _marks(told: dict[str, Any], right: Sequence[str], glove: BlindGlove | None) -> dict[str, bool]:
    """Which parts of a verdict are right; an alarm is judged where it is known whether it should be."""
    first, members = told["first"], told["confidence_set"]
    is_right = first in right if right else first == NOTHING
    if SAME_IN_TAKES & set(right) and SAME_IN_TAKES & set(members):
        is_right = first in SAME_IN_TAKES
    may_be_silent = glove is not None and glove.linear and glove.truth == "none"
    is_right = is_right or (may_be_silent and first == NOTHING)
    inside = bool(set(right) & set(members)) if right else not members
    marks = {
        "name": is_right,
        "nothing else": is_right or first == NOTHING,
        "set": inside or may_be_silent,
        "single": is_right and len(members) < 2,
    }
    if glove is not None and (glove.truth == "none" or (is_right and not _loses_angle(glove))):
        marks["alarm"] = told["alarm"] is _is_outside(glove)
    return marks


def _group(glove: BlindGlove) -> str:
    return "set-aside" if glove.set_aside else "open"


def _is_outside(glove: BlindGlove) -> bool:
    return glove.truth.startswith("unknown:") and glove.column is None


def _loses_angle(glove: BlindGlove) -> bool:
    """Whether no model explains what is hidden: two causes, of which one is left, or a lost angle."""
    return len(glove.causes) >= MEMBERS_OF_PAIR or glove.truth in (
        "saturation",
        "sensor_fault",
        "garment_slip",
    )
