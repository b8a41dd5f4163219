"""Bode, Nyquist, step, impulse, poles and zeros, comparisons: against python-control and by their laws."""

import control
import numpy as np
import pytest
from flint import fmpq, fmpq_mat, fmpq_poly
from hypothesis import given
from hypothesis import strategies as st
from matplotlib import pyplot as plt
from scipy import linalg

import boomctl as bc
from boomctl.analysis import feedback_loop, nyquist_stability
from boomctl.analysis.sigma import looked_at
from boomctl.boom import BoomParameters, exact_frequency_response, spray_boom
from tests import handed_out as one
from tests.analysis.loop_cases import SIGNALS, chain, velocity_feedback
from tests.exact import on_axis, roots
from tests.hard_systems import unimodular
from tests.profiles import examples, is_quick
from tests.strategies import seeds


def swinging(seed, modes=4, least=1e-6):
    """Return a random system of lightly damped modes, some of them close together."""
    rng = np.random.default_rng(seed)
    omega, zeta = np.cumsum(rng.uniform(0.05, 3.0, modes)), 10.0 ** rng.uniform(np.log10(least), -1.0, modes)
    A = linalg.block_diag(*(w * np.array([[0.0, 1.0], [-1.0, -2.0 * z]]) for w, z in zip(omega, zeta, strict=True)))
    B, C = np.zeros((2 * modes, 1)), np.zeros((1, 2 * modes))
    B[1::2, 0], C[0, ::2] = rng.normal(size=modes), rng.normal(size=modes)
    return control.ss(A, B, C, 0.0, inputs="u", outputs="y")


@examples(60)
@given(seeds)
def test_bode_matches_python_control_and_peak(seed):
    system = swinging(seed)
    found = bc.bode(system)
    assert found["y", "u"] == pytest.approx(system(1j * found.omega), rel=1e-6)
    assert found.magnitude.max() == pytest.approx(bc.sigma(system).peak, rel=1e-3)
    own = np.array([0.3, 1.0, 7.0])
    theirs = control.frequency_response(system, own)
    assert bc.bode(system, own)["y", "u"] == pytest.approx(theirs.frdata[0, 0], rel=1e-9)
    assert bc.bode(system, own).response.frdata == pytest.approx(theirs.frdata, rel=1e-9)


@examples(30)
@given(seeds)
def test_every_peak_of_every_response_is_on_the_grid(seed):
    """Searched for anew around each of its local maxima."""
    system = swinging(seed, least=1e-4)
    found = bc.bode(system)
    size = found.magnitude[0, 0]
    for k in np.flatnonzero((size[1:-1] > size[:-2]) & (size[1:-1] > size[2:])) + 1:
        fine = np.linspace(found.omega[k - 1], found.omega[k + 1], 201)
        assert np.abs(system(1j * fine)).max() <= size[k] * (1.0 + 1e-5)


def test_a_peak_beyond_the_band_of_the_lowest_modes_is_shown():
    """Twelve modes, the fastest one the highest."""
    omega = np.arange(1.0, 13.0)
    gain = np.where(omega == 12.0, 1000.0, 1.0)
    modes = bc.structure.SecondOrderModel(
        np.eye(12), np.diag(0.01 * omega), np.diag(omega**2), {"f": gain}, {"y": np.ones(12)}
    )
    for system in (modes, modes.to_statespace()):
        found = bc.bode(system)
        assert found.magnitude.max() == pytest.approx(bc.sigma(system).peak, rel=1e-6)
        assert found.omega[-1] > 12.5


def test_what_else_is_looked_at():
    tf = control.tf([1.0], [1.0, 0.2, 1.0])
    assert bc.bode(tf, [1.0]).frdata[0, 0, 0] == pytest.approx(-5.0j)
    assert bc.bode(one.h_infinity()).frdata.shape[:2] == bc.bode(one.h_infinity().closed_loop).frdata.shape[:2]
    reduced = bc.reduce(one.yaw().select("actuator_anti", "tip_anti"), order=4)
    assert bc.pzmap(reduced).poles.shape == (4,)
    data = one.mass().frequency_response([1.0, 2.0])
    assert bc.bode(data).omega.tolist() == [1.0, 2.0]
    assert looked_at(data) is data
    assert bc.bode(data) != bc.bode(data)  # results with arrays are equal to themselves alone
    sampled = control.sample_system(control.ss(tf), 0.1)
    assert bc.bode(sampled).omega.max() <= np.pi / 0.1 * (1.0 + 1e-12)


