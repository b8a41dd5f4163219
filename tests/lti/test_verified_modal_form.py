"""Modal coordinates: their distance from the system given is bounded, seen in 40 digits."""

import mpmath as mp
import numpy as np
import pytest
from hypothesis import assume, given

from boomctl.lti.system import Lti, of
from boomctl.lti.verified_modal_form import in_verified_modal_form, verified_modal_form
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
