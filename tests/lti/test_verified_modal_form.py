"""Modal coordinates: their distance from the system given is bounded, seen in 40 digits."""

import warnings

import mpmath as mp
import numpy as np
import pytest
from hypothesis import assume, given

import boomctl as bc
from boomctl.analysis import hinf_norm
from boomctl.lti.system import Lti, of
from boomctl.lti.verified_modal_form import _product, in_verified_modal_form, verified_modal_form
from tests.forty_digits import DIGITS, hard_system, largest, poles, resonances, response
from tests.profiles import examples
from tests.strategies import seeds


def modal_response(modal, omega):
    total = mp.zeros(*modal.D.shape)
    for pole, c, b in zip(modal.poles, modal.C.T, modal.B, strict=True):
        total += mp.matrix(c[:, None].tolist()) * mp.matrix(b[None, :].tolist()) / (mp.mpc(0, omega) - mp.mpc(pole))
    return total


@pytest.mark.slow
@examples(60)
@given(seeds)
def test_no_frequency_shows_more_than_the_bound(seed):
    system = of(hard_system(seed)).balanced()
    found = verified_modal_form(system)
    assume(found is not None and max(p.real for p in poles(system)) < 0)
    with mp.workdps(DIGITS):
        seen = max(largest(response(system, w) - modal_response(found.modal, w)) for w in resonances(system))
    assert seen <= found.gap


@examples(60)
@given(seeds)
def test_well_separated_lightly_damped_modes_keep_their_digits(seed):
    rng = np.random.default_rng(seed)
    w, z = np.arange(1.0, 6.0), 10 ** rng.uniform(-5.0, -2.0, 5)
    A = np.kron(np.diag(w), np.array([[0.0, 1.0], [-1.0, 0.0]])) - np.diag(np.repeat(z * w, 2))
    Q = np.linalg.qr(rng.standard_normal(A.shape))[0]
    system = Lti(Q @ A @ Q.T, rng.standard_normal((10, 2)), rng.standard_normal((2, 10)), np.zeros((2, 2)))
    modal, gap = in_verified_modal_form(system)
    assert modal is not None
    assert gap <= 1e-9 * modal.sizes.max()


def test_a_jordan_block_is_left_in_its_own_coordinates():
    chain = Lti(-np.eye(3) + np.diag([40.0, 40.0], 1), np.ones((3, 1)), np.ones((1, 3)), np.zeros((1, 1)))
    modal, gap = in_verified_modal_form(chain)
    assert modal is None
    assert gap <= 1e-9 * np.abs(chain.C @ np.linalg.solve(chain.A, chain.B)).max()


def test_what_is_no_number_is_no_bound():
    """Of such states, 1e240 times 1e91, and nothing that reads them."""
    T = np.array([[1.0, 2.0], [1e-3, 1.0]])
    A = 1e-240 * T @ np.array([[-1e-9, 1.0], [-1.0, -1e-9]]) @ np.linalg.inv(T)
    unread = Lti(A, np.array([[1e91], [1e90]]), np.zeros((1, 2)), np.zeros((1, 1)))
    assert verified_modal_form(unread).gap == np.inf


@examples(60)
@given(seeds)
def test_a_product_in_parts_is_off_by_less_than_it_says(seed):
    rng = np.random.default_rng(seed)
    n, k, spread = int(rng.integers(1, 40)), int(rng.integers(1, 4)), rng.uniform(0.0, 12.0)
    A = rng.standard_normal((n, n)) * 10.0 ** rng.uniform(-spread, spread, (n, n))
    X = (rng.standard_normal((n, k)) + 1j * rng.standard_normal((n, k))) * 10.0 ** rng.uniform(-spread, spread, (n, 1))
    A[rng.random((n, n)) < 0.3] = 0.0
    product, lost = _product(A, X)
    long = 2.0 * float(np.finfo(np.longdouble).eps)
    with mp.workdps(60):
        exact = mp.matrix(A.tolist()) * mp.matrix(X.tolist())
        for i in range(n):
            for j in range(k):
                found = mp.mpc(
                    *(mp.fsum(map(mp.mpf, _in_doubles(part))) for part in (product[i, j].real, product[i, j].imag))
                )
                assert abs(found - exact[i, j]) <= lost[i, j] + long * abs(exact[i, j])
    most = np.abs(A).max(axis=1, keepdims=True) * np.abs(X).max(axis=0)
    assert (lost <= 1e-19 * n**3 * most).all()


def _in_doubles(number):
    """Return a long number as a sum of two doubles, which is exact."""
    return float(number), float(number - np.longdouble(float(number)))


@pytest.mark.parametrize("elements", [6, pytest.param(20, marks=pytest.mark.slow)])
def test_the_norm_of_a_boom_over_coordinates_is_certified(elements):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of what its matrices do not hold
        system = of(bc.spray_boom(elements=elements).to_statespace(states="coordinates"))
    norm = hinf_norm(system.statespace("boom"))
    assert norm.certified
    with mp.workdps(DIGITS):
        assert norm.lower_bound <= largest(response(system, norm.peak_omega)) <= norm.upper_bound