@examples(40)
@given(seeds, st.sampled_from([0, 0.1]), st.sampled_from(["step", "impulse"]))
def test_transients_are_python_controls(seed, dt, kind):
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(1, 5)), int(rng.integers(1, 3))
    A, B, C, D = (rng.standard_normal(size) for size in ((n, n), (n, m), (m, n), (m, m)))
    system = control.ss(A - 1.1 * max(np.linalg.eigvals(A).real.max(), 0.0) * np.eye(n), B, C, D * rng.integers(0, 2))
    system = control.sample_system(system, dt) if dt else system
    time = (dt or rng.uniform(0.01, 0.1)) * np.arange(40)
    found = getattr(bc, kind)(system, time)
    theirs = getattr(control, f"{kind}_response")(system, time)
    want = np.asarray(theirs.y)
    assert found.outputs == pytest.approx(want, abs=1e-9 * max(1.0, np.abs(want).max()))
    ours = found.response
    assert np.asarray(ours.y) == pytest.approx(want, abs=1e-9 * max(1.0, np.abs(want).max()))


def test_default_instants_show_rise_and_rest():
    lag = control.ss([[-2.0]], [[2.0]], [[1.0]], 0.0, inputs="u", outputs="y")
    found = bc.step(lag)
    assert found["y"][-1] == pytest.approx(1.0, abs=0.01)
    assert found["y"] == pytest.approx(1.0 - np.exp(-2.0 * found.time), abs=1e-12)
    assert bc.impulse(lag, 3.0).time[-1] == 3.0
    double = bc.step(control.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0))
    assert double.outputs[0, 0] == pytest.approx(0.5 * double.time**2)
    unstable = bc.impulse(control.ss([[3.0]], [[1.0]], [[1.0]], 0.0))
    assert 1e2 < unstable.outputs.max() < 1e4
    K = np.array([[30.0, -30.0, 0.0], [-30.0, 80.0, -50.0], [0.0, -50.0, 50.0]])  # free: two poles of 1e-9 instead of 0
    M = np.diag([1.0, 2.0, 3.0])
    A = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.linalg.solve(M, K), -0.002 * np.linalg.solve(M, K)]])
    assert bc.step(control.ss(A, np.eye(6, 1, -3), np.eye(1, 6), 0.0)).time[-1] < 100.0
    boom = bc.step(bc.spray_boom(), inputs="suspension_left")
    assert boom["tip_left", "suspension_left"].shape == boom.time.shape
    static = bc.step(control.ss([], [], [], [[2.0]]))
    assert (static.outputs == 2.0).all()


@examples(40)
@given(seeds)
def test_pzmap_zeros_block_response(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 6))
    A, B, C = (rng.standard_normal(size) for size in ((n, n), (n, 1), (1, n)))
    A[-1] *= rng.integers(0, 2)  # with an integrator or without
    system = control.ss(A, B, C, 0.0)
    found = bc.pzmap(system)
    order = np.lexsort((found.poles.imag, found.poles.real))
    want = np.linalg.eigvals(A)
    want = want[np.lexsort((want.imag, want.real))]
    assert found.poles[order] == pytest.approx(want, abs=1e-6 * np.abs(want).max())
    for zero in found.zeros:
        if np.abs(zero - found.poles).min() > 1e-3:
            pencil = np.block([[A - zero * np.eye(n), B], [C, np.zeros((1, 1))]])
            assert np.linalg.svd(pencil)[1].min() < 1e-8 * np.linalg.norm(pencil)
    assert found.response.poles is found.poles


