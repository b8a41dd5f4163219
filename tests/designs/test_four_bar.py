"""The closed chain of designs/four_bar.py."""

import numpy as np

from designs.four_bar import main


def test_three_ways_to_close_a_chain_agree():
    result = main()
    assert result.held_against_cut < 1e-11
    assert result.multipliers_against_cut < 1e-10
    assert (np.diff(result.eigenfrequencies_hz) > 0).all()
