"""Proof over cells: bounds that hold at every point and frequency tried, and no proof where a pole crosses."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boomctl.analysis.box import zero_exclusion
from boomctl.analysis.box.polynomials import product_of
from boomctl.analysis.box.sampled import image
from tests.analysis.test_prove_box import polynomials
from tests.profiles import examples


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
    bound = zero_exclusion._beyond(changes, (Y, X), reach, kept, np.zeros((n, n)))
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
