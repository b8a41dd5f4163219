"""Margins: loops with margins in closed form, limits that are limits, and no dependence on units."""

from dataclasses import replace

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import linalg

from boomctl.analysis import margins
from boomctl.exceptions import MarginAccuracyWarning, MarginLossWarning
from tests.analysis.loop_cases import SIGNALS, chain, radius, velocity_feedback
from tests.profiles import examples


def lag(*roots, zeros=(), gain=1.0):
    """Return the states of ``gain prod(s + zero)/prod(s + root)``."""
    return control.tf2ss(gain * np.poly(-np.array(zeros)), np.poly(-np.array(roots)))


def cascade(*roots):
    """Return the states of equal and different lags of gain one in a row; a transfer function of slow ones has none."""
    A, B = np.diag(-np.array(roots)) + np.diag(roots[1:], -1), np.eye(len(roots), 1) * roots[0]
    return control.ss(A, B, np.eye(len(roots))[-1:], 0.0)


def opened(system, gain):
    plant = control.ss(system.A, system.B, system.C, system.D, system.dt, inputs=["u"], outputs=["y"])
    return margins(plant, control.ss([], [], [], [[-gain]], system.dt, inputs=["y"], outputs=["u"]))["u"]


@given(st.one_of(st.floats(0.2, 7.0), st.floats(-7.0, 0.0).map(lambda decade: 1.0 + 10.0**decade)))
@examples(25)
def test_three_equal_lags_bear_a_gain_of_eight(gain):
    """``L = -gain/(s + 1)^3``: gain one at ``sqrt(gain^(2/3) - 1)``, be it a little above one at rest or far."""
    found = opened(lag(1.0, 1.0, 1.0), gain)
    assert found.gain_margin[1] == pytest.approx(8.0 / gain, rel=1e-6)
    assert found.gain_margin_omega[1] == pytest.approx(np.sqrt(3.0), rel=1e-6)
    if gain > 1.0:
        omega = np.sqrt(np.expm1(np.log(gain) * 2.0 / 3.0))
        angle = np.pi - 3.0 * np.arctan(omega)
        assert found.phase_margin_deg == pytest.approx(np.degrees(angle), rel=1e-5)
        assert found.delay_margin_omega == pytest.approx(omega, rel=1e-5)
        assert found.delay_margin == pytest.approx(angle / omega, rel=1e-5)
    assert found.gain_margin[1] >= found.disk_margin.gain_margin * (1.0 - 1e-5)


def test_margins_do_not_depend_on_units():
    system, K = chain(5).to_statespace(), velocity_feedback(0.3)
    a, b = np.diag([1e3, 1.0, 1e-2]), np.diag([1e2, 1.0, 1e-4])
    other = control.ss(
        system.A, system.B @ a, b @ system.C, 0.0, inputs=system.input_labels, outputs=system.output_labels
    )
    u, y = np.linalg.inv(a[::2, ::2]), np.linalg.inv(b[::2, ::2])
    scaled = control.ss(K.A, K.B @ y, u @ K.C, u @ K.D @ y, **SIGNALS)
    first, second = margins(system, K), margins(other, scaled)
    for name in ("multiloop_input", "multiloop_output", "multiloop_io"):
        assert getattr(second, name).alpha == pytest.approx(getattr(first, name).alpha, rel=2e-2)
    assert second["u1"].phase_margin_deg == pytest.approx(first["u1"].phase_margin_deg, rel=1e-5)
    assert "all loops: everywhere" in str(first)


@given(st.floats(0.05, 0.95))
@examples(10)
def test_a_loop_that_is_lost_at_rest_is_limited_there(gain):
    """``L = gain/(s + 1)`` fed back positively is lost by a pole through zero; its response there is real."""
    found = opened(lag(1.0), -gain)
    assert found.gain_margin[1] == pytest.approx(1.0 / gain, rel=1e-9)
    assert found.gain_margin_omega[1] == 0.0


@pytest.mark.parametrize("excess", [0.0, 1e-3, 1.0, 49.0])
@given(st.floats(0.01, 100.0), st.floats(0.01, 100.0))
@examples(20)
def test_no_delay_is_borne_where_gain_stays_above_one(excess, zero, pole):
    """``L = -(1 + excess)(s + zero)/(s + pole)``: at high frequencies a delay turns it to any angle."""
    found = opened(lag(pole, zeros=[zero]), 1.0 + excess)
    assert (found.delay_margin, found.delay_margin_omega) == (0.0, np.inf)
    assert excess or abs(zero - pole) < 0.1 * pole or found.phase_margin_deg == 180.0


