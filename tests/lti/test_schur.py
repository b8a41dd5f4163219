"""Responses by substitution: those of solving, for stiff, defective and stateless systems alike."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from boomctl.lti.schur import triangular
from boomctl.lti.system import Lti
from tests.profiles import examples


@given(st.integers(0, 10_000), st.integers(0, 9), st.integers(1, 3), st.integers(0, 300))
@examples(30)
def test_a_triangular_form_responds_as_the_system_does(seed, n, m, count):
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((n, n))
    A -= (max(np.linalg.eigvals(A).real.max(initial=0.0), 0.0) + 0.5) * np.eye(n)
    system = Lti(A, rng.standard_normal((n, m)), rng.standard_normal((m, n)), rng.integers(-1, 2, (m, m)).astype(float))
    omega = np.concatenate([[0.0], rng.exponential(3.0, count)])
    found, wanted = triangular(system).response(omega), system.response(omega)
    assert found.shape == wanted.shape == (m, m, count + 1)
    np.testing.assert_allclose(found, wanted, rtol=1e-8, atol=1e-8 * np.abs(wanted).max())
    part = triangular(system).only([m - 1]).response(omega)
    np.testing.assert_allclose(part[0, 0], found[m - 1, m - 1], rtol=1e-9, atol=1e-9)


def test_equal_poles_are_no_obstacle():
    n = 5
    chain = Lti(-np.eye(n) + np.diag(np.ones(n - 1), 1), np.eye(n)[:, -1:], np.eye(n)[:1], np.zeros((1, 1)))
    omega = np.linspace(0.0, 4.0, 30)
    np.testing.assert_allclose(triangular(chain).response(omega)[0, 0], (1.0 + 1j * omega) ** -n, rtol=1e-12)
