"""What counts as undamped: every public method that asks gives the same answer.

A pole of relative damping 5e-11, either sign, is undamped, one of 5e-10 or 5e-9 is not: it decays, or is unstable.  Norms
alone go by the digits given: a mode that decays, however slowly, has a finite one.
"""

from contextlib import nullcontext

import control
import numpy as np
import pytest
from scipy import linalg

import boomctl as bc
from boomctl.lti.modal import UNDAMPED, side_of_axis
from boomctl.structure import SecondOrderModel
from boomctl.structure.families import AffineFamily
from tests import hard_systems

OMEGA = 2.0
DAMPINGS = [sign * size for size in (5e-11, 5e-10, 5e-9) for sign in (1.0, -1.0)]
METHODS = ("balanced", "singular-perturbation", "hankel", "modal")


def side(damping):
    return 0 if abs(damping) <= UNDAMPED else -int(np.sign(damping))


def oscillator(damping, hidden=False):
    """One mode of that damping, seen or not by ``u`` and ``y``, beside a well-damped one."""
    A = linalg.block_diag(hard_systems.oscillator(OMEGA, damping), [[0.0, 1.0], [-9.0, -0.6]])
    acts = 0.0 if hidden else 1.0
    return control.ss(A, [[0.0], [acts], [0.0], [1.0]], [[acts, 0.0, 1.0, 0.0]], 0.0, inputs="u", outputs="y")


def structure(damping):
    """A mass on a spring and an (almost) undamped dashpot, driven by a control and a disturbance."""
    c = 2.0 * damping * OMEGA
    return SecondOrderModel([[1.0]], [[c]], [[OMEGA**2]], {"u": [1.0], "w": [1.0]}, {"y": [1.0]})


NOTHING = control.ss([], [], [], [[0.0]], inputs="y", outputs="u")


@pytest.mark.parametrize("damping", DAMPINGS)
def test_norms_and_singular_values(damping):
    finite = damping > 0.0
    system = oscillator(damping)
    poles = np.linalg.eigvals(system.A)
    assert side_of_axis(poles)[np.argmin(np.abs(poles.real))] == side(damping)
    for shown in (system, structure(damping)):
        assert np.isfinite(bc.h2_norm(shown).value) == np.isfinite(bc.hinf_norm(shown).lower_bound) == finite
        assert np.isfinite(bc.sigma(shown, [1.0]).peak) == finite
    hidden = oscillator(damping, hidden=True)
    assert np.isfinite(bc.hinf_norm(hidden).lower_bound) == finite
    assert np.isfinite(bc.h2_norm(hidden).value) == finite


@pytest.mark.parametrize("damping", DAMPINGS)
def test_mode_tables(damping):
    for system in (oscillator(damping), structure(damping)):
        slow = bc.mode_table(system).rows[0]
        assert slow.omega == pytest.approx(OMEGA)
        assert np.isinf(slow.modal_peaks).all() == (side(damping) == 0)


@pytest.mark.slow
@pytest.mark.parametrize("damping", DAMPINGS)
def test_loops(damping):
    """The loop is that of the plant: its controller does nothing."""
    plant = structure(damping)
    stable = side(damping) < 0
    loop = bc.feedback_loop(plant, NOTHING, injection_points=["u"])
    assert np.isfinite(bc.hinf_norm(loop).lower_bound) == (damping > 0.0)
    if stable:
        assert bc.margins(plant, NOTHING).loops
    else:
        with pytest.raises(ValueError, match="loop is not stable"):
            bc.margins(plant, NOTHING)
    family = AffineFamily.from_function(
        {"k": (0.9, 1.1)},
        lambda v: SecondOrderModel(
            plant.M, plant.C, v["k"] * np.asarray(plant.K), {"u": [1.0], "w": [1.0]}, {"y": [1.0]}
        ),
    )
    assert (bc.robust_stability(family, NOTHING).destabilizing_values is None) == stable
    assert np.isfinite(bc.worst_case(family, NOTHING, rtol=None).worst_norm.lower_bound) == (damping > 0.0)


@pytest.mark.parametrize("damping", DAMPINGS)
def test_a_controller_that_resonates(damping):
    A = hard_systems.oscillator(OMEGA, damping)
    controller = control.ss(A, [[0.0], [1e-9]], [[1e-9, 0.0]], 0.0, inputs="y", outputs="u")
    plant = SecondOrderModel([[1.0]], [[0.4]], [[1.0]], {"u": [1.0]}, {"y": [1.0]})

    def stability():
        return bc.analysis.nyquist_stability(plant.frequency_response, controller, [-0.2 + 1j])

    if side(damping) == 0:
        with pytest.raises(ValueError, match="no pole on the imaginary axis"):
            stability()
    else:
        found = stability()
        assert found.unstable_controller_poles == (0 if damping > 0.0 else 2)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("damping", DAMPINGS)
def test_reductions_keep_what_does_not_decay(damping, method):
    kept = 0 if side(damping) < 0 else 2
    found = bc.reduce(oscillator(damping), order=4, method=method)
    assert found.retained_order == kept


def generalized(damping):
    """Return a plant with a mode that neither the control moves nor the measurement sees, and a lag that both do."""
    A = linalg.block_diag(hard_systems.oscillator(OMEGA, damping), -1.0)
    B = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, 1.0]]
    C = [[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    return control.ss(A, B, C, [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.1, 0.0]])


LAST = [0.0, 0.0, 1.0, 1.0]  # weights of the other mode alone
DESIGNS = {
    "is uncontrollable": lambda d: bc.lqr(oscillator(d, hidden=True), 1.0, 1.0),
    "is unobservable": lambda d: bc.kalman(oscillator(d, hidden=True), 1.0, 1.0),
    "2 rad/s": lambda d: bc.h2(generalized(d), 1, 1),
    "at 2 rad/s": lambda d: bc.h_infinity(generalized(d), 1, 1),
}
UNWEIGHED = {
    "is undamped and has no part": lambda d: bc.lqr(oscillator(d), LAST, 1.0),
    "is undamped and not excited": lambda d: bc.kalman(oscillator(d), np.diag(LAST), 1.0),
    "undamped and has no part": lambda d: bc.lqg(oscillator(d), LAST, 1.0, 1.0, 1.0),
}


@pytest.mark.parametrize("damping", DAMPINGS)
def test_designs_refuse_modes_that_do_not_decay(damping):
    """Those that nothing moves or sees; of modes that have no weight, the undamped ones alone."""
    refused = (DESIGNS if side(damping) >= 0 else {}) | (UNWEIGHED if side(damping) == 0 else {})
    for words, design in (DESIGNS | UNWEIGHED).items():
        with pytest.raises(bc.exceptions.SynthesisError, match=words) if words in refused else nullcontext():
            design(damping)