@given(st.integers(1, 6), st.floats(-4.0, 4.0), st.floats(0.5, 2.0))
@examples(30)
def test_a_gain_of_one_at_rest_alone_bears_any_delay(order, decade, spread):
    """Equal and different lags of gain one: below it at every frequency but zero; a delay does nothing at rest."""
    roots = 10.0**decade * np.geomspace(1.0, spread, order)
    found = opened(cascade(*roots), 1.0)
    assert found.delay_margin == np.inf
    assert (found.phase_margin_deg, found.phase_margin_omega) == (180.0, 0.0)


@pytest.mark.parametrize(("damping", "omega"), [(1.0, 1.0), (0.3, 1.0), (0.1, 7.0)])
def test_gain_that_touches_one_limits_phase(damping, omega):
    """A band-pass filter has a gain of one and no phase at its center alone."""
    rate = 2.0 * damping * omega
    found = opened(control.ss(control.tf([rate, 0.0], [1.0, rate, omega**2]), inputs="u", outputs="y"), 1.0)
    assert (found.phase_margin_deg, found.phase_margin_omega) == pytest.approx((180.0, omega), rel=1e-6)


@pytest.mark.parametrize(
    ("gain", "phase", "delay"), [(-0.5, np.inf, np.inf), (0.5, np.inf, np.inf), (1.0, 180.0, 0.0), (2.0, np.inf, 0.0)]
)
def test_a_loop_without_dynamics_has_margins(gain, phase, delay):
    """``L = -gain`` at all frequencies; the disk is ``2/|S - T|`` with ``S = 1/(1 + gain)``."""
    found = opened(control.ss([], [], [], [[1.0]]), gain)
    assert (found.phase_margin_deg, found.delay_margin) == (phase, delay)
    assert found.gain_margin[1] == (-1.0 / gain if gain < 0.0 else np.inf)
    exact = abs(2.0 * (1.0 + gain) / (1.0 - gain)) if gain != 1.0 else np.inf
    assert found.disk_margin.alpha == pytest.approx(min(exact, 2.0), rel=1e-5)


def test_loops_without_dynamics_around_one_another_have_margins():
    """``I - K G`` with a diagonal entry of zero: opened there, the loop has an infinite gain."""
    plant = control.ss([], [], [], [[1.0, 1.0], [1.0, 0.0]], inputs=["u0", "u1"], outputs=["y0", "y1"])
    K = control.ss([], [], [], np.diag([1.0, 2.0]), inputs=["y0", "y1"], outputs=["u0", "u1"])
    found = margins(plant, K)
    assert all(loop.delay_margin == 0.0 for loop in (found["u1"], found["y1"]))
    assert np.isfinite(found.multiloop_io.alpha)


@pytest.mark.parametrize("seed", [0, pytest.param(10, marks=pytest.mark.slow)])
def test_margins_of_cascade_are_those_of_weakest_loop(seed):
    """Signals scaled further and further apart leave nothing of what leads from one loop to the next."""
    rng, n = np.random.default_rng(seed), 6
    A, C = -np.diag(rng.uniform(0.5, 5.0, n)), np.triu(rng.normal(size=(n, n))) * 10.0 ** rng.uniform(-1, 1, (n, 1))
    C[np.arange(n), np.arange(n)] = np.abs(np.diag(C))
    u, y = [f"u{i}" for i in range(n)], [f"y{i}" for i in range(n)]
    K = control.ss([], [], [], -np.diag(rng.uniform(0.2, 2.0, n)), inputs=y, outputs=u)
    found = margins(control.ss(A, np.eye(n), C, 0.0, inputs=u, outputs=y), K)
    least = min(loop.disk_margin.alpha for loop in found.loops)
    assert found.multiloop_input.alpha == pytest.approx(least, rel=1e-3)
    assert found.multiloop_output.alpha == pytest.approx(least, rel=1e-3)


