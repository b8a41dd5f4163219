"""Stability over boxes of parameters: closed forms, no proof where a point is unstable, bounds in order."""

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boomctl import gain_schedule
from boomctl.analysis import hinf_norm, robust_stability, robust_stability_margin, worst_case
from boomctl.analysis.box.loops import BoxLoops
from boomctl.analysis.box.polynomials import Cell
from boomctl.analysis.loops import feedback_loop
from boomctl.boom import boom_family
from boomctl.identification.families import names_of_mode, of_modes
from boomctl.identification.modal.modal_structure import modal_structure
from boomctl.structure import SecondOrderModel
from boomctl.structure.families import AffineFamily, PolynomialFamily, Slope
from boomctl.synthesis.discretise import discretize
from tests.analysis.loop_cases import chain, velocity_feedback
from tests.profiles import examples


def oscillators(ranges, damper=0.02, outputs=("y",)):
    def make(values):
        m, c, k = (values.get(name, default) for name, default in (("m", 1.0), ("c", damper), ("k", 4.0)))
        return SecondOrderModel([[m]], [[c]], [[k]], {"u": [1.0], "w": [1.0]}, {name: [1.0] for name in outputs})

    return AffineFamily.from_function(ranges, make)


def feedback(gain):
    return control.ss([], [], [], [[gain]], inputs=["y"], outputs=["u"])


@given(st.floats(-3.0, 3.5), st.floats(0.05, 3.0), st.sampled_from([0.02, 4.5, 100.0]))
@examples(30)
def test_an_uncertain_spring_bears_what_its_closed_form_says(gain, width, damper):
    """``k + d width - gain > 0`` for stability; of the strong dampers all poles are real."""
    family, exact = oscillators({"k": (4.0 - width, 4.0 + width)}, damper), (4.0 - gain) / width
    found = robust_stability_margin(family, feedback(gain), max_factor=200.0, rtol=0.02)
    assert found.lower_bound <= exact * (1.0 + 1e-9)
    assert exact <= found.upper_bound * (1.0 + 1e-9)
    assert found.lower_bound >= 0.95 * found.upper_bound
    assert found.mu_lower <= found.mu_upper
    assert robust_stability(family, feedback(gain)).proved == (exact > 1.0) or abs(exact - 1.0) < 0.01


def test_sampled_robust_stability_margin_brackets():
    family = oscillators({"k": (3.0, 5.0)}, damper=0.2)
    K = control.ss([], [], [], [[1.0]], 0.1, inputs=["y"], outputs=["u"])
    found = robust_stability_margin(family, K, rtol=0.05, delay=0.05)
    assert 0.0 < found.lower_bound < found.upper_bound < 1.06 * found.lower_bound
    for factor, stable in ((found.lower_bound, True), (1.001 * found.upper_bound, False)):
        loops = [feedback_loop(family.at([end]), K, "u", delay=0.05) for end in (-factor, 0.0, factor)]
        assert all((np.abs(loop.poles()) < 1.0).all() for loop in loops) == stable


def test_search_stops_at_first_unstable_point():
    """It is unstable everywhere: the middle, which is asked first, says so, though a corner is worse."""
    family = oscillators({"k": (3.0, 5.0)})
    found, margin = robust_stability(family, feedback(6.0)), robust_stability_margin(family, feedback(6.0))
    assert margin.lower_bound == margin.upper_bound == 0.0
    assert margin.mu_lower == margin.mu_upper == np.inf
    assert found.destabilizing_values == found.worst_values == {"k": 4.0}
    assert found.spectral_abscissa == pytest.approx(np.sqrt(2.0), rel=0.01)


def test_verdicts_read_as_what_they_are():
    family = oscillators({"k": (3.0, 5.0)})
    stable, unstable = robust_stability(family, feedback(1.0)), robust_stability(family, feedback(3.5))
    assert stable.summary.startswith("proved stable over the box in")
    assert unstable.summary.startswith("unstable at k = ")
    assert "times; unstable at " in robust_stability_margin(family, feedback(1.0), max_factor=10.0).summary
    assert "no instability found" in robust_stability_margin(family, feedback(1.0), max_factor=2.0).summary
    worst = worst_case(family, feedback(0.0), "w", "y")
    assert f"of at least {worst.worst_norm.lower_bound:.5g} at k = " in worst.summary


