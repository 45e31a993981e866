"""What the ceiling says, in sentences for people, from its result alone."""

from __future__ import annotations

from glovecal_models.ceiling.answer import LeftToGain, PossibleGain
from glovecal_models.ceiling.ceiling import Ceiling, Gain

MOST_NAMED = 4
ERROR = "error on left-out quarters of the takes"
"""The box leaves out other parts than training does, so this is not the model's held-out error."""


def ceiling_sentence(found: Ceiling) -> str:
    """The verdict with its interval and what it rests on; then the limit of recordings."""
    gain = found.overall
    return _live_sentence(found) if gain is None else f"{_live_sentence(found)} {_offline(gain)}"


def _offline(gain: Gain) -> str:
    return (
        "Live poses know the past alone; offline, with both directions of time,"
        f" {gain.offline_deg:.2f} degrees are left."
    )


def _live_sentence(found: Ceiling) -> str:
    gain = found.overall
    if found.verdict == "gain" and gain is not None:
        where = ", ".join(found.gaining[:MOST_NAMED])
        on = f" It is significant on {where}." if where else ""
        return (
            f"Something is left to gain: a black box on everything recorded takes the {ERROR} from"
            f" {gain.rmse_deg:.2f} to {gain.ceiling_deg:.2f} degrees (at most to {gain.lowest_deg:.2f},"
            f" 95 % bound; p = {gain.p_value:.2g}), mostly by {_groups(found)}.{on}"
        )
    if found.verdict == "none" and gain is not None:
        return (
            f"Nothing is left to gain from what was recorded: a black box on all of it takes at most"
            f" {_at_most(gain)} off the {ERROR} of {gain.rmse_deg:.2f} degrees."
            f" {_measurement(found)}"
        )
    return f"Whether anything is left to gain is undecided: {_why(found)}."


def left_to_gain(found: Ceiling) -> LeftToGain:
    """As answers tell it."""
    return LeftToGain(
        verdict=found.verdict,
        sentence=ceiling_sentence(found),
        overall=None if found.overall is None else _possible(found.overall),
        rotations={name: _possible(gain) for name, gain in found.rotations.items()},
        groups=found.groups,
        unrecorded=found.unrecorded,
        left_out=found.takes,
    )


def _possible(gain: Gain) -> PossibleGain:
    return PossibleGain(
        gain.rmse_deg,
        gain.ceiling_deg,
        gain.lowest_deg,
        gain.low_share,
        gain.high_share,
        gain.p_value,
        gain.offline_deg,
    )


def not_left_to_gain(found: Ceiling | None) -> list[str]:
    """What to say beside an unexplained residual; nothing where more may be left to gain."""
    if found is None or found.verdict != "none":
        return []
    return ["The sensors recorded do not know this residual: it is not left to gain."]


def _at_most(gain: Gain) -> str:
    high = max(gain.high_share, 0.0)
    return f"{high * gain.rmse_deg:.2f} degrees ({100 * high:.1f} %, upper 95 % bound)"


def _groups(found: Ceiling) -> str:
    names = list(found.groups)
    if not names:
        return "no single group of columns"
    first = found.groups[names[0]]
    told = [name for name in names if found.groups[name] >= first / 2]
    return " and ".join(told)


def _measurement(found: Ceiling) -> str:
    if not found.unrecorded:
        return "What remains only another measurement can tell."
    return f"What remains only another measurement can tell; not recorded: {', '.join(found.unrecorded)}."


def _why(found: Ceiling) -> str:
    gain = found.overall
    if found.obstacle is not None or gain is None:
        return found.obstacle or "nothing was measured"
    low, high = 100 * gain.low_share, 100 * gain.high_share
    return (
        f"a black box on everything recorded changes the {ERROR} of {gain.rmse_deg:.2f} degrees by"
        f" {-high:+.0f} to {-low:+.0f} % (95 % interval, {found.takes} takes); record more takes"
    )