def test_margins_narrow_loop_invariant_to_units():
    """Poles eleven decades below the fastest, and a resonance of a billionth of its frequency: both cross."""
    slow = control.ss(np.diag([-1e-7, -1e5]), [[1e-6], [1e4]], [[1.0, 1.0]], 0.0)
    assert opened(slow, 1.0).phase_margin_omega == pytest.approx(1e-7 * np.sqrt(99.0), rel=0.2)
    w, narrow = 3.0, 1e-9
    A = w * np.array([[-narrow, 1.0], [-1.0, -narrow]])
    # -K P = g 1e-9 w/((s + w narrow)^2 + w^2): real and negative on the axis at rest alone, one in size beside w
    found = opened(control.ss(A, [[1.0], [0.0]], [[0.0, 1e-9]], 0.0), 10.0)
    assert found.phase_margin_omega == pytest.approx(w, rel=1e-6)
    assert np.isfinite(found.phase_margin_deg)


@pytest.mark.slow
def test_margins_that_rounding_changes_are_said_to_be_uncertain():
    rng = np.random.default_rng(0)
    n = 8
    U, V = (np.linalg.qr(rng.standard_normal((n, n)))[0] for _ in range(2))
    T = U @ np.diag(np.geomspace(1e-4, 1e4, n)) @ V
    A = np.kron(np.diag(np.arange(1.0, 5.0)), np.array([[-1e-4, 1.0], [-1.0, -1e-4]]))
    back = np.linalg.inv(T)
    B, C = np.ones((n, 1)), np.ones((1, n))
    with pytest.warns(MarginAccuracyWarning, match="rounding"):
        bad = opened(control.ss(T @ A @ back, T @ B, C @ back, 0.0), 0.01)
    assert not bad.disk_margin.certified
    good = opened(control.ss(A, B, C, 0.0), 0.01)
    assert good.rounding_error < 1e-9 < bad.rounding_error


@pytest.mark.parametrize("stiffness", [1.0, 4.0, 0.25])
def test_a_loop_opened_where_the_rest_of_it_swings_undamped(stiffness):
    """Opened at the speed, a mass on a spring is left: at its frequency, met to the last digit, L is infinite."""
    signals = {"inputs": "force", "outputs": ["place", "speed"]}
    mass = control.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], np.eye(2), np.zeros((2, 1)), **signals)
    K = control.ss([], [], [], [[-stiffness, -1.0]], inputs=["place", "speed"], outputs="force")
    found = margins(mass, K)
    assert found["speed"].gain_margin[0] == 0.0
    assert found["speed"].gain_margin[1] == np.inf
    crossing = np.sqrt(0.5 * (1.0 + np.sqrt(1.0 + 4.0 * stiffness**2)))  # where |(s + k)/s^2| is one
    assert found["force"].phase_margin_deg == pytest.approx(np.degrees(np.arctan(crossing / stiffness)), rel=1e-9)


def random_case(seed, kind):
    """Return a stable random loop in continuous time, discrete or sampled: a plant, a controller and a delay."""
    rng = np.random.default_rng(seed)
    n, q, m, p = (int(rng.integers(low, high)) for low, high in ((1, 6), (0, 4), (1, 3), (1, 3)))
    dt = {"continuous": 0.0, "discrete": 0.1, "sampled": 10.0 ** rng.uniform(-2.0, 0.3)}[kind]
    u, y = [f"u{i}" for i in range(m)], [f"y{i}" for i in range(p)]

    def stable(size, step):
        A = 3.0 * rng.standard_normal((size, size))
        poles = np.linalg.eigvals(A)
        if step:
            return A * rng.uniform(0.2, 0.99) / np.abs(poles).max(initial=1e-9)
        return A - (poles.real.max(initial=0.0) + 10.0 ** rng.uniform(-2.0, 1.0)) * np.eye(size)

    D = rng.standard_normal((p, m)) * (kind == "sampled" and seed % 3 == 0)
    plant_dt = dt if kind == "discrete" else 0.0
    B, C = rng.standard_normal((n, m)), rng.standard_normal((p, n))
    plant = control.ss(stable(n, plant_dt), B, C, D, plant_dt, inputs=u, outputs=y)
    AK, BK, CK, DK = stable(q, dt), *(rng.standard_normal(shape) for shape in ((q, p), (m, q), (m, p)))
    gain, late = 10.0 ** rng.uniform(-1.0, 1.5), dt * (0.0, 1.0, 0.3, 1.7, 2.0, 3.6)[seed % 6] * (kind == "sampled")
    while True:
        K = control.ss(AK, BK, gain * CK, gain * DK, dt, inputs=y, outputs=u)
        if growth((plant, K, late), u[0], 1.0) < -1e-4:
            return plant, K, late
        gain /= 2.0


