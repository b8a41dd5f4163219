"""Proofs over cells of parameters, which hold at every point tried, and over boxes: cells of frequencies for what is left."""

from dataclasses import replace

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.analysis.box import prove, zero_exclusion
from boomctl.analysis.box.level import LoopPart
from boomctl.analysis.box.loops import BoxLoops
from boomctl.analysis.box.polynomials import Cell, product_of, within
from boomctl.analysis.box.response_cells import ResponseCells
from boomctl.analysis.box.sampled import image
from boomctl.analysis.norm import matrices_norm
from tests.analysis.loop_cases import Walls, sampled
from tests.profiles import examples
from tests.strategies import seeds


def alone(pencils, missed=0.0, cell=None):
    """Return a loop that nothing drives over a box of parameters, or a part of it."""
    n, cell = len(pencils[()][0]), cell or Cell.whole(1)
    none = np.zeros((n, 1))
    return LoopPart(cell, within(pencils, cell), {(): none}, none.T, np.zeros((1, 1)), (missed * np.ones((n, n)), none))


def proved(pencils, cell, missed=0.0):
    """Return whether a loop that nothing drives is proved stable over a cell."""
    return alone(pencils, missed, Cell.whole(len(cell.middle))).prover(1.0)(cell) is None


def polynomials(rng, size, count):
    """Return a polynomial of parameters up to the fifth degree, its radius in the middle below one."""
    A = rng.standard_normal((size, size))
    found = {(): A * rng.uniform(0.3, 0.95) / np.abs(np.linalg.eigvals(A)).max()}
    for degree in range(1, 6):
        for _ in range(2):
            power = tuple(sorted(rng.integers(0, count, degree).tolist()))
            found[power] = 0.3 ** (degree - 1) * rng.uniform(0.0, 0.2) * rng.standard_normal((size, size))
    return found


@examples(300)
@given(seed=seeds, reach=st.floats(0.02, 1.0), size=st.integers(1, 6), count=st.sampled_from((2, 11)))
def test_sampled_cell_proof_includes_polynomial_error(seed, reach, size, count):
    """Every loop within ``missed`` of the polynomial counts, the corners of that included."""
    rng = np.random.default_rng(seed)
    sampled, missed = polynomials(rng, size, count), rng.uniform(0.0, 0.1) * rng.random((size, size))
    cell = Cell(rng.uniform(-1.0, 1.0, count) * (1.0 - reach), np.full(count, reach))
    if not proved(image(sampled), cell, missed):
        return
    delta = cell.middle + reach * rng.uniform(-1.0, 1.0, (200, count))
    delta[:100] = cell.middle + reach * rng.choice([-1.0, 1.0], (100, count))
    signs = np.where(rng.random((200, 1, 1)) < 0.5, 1.0, rng.choice([-1.0, 1.0], (200, size, size)))
    loops = sum(np.prod(delta[:, list(power)], axis=1)[:, None, None] * A for power, A in sampled.items())
    assert np.abs(np.linalg.eigvals(loops + signs * missed)).max() < 1.0


def driven(rng, size):
    """Return a sampled loop over a box of two parameters, two signals in and out, and by how much its matrices may be off."""
    A = polynomials(rng, size, 2)
    B = {power: X[:, :2] for power, X in polynomials(rng, size, 2).items()}
    C, D = rng.standard_normal((2, size)), 0.3 * rng.standard_normal((2, 2))
    share = rng.choice([0.0, rng.uniform(0.0, 0.03)])
    missed = share * rng.random((size, size)), share * rng.random((size, 2))
    return LoopPart(Cell.whole(2), image(A), B, C, D, missed, 0.1), A


