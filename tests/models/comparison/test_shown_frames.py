"""Few frames of long series: no extreme and no gap is lost."""

from __future__ import annotations

import numpy as np
import pytest

from glovecal_models.takes.shown_frames import shown_frames


@pytest.mark.parametrize("most", [50, 200, 1999])
def test_no_extreme_is_lost_and_there_are_few(most: int) -> None:
    generator = np.random.default_rng(3)
    columns = np.cumsum(generator.normal(size=(20_000, 3)), axis=0)
    columns[12_345, 1] = 1e3  # one frame
    columns[7_000:7_300, 0] = np.nan
    chosen = shown_frames(columns, most)
    assert len(chosen) <= most
    assert (np.diff(chosen) > 0).all()
    assert {0, 19_999, 12_345} <= set(chosen.tolist())
    np.testing.assert_array_equal(np.nanmax(columns[chosen], axis=0), np.nanmax(columns, axis=0))
    np.testing.assert_array_equal(np.nanmin(columns[chosen], axis=0), np.nanmin(columns, axis=0))
    inside = (chosen >= 7_000) & (chosen < 7_300)
    assert inside.any()


def test_in_every_part_the_line_drawn_covers_the_line_there_is() -> None:
    value = np.sin(np.arange(9_000) / 7.0)[:, None]
    chosen = shown_frames(value, 902)
    for part in np.array_split(np.arange(9_000), 300):
        kept = value[np.intersect1d(chosen, part)]
        assert kept.max() == value[part].max()
        assert kept.min() == value[part].min()


def test_a_short_series_is_kept_whole_even_without_a_measurement() -> None:
    assert shown_frames(np.full((40, 3), np.nan), 40).tolist() == list(range(40))
    assert len(shown_frames(np.full((4_000, 3), np.nan), 100)) <= 100