def closed_matrix(plant, K, signal, factor, samples=0):
    """Return the state matrix of ``u = K y`` with a signal multiplied by a factor and delayed by whole samples."""
    labels, q = (K.output_labels if signal in K.output_labels else K.input_labels), K.nstates
    A, B, C, D = K.A.astype(complex), K.B.astype(complex), K.C.astype(complex), K.D.astype(complex)
    i = labels.index(signal)
    A, ends = np.pad(A, (0, samples)), np.eye(1, samples, samples - 1)[0] * factor
    A[q:, q:] = np.eye(samples, k=-1)
    B, C = np.pad(B, ((0, samples), (0, 0))), np.pad(C, ((0, 0), (0, samples)))
    if signal in K.output_labels:
        if samples:
            A[q, :q], B[q], C[i, q:], C[i, :q], D[i] = C[i, :q], D[i], ends, 0.0, 0.0
        else:
            C[i], D[i] = factor * C[i], factor * D[i]
    elif samples:
        A[:q, q:], C[:, q:] = np.outer(B[:q, i], ends), np.outer(D[:, i], ends)
        B[:, i], D[:, i] = 0.0, 0.0
        B[q, i] = 1.0
    else:
        B[:, i], D[:, i] = factor * B[:, i], factor * D[:, i]
    return np.block([[plant.A + plant.B @ D @ plant.C, plant.B @ C], [B @ plant.C, A]])


def growth(loop, signal, factor, *, delay=0.0):
    """Return the spectral abscissa of a continuous loop, or the spectral radius of a discrete one less one.

    A continuous loop with a delay is discretized by collocation at Chebyshev points of its history.
    """
    plant, K, late = loop
    if K.dt and not plant.dt:
        return radius(plant, K, late, gain=factor, of=signal, further=delay, at=signal) - 1.0
    if K.dt:
        poles = np.linalg.eigvals(closed_matrix(plant, K, signal, factor, round(delay / K.dt)))
        return float(np.abs(poles).max()) - 1.0
    A = closed_matrix(plant, K, signal, factor)
    if delay:
        A = A.real
        late, count, n = A - (first := closed_matrix(plant, K, signal, 0.0).real), 12, len(A)
        x = np.cos(np.pi * np.arange(count + 1) / count)
        c = np.array([2.0, *np.ones(count - 1), 2.0]) * (-1.0) ** np.arange(count + 1)
        slopes = np.outer(c, 1.0 / c) / (x[:, None] - x + np.eye(count + 1))
        slopes -= np.diag(slopes.sum(axis=1))
        A = np.kron(slopes * 2.0 / delay, np.eye(n))
        A[:n], A[:n, :n], A[:n, -n:] = 0.0, first, late
    return float(np.linalg.eigvals(A).real.max())


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("kind", ["continuous", "discrete", "sampled"])
@given(st.integers(0, 100_000))
@examples(60)
def test_margin_is_where_brute_force_loses_stability(kind, seed):
    plant, K, late = random_case(seed, kind)
    found = margins(plant, K, delay=late)
    for loop in found.loops:
        assert loop.disk_margin.alpha >= found.multiloop_io.alpha * (1.0 - 1e-4)
        assert loop.gain_margin[1] >= loop.disk_margin.gain_margin * (1.0 - 1e-4)
        assert loop.phase_margin_deg >= loop.disk_margin.phase_margin_deg * (1.0 - 1e-4)

        def stable(factor, delay=0.0, signal=loop.signal):
            return growth((plant, K, late), signal, factor, delay=delay) < 1e-9

        low, high = max(loop.gain_margin[0], 1e-3) * (1.0 + 1e-4), min(loop.gain_margin[1], 1e3) * (1.0 - 1e-4)
        assert all(stable(float(factor)) for factor in np.geomspace(low, high, 25))
        limits = [f for f in (loop.gain_margin[0] * (1.0 - 1e-3), loop.gain_margin[1] * (1.0 + 1e-3)) if 0.0 < f < 1e6]
        assert not any(stable(factor) for factor in limits)
        angle = 1j * np.radians(min(loop.phase_margin_deg, 180.0))
        assert all(stable(np.exp(sign * x * angle)) for x in np.linspace(0.05, 1.0 - 1e-4, 13) for sign in (-1, 1))
        if loop.phase_margin_deg < 179.0:
            assert not all(stable(np.exp(sign * (1.0 + 1e-3) * angle)) for sign in (-1, 1))
        bound = loop.delay_margin
        if kind == "discrete":
            assert all(stable(1.0, k * K.dt) for k in range(1, 12) if k * K.dt < bound * (1.0 - 1e-9))
            if np.isfinite(bound):
                turned = closed_matrix(plant, K, loop.signal, np.exp(-1j * loop.delay_margin_omega * bound))
                on_circle = np.abs(np.linalg.eigvals(turned) - np.exp(1j * loop.delay_margin_omega * K.dt)).min() < 1e-5
                assert on_circle or not stable(1.0, bound)
        else:
            longest = min(bound, 5.0 * (K.dt or 1.0))
            assert all(stable(1.0, x * longest) for x in (0.1, 0.4, 0.8, 1.0 - 1e-3))
            if 0.0 < loop.delay_margin < 10.0 * (K.dt or 0.1):
                assert not stable(1.0, loop.delay_margin * (1.0 + 1e-3))


