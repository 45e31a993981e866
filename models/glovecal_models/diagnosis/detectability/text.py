"""What a session could have shown, in sentences."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

from glovecal_models.diagnosis.detectability.confusability import Confusability, PairOfEffects
from glovecal_models.diagnosis.detectability.detection import (
    Control,
    Detectability,
    Outcome,
    SizeTried,
    lowest_probability,
)

CLEARLY, HARDLY = 0.8, 0.5
"""Of the trials: from the first on a size is said to be named, below the second not to be."""
FOUND: tuple[Outcome, ...] = ("named", "ambiguous")


def detectability_sentence(found: Detectability) -> str:
    """Which size would have been named, and which would not."""
    where = ", ".join(found.rotations)
    if found.why_not is not None:
        return f"{found.effect} cannot be tried in these takes: {found.why_not}."
    tried = [item for item in found.sizes if item.trials]
    if not tried:
        return (
            f"{found.effect} on {where} shows at no size: the static map takes it up, or it is a delay too"
            " large to be compared."
        )
    start = f"{found.effect} on {where}"
    named = _from_where(tried, "named")
    if named is not None:
        small = [item for item in tried if item.size_deg < named.size_deg and item.share("named") < HARDLY]
        sentence = f"{start}: {_size(named)} would have been named ({_count(named, 'named')})"
        if small:
            return f"{sentence}, {_size(small[-1])} would not ({_count(small[-1], 'named')})."
        if named is tried[0]:
            return f"{sentence}; no smaller size was tried."
        before = tried[tried.index(named) - 1]
        return f"{sentence}, {_size(before)} in {_count(before, 'named')}."
    in_set = _from_where(tried, *FOUND)
    if in_set is not None:
        others = sorted({name for item in tried for trial in item.trials for name in trial.named})
        rivals = ", ".join(name for name in others if name != found.effect)
        return (
            f"{start}: {_size(in_set)} would have been found ({_count(in_set, *FOUND)}), but not told apart"
            f" from {rivals}."
        )
    last = tried[-1]
    instead = ", ".join(f"{name} {times} times" for name, times in last.mistaken_for.items())
    more = f"; named instead: {instead}" if instead else ""
    return f"{start}: even {_size(last)} would not have been named ({_count(last, 'named')}{more})."


def control_sentence(control: Control) -> str:
    """What is named with nothing put in."""
    count = len(control.trials)
    if not control.named:
        return f"Control: with nothing put in nothing is named in {count} of {count} trials."
    each = ", ".join(f"{name} {times} times" for name, times in control.named.items())
    return (
        f"Control: with nothing put in, {each} in {count} trials is named all the same: so far the noise of"
        " these takes imitates an effect."
    )


def trials_sentence(trials: int) -> str:
    """How sure so few trials are."""
    return (
        f"{trials} trials a size: {trials} of {trials} mean a probability of at least"
        f" {100 * lowest_probability(trials):.0f} % (one-sided 95 % bound)."
    )


def confusability_sentences(found: Confusability) -> list[str]:
    """The pairs that are alike in these takes, each with the recording that decides; and the whole."""
    pairs = [_pair(pair) for pair in found.confused]
    if not pairs:
        largest = found.pairs[0] if found.pairs else None
        most = "" if largest is None else f"; the most alike are {_alike(largest)}"
        pairs = [f"No two effects are alike in these takes{most}."]
    return [*pairs, *_conditions(found)]


def _pair(pair: PairOfEffects) -> str:
    following = pair.next_take
    record = "" if following is None else f" To separate them, record {following.seconds} s: {following.what}"
    own = 100 * sqrt(max(1 - pair.correlation**2, 0.0))
    share = f"{own:.0f} % of what {pair.effects[0]} adds is its own"
    return f"Alike in these takes: {_alike(pair)}; {share}.{record}"


def _alike(pair: PairOfEffects) -> str:
    first, second = pair.effects
    return f"{first} and {second} (correlation {pair.correlation:.2f} on {pair.rotation})"


def _conditions(found: Confusability) -> list[str]:
    if not found.condition_of_others:
        return []
    rotation = max(found.condition_of_others, key=lambda name: found.condition_of_others[name])
    worst, limit = found.condition_of_others[rotation], found.limits.confused_condition
    beside = " (one of each such pair left out)" if found.confused else ""
    verdict = "they cannot all be separated" if worst > limit else "they can be separated"
    value = f"{worst:.0f}" if worst < 1e4 else "above 10000"
    return [
        f"Condition number of all effects together{beside}: {value} (largest, {rotation}; limit {limit:g}):"
        f" {verdict}."
    ]


def _from_where(tried: Sequence[SizeTried], *outcomes: Outcome) -> SizeTried | None:
    """The smallest size from which on every size ends so in most trials."""
    first = None
    for item in reversed(tried):
        if item.share(*outcomes) < CLEARLY:
            break
        first = item
    return first


def _size(item: SizeTried) -> str:
    return f"{item.size_deg:g} degree{'' if item.size_deg == 1 else 's'}"


def _count(item: SizeTried, *outcomes: Outcome) -> str:
    return f"{item.count(*outcomes)} of {len(item.trials)} trials"
