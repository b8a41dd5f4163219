"""The parts of a reduction: Gramians, balancing, the bound of truncated modes."""

import control
import numpy as np
import pytest
from hypothesis import given

import boomctl as bc
from boomctl.lti.gramians import band_integral
from boomctl.lti.modal import ModalSystem, diagonalized
from boomctl.lti.system import of
from boomctl.reduction.reducers import balance
from boomctl.reduction.verify import sizes_of_difference
from tests.reduction.test_reduce import stable_system
from tests.strategies import seeds


def gramian_residual(A, B, F):
    """Return the residual of ``A P + P A^T + B B^T = 0`` with ``P = F F^T``, relative to its largest term."""
    AP, BB = A @ F @ F.T, B @ B.T
    size = max(np.abs(AP).max(initial=0.0), np.abs(BB).max(initial=0.0), np.finfo(float).tiny)
    return np.abs(AP + AP.T + BB).max(initial=0.0) / size


def modal_of(seed):
    modal = diagonalized(of(stable_system(seed)).balanced())
    assert modal is not None
    return modal


@given(seeds)
def test_balanced_gramians_are_equal_and_diagonal(seed):
    modal = modal_of(seed)
    for way in (modal, None):
        form = balance(modal.blocks, way)
        A, B, C = form.system.A, form.system.B, form.system.C
        root = np.diag(np.sqrt(form.values))
        assert gramian_residual(A, B, root) < 1e-7
        assert gramian_residual(A.T, C.T, root) < 1e-7
        assert form.values[0] == pytest.approx(control.hankel_singular_values(stable_system(seed))[0], rel=1e-6)


@given(seeds)
def test_sizes_bound_the_bend_of_a_difference(seed):
    rng, full = np.random.default_rng(seed), modal_of(seed)
    change = 10.0 ** rng.uniform(-12.0, 0.0)
    kept = rng.random(len(full.poles)) < 0.7
    near = ModalSystem(
        full.poles * (1.0 + change), full.B * (1.0 + change * rng.standard_normal()), full.C, full.D
    ).only(kept)
    sizes = sizes_of_difference(full, near)
    s = 1j * np.concatenate([full.poles.imag, 10.0 ** rng.uniform(-3.0, 3.0, 20)])[:, None]
    poles, terms = np.append(full.poles, near.poles), np.concatenate([full.terms, -near.terms])
    bend = np.linalg.norm((1.0 / (s - poles) ** 3) @ terms, axis=1)
    assert (bend <= (1.0 / np.abs(s - poles) ** 3) @ sizes * (1.0 + 1e-9)).all()


def test_jordan_blocks_are_balanced_without_modal_coordinates():
    A = np.diag(-np.ones(4)) + np.diag(np.ones(3), 1)
    full = control.ss(A, np.eye(4)[:, 3:], np.eye(4)[:1], 0.0)
    assert diagonalized(of(full).balanced()) is None
    red = bc.reduce(full, order=2)
    assert red.certificate.lower_bound <= red.error_bound
    truth = control.linfnorm(full - red.system)[0]
    assert truth <= red.error_norm <= 1.0101 * truth  # the level that is checked
    with pytest.raises(ValueError, match="Jordan"):
        bc.reduce(full, order=2, method="modal")


@pytest.mark.slow
def test_band_integral_matches_quadrature():
    modal = modal_of(7)
    system = modal.blocks
    w = np.linspace(0.5, 4.0, 200_001)
    poles = modal.poles
    shares = (1.0 / (1j * w[None, :] - poles[:, None]) + 1.0 / (-1j * w[None, :] - poles[:, None])).sum(axis=1)
    expected = (modal.mixing * (shares * (w[1] - w[0]) / (2 * np.pi))) @ modal.mixing.conj().T
    assert band_integral(system, modal, (0.5, 4.0)) == pytest.approx(expected.real, abs=1e-3)
    assert band_integral(system, None, (0.5, 4.0)) == pytest.approx(band_integral(system, modal, (0.5, 4.0)), abs=1e-8)
    assert band_integral(system, modal, (0.0, 1e12)) == pytest.approx(0.5 * np.eye(len(system.A)), abs=1e-8)