@pytest.mark.parametrize("gain", [1.2, pytest.param(1.7, marks=pytest.mark.slow)])
def test_delay_margin_of_sampled_integrator_in_closed_form(gain):
    """With ``u = -gain y/h``, ``d`` late, the poles are the roots of ``z^2 - (1 - gain (1 - d/h)) z + gain d/h``."""
    h = 0.5
    K = control.ss([], [], [], [[-gain / h]], h, inputs="y", outputs="u")
    with pytest.warns(MarginLossWarning, match="takes the disk margin from 2 to"):
        found = margins(control.ss(0.0, 1.0, 1.0, 0.0, inputs="u", outputs="y"), K)
    for loop in found.loops:
        assert loop.delay_margin == pytest.approx(h / gain, rel=1e-8)
        assert loop.delay_margin_omega == pytest.approx(np.arccos(1.0 - 0.5 * gain) / h, rel=1e-8)


def test_discrete_gain_above_one_at_nyquist_allows_no_sample():
    """``u = -2 y`` around a unit gain: one sample of delay moves the pole to ``z = -2``."""
    names = {"inputs": "u", "outputs": "y"}
    found = margins(
        control.ss([], [], [], 1.0, 0.5, **names), control.ss([], [], [], -2.0, 0.5, inputs="y", outputs="u")
    )
    assert [(loop.delay_margin, loop.delay_margin_omega) for loop in found.loops] == [
        (0.5, pytest.approx(np.pi / 0.5))
    ] * 2


@pytest.mark.parametrize("seed", range(10))
def test_gain_limit_at_rest_sampled_loop_exact(seed):
    """A loop of positive gain at ``z = 1`` bears the inverse of it: a sum over modes there has real poles and pairs."""
    rng = np.random.default_rng(seed)
    poles, T = np.exp(rng.uniform(-3.0, -0.5, 3) + 1j * rng.uniform(0.3, 2.5, 3)), rng.standard_normal((7, 7))
    A = linalg.block_diag(*([[p.real, p.imag], [-p.imag, p.real]] for p in poles), 0.95)
    A, B, C = T @ A @ np.linalg.inv(T), T[:, 6:], np.linalg.inv(T)[6:]  # one over z - 0.95, and what does not show
    gain = rng.uniform(0.01, 0.045)
    found = opened(control.ss(A, B, C, 0.0, 0.1), -gain)
    assert found.gain_margin[1] == pytest.approx(0.05 / gain, rel=1e-9)
    assert found.gain_margin_omega[1] == 0.0


def test_margins_table_uncertified_disk_prints_lower_bound():
    plant = control.ss([[-1.0]], [[1.0]], [[1.0]], 0.0, inputs="u", outputs="y")
    found = margins(plant, control.ss([], [], [], -2.0, 0.1, inputs="y", outputs="u"))
    heads, one, _ = (line.split() for line in str(found).splitlines()[:3])
    assert heads[2:9] == ["gain", "min", "max", "min", "[dB]", "max", "[dB]"]
    assert one[1:6] == ["0", "10.01", "-inf", "20.01", f"{np.pi / 0.1:.4g}"]
    assert one[-2] == f"{found['u'].delay_margin:.4g}"
    assert f"delay {found['u'].delay_margin:.4g} s" in repr(found)
    assert replace(found["u"].disk_margin, verified=False)._text.startswith(">= ")
    assert found["u"].plot().get_lines()