@pytest.mark.slow
@examples(300)
@given(seed=seeds, reach=st.floats(0.02, 1.0), size=st.integers(2, 5))
def test_sampled_level_proof_includes_polynomial_error(seed, reach, size):
    """Gains on the whole circle, of every loop within ``missed`` of the polynomials; where there is room it is proved."""
    rng = np.random.default_rng(seed)
    loops, A = driven(rng, size)
    cell = Cell(rng.uniform(-1.0, 1.0, 2) * (1.0 - reach), np.full(2, reach))
    delta = cell.middle + reach * rng.uniform(-1.0, 1.0, (100, 2))
    delta[:4] = cell.middle + reach * np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]])
    A, B = (
        sum(np.prod(delta[:, list(power)], axis=1)[:, None, None] * X for power, X in terms.items())
        + np.where(rng.random((100, 1, 1)) < 0.5, 1.0, rng.choice([-1.0, 1.0], (100, *off.shape))) * off
        for terms, off in zip((A, loops.B), loops.errors, strict=True)
    )
    stable = np.abs(np.linalg.eigvals(A)).max() < 1.0
    z = np.exp(1j * np.linspace(0.0, np.pi, 60))[:, None, None, None]
    G = loops.C @ np.linalg.solve(z * np.eye(size) - A, np.broadcast_to(B, (60, *B.shape)) + 0j) + loops.D
    largest = np.linalg.norm(G, 2, axis=(2, 3)).max()
    for share in (0.7, 0.999, 1.01, 2.0):
        if loops.prover(share * largest)(cell) is None:
            assert stable
            assert share > 1.0
    small = Cell(cell.middle, np.full(2, 1e-6))
    exact = replace(loops, errors=(0.0 * A[0], 0.0 * B[0]))
    norm = matrices_norm(exact.at(cell.middle))
    if norm.certified and np.abs(np.linalg.eigvals(exact.at(cell.middle).A)).max() < 0.999:
        assert exact.prover(1.05 * norm.upper_bound)(small) is None


@given(st.floats(-0.9, 0.9), st.floats(0.01, 0.9))
@examples(60)
def test_polynomial_error_of_one_state_loop(middle, share):
    """``|a + d b + e| < 1`` for all ``|d| <= 1``, ``|e| <= m`` where ``|a| + b + m < 1``."""
    room = 1.0 - abs(middle)
    terms = image({(): np.array([[middle]]), (0,): np.array([[share * room]])})
    rest = (1.0 - share) * room
    assert not proved(terms, Cell.whole(1), 1.001 * rest)
    assert prove.prove_box([alone(terms, 0.6 * rest)], prove.Statement(lambda delta: True), 500).parameter_cells


@pytest.mark.parametrize("slope", [1.0, -1.0])
def test_box_with_one_unstable_part_is_not_proved(slope):
    """``x' = (slope d - 1/2) x`` is stable over one half of the box alone; ``x' = (slope d/4 - 1/2) x`` over both."""
    halves = [Cell(np.array([middle]), np.array([0.5])) for middle in (-0.5, 0.5)]
    for share, expected in ((1.0, False), (0.25, True)):
        terms = {(): np.array([[[1.0]], [[-0.5]]]), (0,): np.array([[[0.0]], [[share * slope]]])}
        stable = prove.Statement(lambda delta, share=share: share * slope * delta[0] < 0.5)
        found = prove.prove_box([alone(terms, cell=half) for half in halves], stable, 500)
        assert found.proved == expected


TURNING = {(): np.array([np.eye(2), [[-0.1, 3.0], [-3.0, -0.1]]]), (0,): np.array([np.zeros((2, 2)), np.eye(2)])}
# A pole at minus one has its image at infinity: the matrix before the derivative is singular.
SINGULAR = image({(): np.diag([-1.0, 0.5]), (0,): 0.1 * np.eye(2)})


@pytest.mark.parametrize(
    ("terms", "middle", "reach", "expected"),
    [
        (TURNING, 0.0, 0.099, True),
        (TURNING, 0.0, 0.101, False),
        (SINGULAR, 0.0, 1.0, False),
        (SINGULAR, 0.5, 0.5, False),
    ],
)
def test_cell_is_proved_where_no_pole_crosses(terms, middle, reach, expected):
    assert proved(terms, Cell(np.array([middle]), np.array([reach]))) == expected


def masses(rng, count, parameters, light, spread):
    """Return a family of masses between walls with even dampers and even spreads, and its LQG controller."""
    family = Walls(rng, parameters, count, (spread, spread), (light, light)).family
    plant = family.nominal.to_statespace()
    push, u = (plant.B[:, [plant.input_labels.index(name)]] for name in ("push", "u"))
    A, C = plant.A, plant.C[[plant.output_labels.index("y")]]
    F, L = control.lqr(A, u, np.eye(len(A)), [[0.1]])[0], control.lqe(A, push, C, [[1.0]], [[1e-2]])[0]
    return family, control.ss(A - u @ F - L @ C, L, -F, 0.0, inputs="y", outputs="u")