@pytest.mark.parametrize(("limit", "width"), [(1, 0.999999), (20, 0.999999), (3, 0.9)])
def test_a_proof_that_is_given_up_says_where_and_why(limit, width):
    """``k - gain`` and the damper both come close to nothing, which few cells cannot tell from it."""
    family = oscillators({"k": (4.0 - 3.0 * width, 4.0 + 3.0 * width), "c": (1e-9, 2.0)})
    found = robust_stability(family, feedback(1.0), limit)
    if found.proved:
        assert found.message == ""
    else:
        assert found.destabilizing_values is None
        assert found.message.startswith("not decided at k = ")
        assert f"more than max_cells = {limit}, or cells below 1/{limit} of the box" in found.message
        assert found.message in found.summary
    assert not robust_stability(oscillators({"k": (3.0, 5.0)}), feedback(1.0)).message


def modal(seed, modes, width):
    """Return a family over frequencies and dampings of the modes of a structure with an accelerometer beside its shaker."""
    rng = np.random.default_rng(seed)
    hz, damping = np.cumsum(rng.uniform(0.5, 2.0, modes)), rng.uniform(0.003, 0.02, modes)
    pole = 2.0 * np.pi * hz * (-damping + 1j * np.sqrt(1.0 - damping**2))
    shape = rng.uniform(0.5, 1.5, (modes, 1)) * np.exp(0.05j * rng.standard_normal((modes, 1)))
    D = np.array([[shape.real.sum() + 0.3]])  # Of modes above, too.
    model = modal_structure(
        pole, np.ones((modes, 1)), shape * (pole**2 / (2j * pole.imag))[:, None], D, ["u"], ["y"], derivatives=[2]
    )
    own = [(abs(p) / (2.0 * np.pi) * np.sqrt(1.0 - z**2), z) for p, z in zip(pole, damping, strict=True)]
    values = {name: x for k, mode in enumerate(own) for name, x in zip(names_of_mode(k), mode, strict=True)}
    return of_modes(model, own, {name: (x * (1.0 - width), x * (1.0 + width)) for name, x in values.items()})


def acceleration_feedback(gain):
    return control.ss([[-50.0]], [[50.0]], [[gain]], [[0.2 * gain]], inputs=["y"], outputs=["u"])


def loop_with_feedthrough(rng):
    return modal(int(rng.integers(1000)), 3, 0.02), acceleration_feedback(-0.2)


def loop_with_filtered_accelerations(rng):
    signals = {"inputs": ["tip_acceleration_anti", "stroke_anti"], "outputs": "suspension_anti"}
    K = control.ss(-3.0 * np.eye(2), np.eye(2), [[5.0, 1.0]], [[1.0, -20.0]], **signals)
    return boom_family(subsystem="yaw", accelerometer_bandwidth_hz=20.0), K


def loop_with_changing_sensors(rng, read=("y0", "y1")):
    """Return a loop with a parameter that changes springs, what the forces act on and what the outputs read at once."""
    base, stiff, lines, pushes = chain(int(rng.integers(1000))), *(rng.uniform(0.0, 1.0, (4, 2)) for _ in range(3))

    def make(v):
        K = base.K + 0.3 * v["k"] * stiff @ stiff.T
        forces = {f"u{i}": base.ports.B[0][:, 2 * i] + 0.2 * v["b"] * pushes[:, i] for i in range(2)}
        outputs = {name: base.ports.L[0][2 * i] + 0.2 * v["k"] * lines[:, i] for i, name in enumerate(read)}
        return SecondOrderModel(base.M, base.C, K, forces, outputs)

    return AffineFamily.from_function({"k": (-1.0, 1.0), "b": (-1.0, 1.0)}, make), velocity_feedback(0.1, 3.0)


def loop_with_polynomials(rng):
    """Return a loop whose matrices are polynomials of the fourth degree of two parameters."""
    n, changes = 3, []
    middle = SecondOrderModel(np.eye(n), 0.3 * np.eye(n), np.diag([1.0, 4.0, 9.0]), {"f": [1, 0, 0]}, {"y": [0, 1, 0]})
    for power in [(0,), (1,), (0, 0), (0, 1), (1, 1, 1), (0, 0, 1, 1)]:
        M, C, K = (scale * rng.standard_normal((n, n)) for scale in (0.02, 0.1, 0.5))
        changes.append((power, Slope(0.5 * (M + M.T), C, K, np.zeros((3, n, 1)))))
    family = PolynomialFamily(("p", "q"), -np.ones(2), np.ones(2), middle, tuple(changes))
    return family, control.ss([[-2.0]], [[1.0]], [[0.2]], [[-0.1]], inputs="y", outputs="f")


def loop_with_schedule(rng):
    """Return a loop whose controller follows a parameter that changes what forces act on, or what outputs read, too."""
    family, K = loop_with_changing_sensors(rng, ("k", "b"))
    names = {"inputs": ["k", "b"], "outputs": K.output_labels}
    laws = [control.ss(K.A, K.B, gain * K.C, gain * K.D, **names) for gain in (1.0, 3.0)]
    return family, gain_schedule(laws, [-1.0, 1.0], str(rng.choice(family.names)))


