"""Mode shapes and modal integrals: against high-precision arithmetic, and the inequalities they obey."""

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boomctl.rotating_beam.modal.integrals import mass_points, modal_integrals
from boomctl.rotating_beam.modal.shapes import axial_modes, transverse_modes
from boomctl.rotating_beam.parameters import HubBeamParameters
from tests.profiles import examples
from tests.rotating_beam.strategies import parameters

LOADED = HubBeamParameters(tip_mass=0.1, tip_mass_position=5.3)


def exact_shape(i: int, length: float):
    """The textbook form, in 200 digits: the shape and its slope as functions."""
    guess = (mp.mpf(i) - mp.mpf(1) / 2) * mp.pi + (mp.mpf("0.3") if i == 1 else 0)
    z = mp.findroot(lambda z: mp.cos(z) + mp.sech(z), guess)
    b, s = z / length, (mp.cosh(z) + mp.cos(z)) / (mp.sinh(z) + mp.sin(z))

    def shape(x):
        return mp.cosh(b * x) - mp.cos(b * x) - s * (mp.sinh(b * x) - mp.sin(b * x))

    def slope(x):
        return b * (mp.sinh(b * x) + mp.sin(b * x) - s * (mp.cosh(b * x) - mp.cos(b * x)))

    return shape, slope


def integral(function, length, panels):
    return mp.quad(function, mp.linspace(0, length, panels + 1), maxdegree=5)


@pytest.mark.parametrize("i", [1, 2, 13, 100])
def test_shapes_equal_the_textbook_form_in_200_digits(i):
    with mp.workdps(200):
        shape, slope = exact_shape(i, mp.mpf(8))
        places = [0.0, 0.4, 3.3, 7.9, 8.0]
        values = [float(shape(mp.mpf(x))) for x in places]
        slopes = [float(slope(mp.mpf(x))) for x in places]
    modes = transverse_modes(100, 8.0)
    np.testing.assert_allclose(modes(places)[:, i - 1], values, rtol=0, atol=2e-12)
    np.testing.assert_allclose(modes(places, 1)[:, i - 1], slopes, rtol=0, atol=2e-12 * modes.wavenumbers[i - 1])


@pytest.mark.slow
@pytest.mark.parametrize(("i", "j"), [(1, 1), (1, 2), (12, 13), (13, 14)])
def test_integrals_equal_those_in_45_digits(i, j):
    p, n, panels = LOADED, 100, max(1, max(i, j) // 2)  # a panel a wave
    m = modal_integrals(p, n)
    with mp.workdps(45):
        length, r, line = mp.mpf(p.length), mp.mpf(p.hub_radius), mp.mpf(p.density) * mp.mpf(p.area)
        mass, place = mp.mpf(p.tip_mass), mp.mpf(p._mass_position)
        (fi, di), (fj, dj) = exact_shape(i, length), exact_shape(j, length)
        a = (2 * i - 1) * mp.pi / (2 * length)

        def outside(x):
            return line * (r * (length - x) + (length - x) * (length + x) / 2)

        exact = {
            "D": integral(lambda x: di(x) * dj(x) * outside(x), length, panels)
            + mass * (r + place) * integral(lambda x: di(x) * dj(x), place, panels),
            "R": line * integral(lambda x: mp.sin(a * x) * fj(x), length, panels)
            + mass * mp.sin(a * place) * fj(place),
            "M2": line * integral(lambda x: fi(x) * fj(x), length, panels) + mass * fi(place) * fj(place),
        }
        first_moment = line * integral(lambda x: (r + x) * fj(x), length, panels) + mass * (r + place) * fj(place)
    for name, value in exact.items():
        assert getattr(m, name)[i - 1, j - 1] == pytest.approx(float(value), rel=1e-12), name
    assert m.V2[j - 1] == pytest.approx(float(first_moment), rel=1e-12)


@pytest.mark.parametrize("n", [1, 5, 40, pytest.param(100, marks=pytest.mark.slow)])
def test_two_quadratures_agree(n):
    m, points = modal_integrals(LOADED, n), mass_points(LOADED, n)
    sums = {
        "M1": np.einsum("k,ki,kj->ij", points.mass, points.f1, points.f1),
        "M2": np.einsum("k,ki,kj->ij", points.mass, points.f2, points.f2),
        "R": np.einsum("k,ki,kj->ij", points.mass, points.f1, points.f2),
        "D": np.einsum("k,kij->ij", points.mass * points.radius, points.S),
        "V1": points.f1.T @ (points.mass * points.radius),
        "V2": points.f2.T @ (points.mass * points.radius),
    }
    for name, total in sums.items():
        exact = getattr(m, name)
        np.testing.assert_allclose(total, exact, rtol=0, atol=1e-12 * np.abs(exact).max(), err_msg=name)


def test_points_sum_products_of_four_slopes_exactly():
    """Twice as many modes bring twice as many points; the sums over the first ones must not change."""
    few, many = mass_points(LOADED, 6), mass_points(LOADED, 14)
    sums = [np.einsum("k,kij,klm->ijlm", each.mass, each.S[:, :6, :6], each.S[:, :6, :6]) for each in (few, many)]
    np.testing.assert_allclose(sums[0], sums[1], rtol=0, atol=1e-12 * np.abs(sums[1]).max())


@examples(30)
@given(p=parameters(), n=st.integers(1, 12), part=st.floats(0.0, 1.0))
def test_shortening_outweighs_deflection(p, n, part):
    """Cauchy-Schwarz: D >= M2, and (r_A + l) S(l) >= f2(l)^T f2(l) anywhere on the beam."""
    m = modal_integrals(p, n)
    scale = np.sqrt(np.outer(np.diag(m.D), np.diag(m.D)))
    assert np.linalg.eigvalsh((m.D - m.M2) / scale).min() >= -1e-12
    modes = transverse_modes(n, p.length)
    x = part * p.length
    stiffening = (p.hub_radius + x) * modes.shortening(x) - np.outer(modes(x), modes(x))
    whole = (p.hub_radius + p.length) * np.trace(modes.shortening(p.length))
    assert np.linalg.eigvalsh(stiffening).min() >= -1e-12 * whole


@examples(20)
@given(p=parameters(damped=True), n=st.integers(1, 8))
def test_every_clamped_mode_has_the_damping_ratio(p, n):
    m = modal_integrals(p, n)
    for M, C, K in ((m.M1, m.C1, m.K1), (m.M2, m.C2, m.K2)):
        values = np.linalg.eigvals(
            np.block([[np.zeros_like(M), np.eye(n)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
        )
        np.testing.assert_allclose(-values.real / np.abs(values), p.damping_ratio, atol=1e-7)


def test_axial_shapes_solve_the_bar():
    modes = axial_modes(5, 3.0)
    x = np.linspace(0, 3.0, 7)
    np.testing.assert_allclose(modes(x, 2), -(modes.wavenumbers**2) * modes(x), atol=1e-12)
    np.testing.assert_allclose([modes(0.0), modes(3.0, 1)], 0.0, atol=1e-13)