@examples(60)
@given(seed=seeds, parameters=st.integers(1, 3), late=st.sampled_from([None, 0.0, 0.5, 1.0]))
def test_what_is_proved_is_stable_at_every_point_drawn(seed, parameters, late):
    """Of loops closed anew, in continuous and in sampled time; the path tells the cells."""
    rng = np.random.default_rng(seed)
    family, K = masses(rng, 2, parameters, rng.uniform(0.005, 0.2), rng.uniform(0.05, 0.5))
    if late is not None:
        K = sampled(K, 0.1)
    delay = 0.1 * (late or 0.0)
    found = bc.robust_stability(family, K, delay=delay)
    points = np.clip(1.2 * rng.uniform(-1.0, 1.0, (25, parameters)), -1.0, 1.0)
    loops = [bc.feedback_loop(family.at(point), K, delay=delay).poles() for point in points]
    worst = max(float((np.abs(poles) - 1.0 if late is not None else poles.real).max()) for poles in loops)
    assert bool(found.method) == found.proved
    if found.proved:
        assert worst < 0.0
        assert sum(int(word) for word in found.method.split() if word.isdigit()) == found.cells
    if worst > 1e-9:
        assert not found.proved
    if found.destabilizing_values is not None:
        poles = bc.feedback_loop(family.at(family.normalize(found.destabilizing_values)), K, delay=delay).poles()
        assert (np.abs(poles) - 1.0 if late is not None else poles.real).max() >= -1e-9


@pytest.mark.parametrize("seed", [15, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (10, 12, 13))])
def test_a_lightly_damped_sampled_loop_takes_few_cells(monkeypatch, seed):
    """Cells of parameters and frequencies alone would be 17 to 45; here nobody asks them."""
    family, K = masses(np.random.default_rng(seed), 3, 2, 0.005, 0.15)
    monkeypatch.delattr(ResponseCells, "look")
    found = bc.robust_stability(family, sampled(K, 0.1), delay=0.05)
    assert found.proved
    assert found.cells <= 4
    assert found.method == f"{found.cells} of parameters"


@pytest.mark.slow
def test_frequency_cells_complete_parameter_cells():
    family, K = masses(np.random.default_rng(0), 2, 4, 0.1, 0.4)
    waiting, tried = [Cell.whole(4)], 0
    prover = BoxLoops.of(family, K).parts()[0].prover(1.0)
    while waiting and tried < 200:
        cell, tried = waiting.pop(), tried + 1
        axis = prover(cell)
        waiting += [] if axis is None else cell.halves(axis)
    assert waiting
    found = bc.robust_stability(family, K, 100)
    assert found.proved
    assert found.method.endswith("of parameters and frequencies")
    points = np.random.default_rng(0).uniform(-1.0, 1.0, (200, 4))
    assert max(bc.feedback_loop(family.at(point), K).poles().real.max() for point in points) < 0.0


def test_cells_of_parameters_and_frequencies_prove_a_whole_part(monkeypatch):
    """Where the first 32 cells of parameters prove nothing, and trials in these have no budget."""
    family, K = masses(np.random.default_rng(0), 2, 2, 0.1, 0.3)
    (part,), stable = BoxLoops.of(family, K).parts(), prove.Statement(lambda delta: True)
    monkeypatch.setattr(LoopPart, "prover", lambda self, level: lambda cell: int(np.argmax(cell.reach)))
    monkeypatch.setattr(prove, "_TRIAL", 0)
    found = prove.prove_box([part], stable, 1e6)
    assert found.proved
    count = ResponseCells.of(part).prove(Cell.whole(2), 1.0, 50_000, lambda gain, point: 1.0)
    assert (found.parameter_cells, found.frequency_cells) == (0, count)
    assert not prove.prove_box([part], stable, 1).proved