@pytest.mark.parametrize(
    ("make", "digits"),
    [
        (loop_with_schedule, 1e-7),
        (loop_with_polynomials, 1e-9),
        (loop_with_feedthrough, 1e-9),
        (loop_with_changing_sensors, 1e-7),
        (loop_with_filtered_accelerations, 1e-6),
    ],
)
@given(st.integers(0, 1000))
@examples(20)
def test_loops_of_a_box_have_poles_of_state_space(make, digits, seed):
    rng = np.random.default_rng(seed)
    family, K = make(rng)
    for delta in rng.uniform(-1.0, 1.0, (3, family.nparameters)):
        mine = BoxLoops.of(family, K).poles(delta)
        frozen = K if isinstance(K, control.StateSpace) else K.at(family.denormalize(delta)[K.signal])
        true = feedback_loop(family.at(delta), frozen, injection_points=K.output_labels).poles()
        assert len(mine) == len(true)
        assert (np.abs(mine[:, None] - true).min(axis=0) <= digits * np.abs(true)).all()


@given(st.integers(0, 1000))
@examples(20)
def test_polynomial_loop_stable_on_largest_proved_cell(seed):
    """Of cells about one point the large ones contain unstable loops and are not proved; a small one is proved."""
    rng = np.random.default_rng(seed)
    family, K = loop_with_polynomials(rng)
    prove, middle = BoxLoops.of(family, K).parts()[0].prover(1.0), rng.uniform(-0.5, 0.5, 2)
    reaches = 0.8 ** np.arange(1, 26)
    proved = next(k for k, reach in enumerate(reaches) if prove(Cell(middle, np.full(2, reach))) is None)
    assert proved > 0
    corners = [[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]]
    for point in middle + reaches[proved] * np.vstack([corners, rng.uniform(-1.0, 1.0, (8, 2))]):
        assert feedback_loop(family.at(point), K, injection_points="f").poles().real.max() < 0.0


def test_worst_case_of_scheduled_controller_bounds_frozen_loops():
    family = oscillators({"k": (3.0, 5.0), "c": (0.3, 0.5)}, outputs=("y", "k"))
    signals = {"inputs": ["k", "y"], "outputs": "u"}
    laws = [control.ss([[-4.0]], [[0.0, 1.0]], [[gain]], [[0.0, -0.2 * gain]], **signals) for gain in (0.5, 2.0, 0.2)]
    scheduled = gain_schedule(laws, [3.0, 4.2, 5.0], "k")
    found = worst_case(family, scheduled, "w", "y")
    assert found.relative_gap <= 1.001e-3
    for delta in np.random.default_rng(0).uniform(-1.0, 1.0, (20, 2)):
        K = scheduled.at(family.denormalize(delta)["k"])
        assert hinf_norm(feedback_loop(family.at(delta), K)["y", "w"]).lower_bound <= found.upper_bound


def test_feedthrough_that_controller_inverts_is_refused():
    family = modal(0, 3, 0.02)
    ill = control.ss([], [], [], [[1.0 / family.nominal.ports.E[0, 0, 0]]], inputs=["y"], outputs=["u"])
    with pytest.raises(ValueError, match="well-posed"):
        robust_stability(family, ill)


SLOW = [pytest.param(*case, marks=pytest.mark.slow) for case in ((16, None), (6, 0.005), (14, 0.005))]


@pytest.mark.parametrize(("modes", "step"), [(6, None), *SLOW])
def test_family_of_many_modes_is_proved_or_refuted(modes, step):
    """The controller has feedthrough, which couples coordinates; poles of loops at corners and points are an oracle."""
    family = modal(1, modes, 0.005 if step else 0.01)
    stable, unstable = (
        discretize(acceleration_feedback(gain), step) if step else acceleration_feedback(gain) for gain in (-0.01, 0.08)
    )
    assert family.nparameters == 2 * modes
    assert stable.D.any()
    found = robust_stability(family, stable, 20)
    assert found.proved
    assert robust_stability(family, unstable, 20).destabilizing_values is not None
    rng = np.random.default_rng(0)
    for delta in (
        *rng.choice([-1.0, 1.0], (50, family.nparameters)),
        *rng.uniform(-1.0, 1.0, (50, family.nparameters)),
    ):
        poles = feedback_loop(family.at(delta), stable, injection_points="u").poles()
        rate = np.log(np.abs(poles)).max() / step if step else poles.real.max()
        assert rate <= found.spectral_abscissa * (1.0 - 1e-9) < 0.0
