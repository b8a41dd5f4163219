"""H2 synthesis: a closed form, slycot as a peer, direct terms, units."""

import control
import numpy as np
import pytest
from hypothesis import given
from scipy import linalg

import boomctl as bc
from tests.profiles import examples
from tests.strategies import seeds
from tests.synthesis import plants


def random_plant(seed):
    """Return a generalized plant of two controls and measurements, without direct terms between signals of a kind."""
    return plants.random_plant(seed, 4, (1, 1, 2, 2), False)


def test_an_integrator_in_closed_form():
    D = [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]
    names = {"inputs": ["load", "noise", "u"], "outputs": ["place", "effort", "y"]}
    design = bc.h2(control.ss([[0.0]], [[1.0, 0.0, 1.0]], [[1.0], [0.0], [1.0]], D, **names), 1, 1)
    assert design.norm**2 == pytest.approx(2.0)
    assert pytest.approx(-2.0) == design.controller.A
    assert design.controller(1.0) == pytest.approx(-1.0 / 3.0)
    assert (design.controller.input_labels, design.controller.output_labels) == (["y"], ["u"])
    assert design.closed_loop.input_labels == ["load", "noise"]
    assert design.closed_loop.output_labels == ["place", "effort"]
    assert "H2 norm of the closed loop 1.41421, verified; optimal 1.41421" in repr(design)


@given(seeds)
@examples(50)
def test_the_norm_is_slycots_and_the_closed_loops_own(seed):
    import slycot

    P = random_plant(seed)
    design = bc.h2(P, 2, 2)
    K = slycot.sb10hd(4, 5, 5, 2, 2, P.A, P.B, P.C, P.D)[:4]
    assert design.norm == pytest.approx(bc.h2_norm(P.lft(control.ss(*K))).value, rel=1e-5)
    assert design.norm == pytest.approx(design.optimal_norm, rel=1e-5)
    loop = P.lft(design.controller)
    assert bc.h2_norm(loop).value == pytest.approx(design.norm, rel=1e-5)
    for w in (0.1, 1.0, 10.0):
        assert loop(1j * w) == pytest.approx(design.closed_loop(1j * w), rel=1e-6, abs=1e-8)


@given(seeds)
@examples(50)
def test_h2_invariant_to_feedthrough_and_units(seed):
    rng = np.random.default_rng(seed)
    P, gain = random_plant(seed), rng.standard_normal((2, 2))
    norm = bc.h2(P, 2, 2).norm
    fed = control.ss(P.A, P.B, P.C, P.D + linalg.block_diag(np.zeros((3, 3)), 0.3 * gain))
    design = bc.h2(fed, 2, 2)
    assert design.norm == pytest.approx(norm, rel=1e-5)
    assert bc.h2_norm(fed.lft(design.controller)).value == pytest.approx(norm, rel=1e-5)

    D = P.D.copy()
    D[:3, :3] = -D[:3, 3:] @ gain @ D[3:, :3]
    design = bc.h2(control.ss(P.A, P.B, P.C, D), 2, 2)
    assert pytest.approx(gain, rel=1e-6, abs=1e-8) == design.controller.D
    assert design.norm == pytest.approx(design.optimal_norm, rel=1e-5)
    assert not design.closed_loop.D.any()

    T, u, y = (np.diag(10.0 ** rng.uniform(-3, 3, k)) for k in (4, 2, 2))
    right, left, inverse = linalg.block_diag(np.eye(3), u), linalg.block_diag(np.eye(3), y), np.linalg.inv(T)
    same = control.ss(inverse @ P.A @ T, inverse @ P.B @ right, left @ P.C @ T, left @ P.D @ right)
    assert bc.h2(same, 2, 2).norm == pytest.approx(norm, rel=1e-5)
