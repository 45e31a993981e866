"""Table 1 of Wang & Neff 2013, the independence examination, on the simulated glove beside the paper's own.

The paper's glove is real, ours is simulated: its cloth was given the sizes of this very table (stretch.py),
so what is reproduced is the examination, which sees only readings. As in the paper one rotation is kept still
while each neighbour moves alone, then all at once. The simulated palm adds up the pulls of its nine
neighbours, the real one does less when they move together.

    python tests/paper/table_1.py
"""

from __future__ import annotations

from dataclasses import dataclass

from still_take import still_take

from glovecal_models.independence.answer import ExaminedRotation, Independence
from glovecal_models.independence.independence import examine_independence
from glovecal_models.simulation.simulated_glove import SimulatedGlove
from glovecal_models.simulation.simulated_hand import TABLE_1

PAPER_IN_ALL: dict[str, tuple[float, float]] = {
    "TI_ABD": (9.6, 25.4),
    "IM_ABD": (45.7, 114.2),
    "MR_ABD": (42.5, 120.4),
    "RP_ABD": (22.7, 93.8),
    "PALM_ARCH": (21.2, 76.1),
    "W_FLEX": (13.6, 37.5),
    "W_ABD": (6.5, 26.3),
}
"""Standard and largest deviation, per cent of the active range, with all neighbours moving."""
TOGETHER_S, ALONE_S, RANGE_S = 30.0, 8.0, 8.0


@dataclass(frozen=True)
class Table1Row:
    """Per cent of the active range; ``affecting`` None is the line for all neighbours at once."""

    rotation: str
    affecting: str | None
    paper_std_pct: float
    paper_max_pct: float
    std_pct: float
    max_pct: float
    interval_pct: tuple[float, float] | None
    """95 % interval of the standard deviation; None for all at once."""
    is_named: bool
    """Found cross-coupled, or named as affecting, as the paper did."""


def table_1(seed: int = 1) -> list[Table1Row]:
    """The paper's rows, in its order, from a simulated glove."""
    found = examined(seed)
    rows = []
    for rotation in TABLE_1:
        item = found.of(rotation)
        if item is None:
            why = "; ".join(found.sentences)
            raise RuntimeError(f"{rotation} was not examined: {why}")
        paper = PAPER_IN_ALL[rotation]
        rows.append(Table1Row(rotation, None, *paper, item.std_pct, item.max_pct, None, item.is_coupled))
        rows += _own_shares(item)
    return rows


def examined(seed: int) -> Independence:
    """All takes of the examination, readings alone."""
    glove = SimulatedGlove(seed)
    still = [
        still_take(glove, rotation, tuple(others), name=f"still-{rotation}", seconds=TOGETHER_S)
        for rotation, others in TABLE_1.items()
    ]
    still += [
        still_take(glove, rotation, (other,), name=f"still-{rotation}-move-{other}", seconds=ALONE_S)
        for rotation, others in TABLE_1.items()
        for other in others
    ]
    ranges = [still_take(glove, None, (r,), name=f"range-{r}", seconds=RANGE_S) for r in glove.sensors]
    return examine_independence(glove.layout, still, ranges)


def _own_shares(item: ExaminedRotation) -> list[Table1Row]:
    shares = {share.sensor: share for share in item.affecting}
    rows = []
    for other, (std, largest) in TABLE_1[item.rotation].items():
        share = shares.get(other)
        if share is None:
            rows.append(Table1Row(item.rotation, other, std, largest, 0.0, 0.0, None, False))
            continue
        interval = (share.std_low, share.std_high)
        named = share.affects != "no"
        rows.append(
            Table1Row(item.rotation, other, std, largest, share.std_pct, share.max_pct, interval, named)
        )
    return rows


def main() -> None:
    print(
        "Table 1: % of the active range, standard | largest deviation (paper: a real glove; ours: simulated)"
    )
    print(f"{'still':<10} {'affecting':<10} {'paper':>15} {'simulated':>15} {'95 % of std.':>15}  named")
    for row in table_1():
        paper = f"{row.paper_std_pct:.1f} | {row.paper_max_pct:.1f}"
        ours = f"{row.std_pct:.1f} | {row.max_pct:.1f}"
        interval = "{:.1f} to {:.1f}".format(*row.interval_pct) if row.interval_pct else ""
        named = "yes" if row.is_named else "no"
        print(
            f"{row.rotation:<10} {row.affecting or 'all':<10} {paper:>15} {ours:>15} {interval:>15}  {named}"
        )


if __name__ == "__main__":
    main()