@pytest.mark.parametrize(("n", "m"), [(1, 1), (1, 3), (4, 2), (2, 5)])
@examples(20)
@given(seeds)
def test_zeros_are_poles_of_inverse(n, m, seed):
    """Also of more signals than states."""
    rng = np.random.default_rng(seed)
    A, B, C = (rng.standard_normal(size) for size in ((n, n), (n, m), (m, n)))
    D = np.linalg.qr(rng.standard_normal((m, m)))[0]
    want = np.linalg.eigvals(A - B @ D.T @ C)
    found = bc.pzmap(control.ss(A, B, C, D)).zeros
    assert len(found) == n
    assert np.abs(found[:, None] - want).min(axis=0).max() < 1e-6 * max(1.0, np.abs(want).max())


def dyadic_gain(seed):
    """Return the gain of a loop with or without poles on the boundary of stability, most of them repeated; all dyadic."""
    rng = np.random.default_rng(seed)
    dt, m, kind, form = (0.0, 0.5)[seed % 2], (1, 1, 2)[seed // 2 % 3], seed // 6 % 9, seed // 54 % 4

    def dyadic(x):
        return np.round(64.0 * np.asarray(x)) / 64.0

    def chain(pole, k):
        A = np.kron(np.eye(k), pole)
        A[len(pole) :, : -len(pole)] += np.kron(np.eye(k - 1), np.eye(len(pole))[:, ::-1] * np.eye(len(pole))[-1:].T)
        return A

    c = float(dyadic(rng.uniform(-0.9, 0.9))) if dt else float(dyadic(np.exp(rng.uniform(-1.0, 2.0))))
    pair = np.array([[0.0, 1.0], [-1.0, 2.0 * c] if dt else [-c, 0.0]])
    integrators, pairs = ((3, 0), (0, 0), (4, 0), (0, 2), (1, 0), (0, 3), (3, 2), (0, 1), (2, 2))[kind]
    low, high = (-1.2, 0.9) if dt else (-6.0, 0.5)
    rest = dyadic(rng.uniform(low, high, rng.integers(integrators + pairs == 0, 3))) + 1.0 / 128.0  # no pole at -1
    parts = [chain(np.array([[float(dt > 0.0)]]), integrators)] if integrators else []
    A = linalg.block_diag(*parts, *([chain(pair, pairs)] if pairs else []), np.diag(rest))
    n = len(A)
    B, C, D = (dyadic(rng.standard_normal(size)) for size in ((n, m), (m, n), (m, m)))
    D *= rng.integers(2)
    if form == 0:  # a loop that is stable
        solve = linalg.solve_discrete_are if dt else linalg.solve_continuous_are
        X = solve(A, B, np.eye(n), np.eye(m))
        C, D = np.linalg.solve(np.eye(m) + B.T @ X @ B, B.T @ X @ A) if dt else B.T @ X, 0.0 * D
    if form == 1:  # other coordinates, exactly
        T, inverse = unimodular(rng, n)
        A, B, C = inverse @ A @ T, inverse @ B, C @ T
    if form == 2:
        C *= 2.0 ** rng.integers(-8, 9)
    return dt, A, B, C, D


def unstable_poles(A, dt):
    """Return how many eigenvalues of a rational matrix are unstable, and how many on the boundary, in exact arithmetic."""
    p, n = A.charpoly(), A.nrows()
    if dt:  # its image under the bilinear map
        c = p(fmpq_poly([-1, 2])).coeffs()
        p = fmpq_poly([fmpq(0)] * (n + 1 - len(c)) + c[::-1])(fmpq_poly([1, -1]))
    p = p.numer()
    boundary = [on_axis(root, p) for root in roots(p)]
    return sum(bool(root.real > 0) for root, on in zip(roots(p), boundary, strict=True) if not on), sum(boundary)


def test_encirclements_count_poles_of_closed_loop():
    for seed in range(0, 432, 43 if is_quick() else 1):
        dt, A, B, C, D = dyadic_gain(seed)
        a, b, c, d = (
            fmpq_mat(M.shape[0], M.shape[1], [fmpq(*x.as_integer_ratio()) for x in M.ravel().tolist()])
            for M in (A, B, C, D + np.eye(len(D)))
        )
        if abs(np.linalg.det(D + np.eye(len(D)))) < 1e-6:
            continue
        (opened, _), (closed, boundary) = unstable_poles(a, dt), unstable_poles(a - b * d.inv() * c, dt)
        if boundary:
            continue
        system = control.ss(A, B, C, D, dt)
        found = bc.nyquist(system)
        assert (found.open_loop_unstable_poles, found.closed_loop_unstable_poles, found.encirclements) == (
            opened,
            closed,
            opened - closed,
        ), seed
        assert found.stable == (closed == 0)
        if len(D) == 1 and found.stable:
            L = np.array([complex(system(s)) for s in (np.exp(1j * found.omega * dt) if dt else 1j * found.omega)])
            near = np.abs(L) < 1e3  # beside repeated poles rounding of the matrices is larger
            assert found.curve[near] == pytest.approx(L[near], rel=1e-5, abs=1e-6)
            # outside of the disk: the margin is 2/|S - T|, and S - T = (1 - L)/(1 + L)
            assert np.abs((1.0 - L[near]) / (1.0 + L[near])).max() <= (1.0 + 1e-5) * 2.0 / found.disk_margin.alpha


def test_nyquist_of_a_plant_and_a_controller_is_that_of_the_loop():
    K = one.suspension()
    found = bc.nyquist(one.yaw(), K)
    margin = bc.margins(one.yaw(), K)["suspension_anti"]
    assert found.stable
    assert found.disk_margin.alpha == pytest.approx(margin.disk_margin.alpha, rel=1e-9)
    at = np.argmin(np.abs(found.omega - margin.phase_margin_omega))
    omega, L = margin.loop_gain
    k = np.argmin(np.abs(omega - found.omega[at]))
    assert found.curve[at] == pytest.approx(-L[k], rel=0.1, abs=0.1)
    strong = bc.discretize(
        control.ss(K.A, K.B, 1e3 * K.C, 1e3 * K.D, inputs=K.input_labels, outputs=K.output_labels), 0.02
    )
    late = bc.nyquist(one.yaw(), strong, delay=0.03)
    poles = bc.feedback_loop(one.yaw(), strong, delay=0.03).poles()
    assert late.closed_loop_unstable_poles == int((np.abs(poles) > 1.0).sum()) > 0


@given(seeds, st.sampled_from([0.0, 0.1]), st.booleans())
@examples(200)
def test_what_is_shown_of_an_unstable_system_says_so(seed, dt, unstable):
    """In random coordinates, of poles that were chosen; whether they show in the outputs or not."""
    rng = np.random.default_rng(seed)
    rates = -rng.uniform(0.05, 1.0, 4)
    rates[0] *= -1.0 if unstable else 1.0
    pairs = ([[a, w], [-w, a]] for a, w in zip(rates[:2], rng.uniform(0.5, 4.0, 2), strict=True))
    blocks = linalg.block_diag(*pairs, np.diag(rates[2:]))
    A = linalg.expm(dt * blocks) if dt else blocks
    T = np.linalg.qr(rng.standard_normal((6, 6)))[0]
    system = control.ss(T @ A @ T.T, T @ rng.standard_normal((6, 1)), rng.standard_normal((1, 6)) @ T.T, 0.0, dt)
    shown = [
        bc.sigma(system), bc.bode(system), bc.bode(system, [0.3, 1.0]), bc.step(system, 2.0), bc.impulse(system, 2.0),
        str(bc.compare({"one": system})),
    ]  # fmt: skip
    for each in shown:
        assert ("unstable" in str(each)) == unstable
    upper = bc.bode(system).plot()[0]
    assert any("unstable" in text.get_text() for text in upper.texts) == unstable
    plt.close("all")


def test_a_comparison_says_between_which_signals_its_figures_are():
    """Of a boom model all of them are from actuators to tips, of its state space between all signals."""
    model = bc.spray_boom()
    both = bc.compare({"model": model, "all": model.to_statespace()})
    assert "all: actuator_left, ... (5) -> tip_left, tip_right, ... (5)" in str(both).splitlines()
    assert "<p>model: actuator_left, actuator_right -&gt; tip_left, tip_right</p>" in both._repr_html_()


def test_a_comparison_has_the_figures_that_each_result_gives():
    K = one.suspension()
    runs = {}
    for name, factor in (("as designed", 1.0), ("half", 0.5)):
        gain = control.ss(K.A, K.B, factor * K.C, factor * K.D, inputs=K.input_labels, outputs=K.output_labels)
        runs[name] = [bc.feedback_loop(one.yaw(), gain), bc.margins(one.yaw(), gain)]
    runs["run"] = one.loop()
    both = bc.compare(runs)
    loop = runs["half"][0]
    assert both["half"]["H-infinity norm"] == bc.hinf_norm(loop).lower_bound
    assert both["half"]["H2 norm"] == bc.h2_norm(loop).value
    assert both["half"]["slowest pole [rad/s]"] == pytest.approx(loop.poles().real.max(), rel=1e-6)
    assert both["half"]["disk margin, everywhere"] == runs["half"][1].multiloop_io.alpha
    run, (name, values) = runs["run"], next(iter(one.loop().outputs.items()))
    assert both["run"][f"{name}: rms"] == pytest.approx(np.sqrt(np.mean(run.outputs[name] ** 2)), rel=1e-12)
    assert both["run"][f"{name}: peak"] == np.abs(values).max()
    assert "–" in str(both)  # the run has no margins
    assert both.to_dict()["run"] == both["run"]
    assert bc.compare({"half": runs["half"][1]}).plot(kind="margins")[0].lines


@pytest.mark.parametrize("make", [one.loop, one.motion, pytest.param(one.slew, marks=pytest.mark.slow)])
def test_result_over_time_has_named_signals_and_response(make):
    result = make()
    response = result.response
    assert np.array_equal(response.time, result.time)
    for k, name in enumerate(response.output_labels):
        assert np.array_equal(result[name], np.atleast_2d(response.y)[k])
    with pytest.raises(ValueError, match=r"unknown (signal|output) 'nothing'"):
        result["nothing"]


def test_comparison_uses_common_frequencies():
    both = bc.compare({"slow": control.tf(1.0, [1.0, 0.02, 1.0]), "fast": control.tf(1.0, [1.0, 2.0, 1e4])})
    slow, fast = (x for line in both.plot()[0].lines if len(x := line.get_xdata()) > 1)  # but for marks of peaks
    assert slow.min() == fast.min()
    assert slow.max() == fast.max()


@pytest.mark.parametrize("unstable", [0, 1])
@given(st.integers(0, 1000))
@examples(30)
def test_unstable_poles_are_those_that_eigenvalues_show(unstable, seed):
    """With stable controllers, and with one that is unstable."""
    rng = np.random.default_rng(seed)
    plant, K = chain(seed), velocity_feedback(rng.uniform(-1.0, 1.0), rng.uniform(2.0, 30.0))
    if unstable:
        plant, (B, C) = chain(seed, damping=0.2), rng.standard_normal((2, 2, 2))
        K = control.ss(np.diag([0.5, -3.0]), B, C, 0.0, **SIGNALS)
    poles = feedback_loop(plant, K).poles()
    if np.abs(poles.real).min() < 1e-6:
        return
    found = nyquist_stability(plant.frequency_response, K, plant.to_statespace().poles()[: 2 + 6 * (seed % 2)])
    assert (found.unstable_controller_poles, found.unstable_poles) == (unstable, int((poles.real > 0.0).sum()))
    assert found.stable == bool(poles.real.max() < 0.0)
    assert found.min_return_difference > 0.0


@pytest.mark.parametrize("gain", [-20000.0, -200.0, -1.0, 200.0, 30000.0])
def test_the_exact_boom_agrees_with_a_fine_mesh(gain):
    strokes, forces = ["stroke_left", "stroke_right"], ["suspension_left", "suspension_right"]
    eye = np.eye(2)
    K = control.ss(-30.0 * eye, eye, 30.0 * gain * eye, 0.0 * eye, inputs=strokes, outputs=forces)
    mesh = spray_boom(discretization="high-order", elements=4)
    poles = mesh.to_statespace().poles()
    poles = poles[np.abs(poles) < 600.0]
    p = BoomParameters()
    found = nyquist_stability(lambda w: exact_frequency_response(p, w, forces, strokes), K, poles)
    assert found.unstable_poles == int((feedback_loop(mesh, K).poles().real > 0.0).sum())