def test_a_level_that_does_not_hold_is_never_proved(monkeypatch):
    """Instability met by the last cells that wait raises the level beyond all bounds."""
    loops = driven(np.random.default_rng(1), 2)[0]
    monkeypatch.setattr(LoopPart, "prover", lambda self, level: lambda cell: 0)
    statement = prove.Statement(lambda point: True, 1e9)
    monkeypatch.setattr(statement, "met", lambda gain, point: setattr(statement, "level", np.inf))
    found = prove.prove_box([loops], statement, 500)
    assert statement.level == np.inf
    assert not found.proved


@given(st.integers(0, 10_000))
@examples(20)
def test_coupling_bounds_hold_along_interval(seed):
    rng = np.random.default_rng(seed)
    modes = zero_exclusion._modes(image(polynomials(rng, 6, 2)), np.array([0.2, 0.1]), np.zeros((6, 6)))
    assert modes is not None
    ends = np.array([[lowest := rng.uniform(0.0, 8.0), 1.0], [lowest + rng.exponential(1.0), 1.0]])
    n = len(modes.poles)
    coupling = zero_exclusion._couplings(zero_exclusion._squares(modes), ends).reshape(2, n, n).max(axis=0)
    distance = zero_exclusion._along(modes, ends).min(axis=1).max(axis=0)
    k = modes.exact
    for share in rng.uniform(0.0, 1.0, 20):
        a = ends[0, 0] + share * (ends[1, 0] - ends[0, 0])
        weights = rng.uniform(modes.low, modes.high)
        terms = weights[:, None, None] * (1j * a * modes.E - modes.A)
        diagonal = 1j * a - modes.poles + np.diagonal(terms[:k].sum(axis=0))
        assert (np.abs(diagonal) >= distance - 1e-12).all()
        np.einsum("tkk->tk", terms)[:k] = 0.0
        assert (np.abs(terms.sum(axis=0)) <= coupling + 1e-12).all()


@pytest.mark.parametrize("kept", [2, 3])
@pytest.mark.parametrize("positive", [False, True])
@given(seed=st.integers(0, 10_000))
@examples(30)
def test_products_of_many_parameters_are_below_their_bound(kept, positive, seed):
    """Of the transformed pencil at a point of the cell; of positive matrices all add up, and the bound is attained."""
    rng = np.random.default_rng(seed)
    reach, n = rng.uniform(0.1, 1.0, 2), 3
    d = reach if positive else reach * rng.uniform(-1.0, 1.0, 2)

    def drawn(*size):
        return rng.uniform(0.0, 1.0, size) if positive else rng.uniform(-1.0, 1.0, size)

    Y, X = drawn(2, n, n), drawn(2, n, n)
    powers = [tuple(sorted(rng.integers(0, 2, length).tolist())) for length in range(1, 6)]
    changes = {power: ((drawn(n, 2), drawn(2, n)), (drawn(n, 1), drawn(1, n))) for power in powers}
    bound = zero_exclusion._beyond(changes, (Y, X), reach, kept, np.zeros((2, n, n)))
    ends = [{(): np.eye(n)} | {(i,): d[i] * Z[i] for i in (0, 1)} for Z in (Y, X)]
    for j in (0, 1):
        middle = {p: np.prod(d[list(p)]) * pair[j][0] @ pair[j][1] for p, pair in changes.items()}
        terms = product_of(product_of(ends[0], middle), ends[1])
        beyond = sum(term for p, term in terms.items() if len(p) > kept)
        assert (np.abs(beyond) <= bound[j] * (1.0 + 1e-12)).all()
        if positive:
            assert beyond == pytest.approx(bound[j], rel=1e-12)


@given(st.integers(0, 10_000), st.floats(0.5, 1.5), st.integers(1, 12))
@examples(30)
def test_a_radius_is_called_below_one_only_if_it_is(seed, radius, n):
    rng = np.random.default_rng(seed)
    H = rng.uniform(0.0, 1.0, (n, n)) * (rng.uniform(size=(n, n)) < 0.6) * np.exp(3.0 * rng.standard_normal((n, n)))
    own = np.abs(np.linalg.eigvals(H)).max()
    H = H * (radius / own) if own > 1e-9 else H
    shown = bool(zero_exclusion._below_one(H[None])[0])
    actual = np.abs(np.linalg.eigvals(H)).max()
    assert not shown or actual < 1.0
    if own > 1e-9 and (H > 0.0).all():
        assert shown == (actual < 1.0) or abs(actual - 1.0) < 0.05
