"""Cells of parameters and frequencies: their bounds exceed every gain within, and together they cover the box."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boomctl.analysis.box.loops import BoxLoops
from boomctl.analysis.box.polynomials import Cell, value_at
from boomctl.analysis.box.response_cells import ResponseCells
from boomctl.analysis.box.sampled import sampled_loops
from boomctl.arrays import balance
from boomctl.lti.system import of
from tests.analysis.loop_cases import Walls
from tests.profiles import examples
from tests.strategies import seeds

FAR = 1e12  # stands for an infinite frequency


def cells_of(case):
    """Return the cells of a box of loops, and its gains by hand where ``j v`` is the frequency, or its bilinear image."""
    signals = ["push"], ["y", "z"]
    (loops,) = BoxLoops.of(case.family, case.K, case.delay).parts(*signals)

    def gain_at(delta, v):
        at = 1j * np.array([min(v, FAR)])
        at = at if case.K.isctime() else (1.0 + at) / (1.0 - at)
        return np.linalg.norm(case.responses(1.0 + (case.family.high - 1.0) * delta, at, *signals)[0], 2)

    return ResponseCells.of(loops), gain_at


def cut(box, rng, times):
    """Return cells of the box cut as a proof cuts them, and now and then anywhere."""
    cells = box.start(Cell.whole(box.size))
    for _ in range(times):
        here = rng.random(len(cells)) < 0.5
        here[rng.integers(len(cells))] = True
        asked = box.look(cells[here])[2]
        axes = np.where(rng.random(here.sum()) < 0.2, rng.integers(0, box.size + 1, here.sum()), asked)
        cells = cells[~here].with_halves(cells[here], axes)
    return cells


def drawn(cells, rng, place):
    """Return a point within a cell, its parameters and its frequency often at an end."""
    share = rng.uniform(-1.0, 1.0, cells.middle.shape[1])
    share = np.where(rng.random(len(share)) < 0.4, np.sign(share), share)
    along, *delta = cells.middle[place] + share * cells.reach[place]
    if cells.inverse[place]:
        along = 1.0 / along if along > 0.0 else np.inf
    return np.array(delta), along


@pytest.mark.parametrize("sampled", [False, pytest.param(True, marks=pytest.mark.slow)])
@examples(60)
@given(seed=seeds, parameters=st.integers(1, 4))
def test_no_gain_within_a_cell_is_above_its_bound(sampled, seed, parameters):
    rng = np.random.default_rng(seed)
    case = Walls(rng, parameters)
    box, gain_at = cells_of(case.sampled() if sampled else case)
    cells = cut(box, rng, 9)
    chosen = cells[np.isin(np.arange(len(cells)), rng.permutation(len(cells))[:25])]
    bound = box.look(chosen)[0]
    assert np.isfinite(bound).any()
    for place in np.flatnonzero(np.isfinite(bound)):
        most = max(gain_at(*drawn(chosen, rng, place)) for _ in range(12))
        assert most <= bound[place] * (1.0 + 1e-8)


@examples(40)
@given(seed=seeds, parameters=st.integers(1, 3))
def test_cells_cover_every_point_of_the_box_at_every_frequency(seed, parameters):
    rng = np.random.default_rng(seed)
    cells = cut(cells_of(Walls(rng, parameters))[0], rng, 8)
    for _ in range(50):
        delta = rng.uniform(-1.0, 1.0, parameters)
        omega = np.exp(rng.uniform(np.log(1e-3), np.log(1e4)))
        at = np.column_stack([np.where(cells.inverse, 1.0 / omega, omega), np.tile(delta, (len(cells), 1))])
        assert (np.abs(at - cells.middle) <= cells.reach * (1.0 + 1e-12)).all(axis=1).any()


def test_a_bound_of_a_small_cell_is_near_its_largest_gain():
    rng = np.random.default_rng(4)
    box, gain_at = cells_of(Walls(rng, 2))
    cells = box.start(Cell.whole(box.size))[:1]
    for size, near in ((1e-2, 1e-2), (1e-3, 1e-4)):
        small = type(cells)(np.array([[1.3, 0.3, -0.4]]), size * np.array([[1.3, 1.0, 1.0]]), np.array([False]))
        most = max(gain_at(*drawn(small, rng, 0)) for _ in range(300))
        bound = box.look(small)[0][0]
        assert most <= bound <= most * (1.0 + near)


@pytest.mark.slow
def test_polynomials_meet_the_loop_wherever_it_is_drawn():
    """To what they say that they may miss, at points that they have not seen."""
    case = Walls(np.random.default_rng(4), 3).sampled()
    K = of(case.K, "K", any_time=True)
    raw = sampled_loops(case.family, K, ["push"], ["z"], 0.0)
    (loops,) = BoxLoops.of(case.family, case.K).parts(["push"], ["z"])
    scale = balance(raw(np.zeros(3)).A)[1]
    for delta in np.random.default_rng(9).uniform(-1.0, 1.0, (50, 3)):
        A = raw(delta).A * scale / scale[:, None]
        found = 0.5 * value_at(loops.pencils, delta).sum(axis=0)
        assert (np.abs(found - A) <= loops.errors[0]).all()
