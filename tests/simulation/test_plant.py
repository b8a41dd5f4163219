"""Motion of linear plants and of sampled loops around them: against matrix exponentials at 400 bits and more."""

import control as ct
import numpy as np
import pytest
from flint import arb, arb_mat, ctx
from hypothesis import given

import boomctl as bc
from boomctl import structure as s
from boomctl.simulation.plant import modal_plant
from tests.profiles import examples
from tests.references import state_space_response
from tests.strategies import seeds

pytestmark = pytest.mark.filterwarnings("ignore:.*scipy:DeprecationWarning")

BITS = (400, 1600, 6400)  # tried in turn until the result has 20 digits
ROUNDING = 100.0  # times the change of a response by one unit in the last place of the matrices


def balls(matrix):
    return arb_mat([[arb(float(x)) for x in row] for row in np.atleast_2d(matrix)])


def exact_response(plant, signals, h, law=None, lag=0):
    """Return the outputs at each step under signals that are linear between steps.

    ``law`` is a discrete controller from the first outputs to the first input, ``lag`` steps late.
    """
    for bits in BITS:
        ctx.prec = bits
        values = _response(plant, signals, h, law, lag)
        if all(y.rad() < arb(1e-20) * abs(y.mid()) + arb(1e-60) for row in values for y in row):
            return np.array([[float(y.mid()) for y in row] for row in values]).T
    raise AssertionError("no digits left")


def _response(plant, signals, h, law, lag):
    n, m, U = plant.nstates, plant.ninputs, balls(signals.T)
    big = arb_mat(n + 2 * m, n + 2 * m)
    for i, row in enumerate(np.hstack([plant.A, plant.B]).tolist()):
        for j, x in enumerate(row):
            big[i, j] = arb(x) * arb(h)
    for j in range(m):
        big[n + j, n + m + j] = 1
    moved = big.exp()
    part = [[moved[i, j] for j in range(n + 2 * m)] for i in range(n)]
    Phi, G, H = (arb_mat([row[a:b] for row in part]) for a, b in ((0, n), (n, n + m), (n + m, n + 2 * m)))
    C, D, x, rows, controls = balls(plant.C), balls(plant.D), arb_mat(n, 1), [], []
    order, reads = (0, 0) if law is None else (law.nstates, law.ninputs)
    law_map, state = None if law is None else balls(np.block([[law.A, law.B], [law.C, law.D]])), [arb(0)] * order
    for k in range(signals.shape[1]):
        u = arb_mat([[U[k, j]] for j in range(m)])
        y = C * x + D * u
        rows.append([y[i, 0] for i in range(len(plant.C))])
        if k + 1 == signals.shape[1]:
            return rows
        following = arb_mat([[U[k + 1, j]] for j in range(m)])
        if law_map is not None:
            moving = law_map * arb_mat([[value] for value in (*state, *rows[-1][:reads])])
            state = [moving[i, 0] for i in range(order)]
            controls.append(moving[order, 0])
            u[0, 0] = following[0, 0] = controls[k - lag] if k >= lag else arb(0)
        x = Phi * x + G * u + H * (following - u)
    return rows


def rotated(rng, A):
    Q = np.linalg.qr(rng.standard_normal(A.shape))[0]
    return Q @ A @ Q.T


def rescaled(rng, A):
    scale = 10.0 ** rng.uniform(-6, 6, len(A))
    return A * scale[:, None] / scale


def integrators(rng):
    """Return ``A`` of several integrators and lags from a transfer function: entries of 1e-17 and less are left."""
    den = np.r_[1.0, np.zeros(rng.integers(3, 6))]
    for rate in 10.0 ** rng.uniform(-1, 2, rng.integers(0, 3)):
        den = np.polymul(den, [1.0, rate])
    return ct.ss(ct.tf(rng.standard_normal(2), den)).A


def chain(rng):
    """Return ``A`` of integrators in series with entries far below rounding of the others."""
    n = rng.integers(3, 6)
    return np.eye(n, k=1) + 10.0 ** rng.uniform(-26, -12, (n, n)) * rng.choice([-1, 0, 1], (n, n))


def jordan(rng):
    """Return ``A`` of equal or nearly equal real poles or undamped pairs, coupled in series or not."""
    k, w = rng.integers(2, 5), 10.0 ** rng.uniform(-1, 1)
    pole = np.array([[-w]]) if rng.integers(2) else w * np.array([[-rng.choice([0.0, 1e-3]), 1.0], [-1.0, 0.0]])
    A = np.kron(np.eye(k), pole) + rng.choice([0.0, w]) * np.kron(np.eye(k, k=1), np.eye(len(pole)))
    return A * (1.0 + rng.choice([0.0, 1e-15, 1e-8, 1e-4]) * rng.standard_normal(A.shape))


def companion(rng):
    """Return ``A`` of equal poles from a transfer function."""
    w, den = 10.0 ** rng.uniform(-1, 1), [1.0]
    for _ in range(rng.integers(2, 5)):
        den = np.polymul(den, [1.0, w] if rng.integers(2) else [1.0, 0.0, w * w])
    return ct.ss(ct.tf([1.0], den)).A


def stiff(rng):
    """Return ``A`` of vibrations and lags from 0.1 to 1000 rad/s."""
    A, rates = np.zeros((7, 7)), 10.0 ** rng.uniform(-1, 3, 4)
    A[6, 6] = -rates[3]
    for k, (w, zeta) in enumerate(zip(rates[:3], 10.0 ** rng.uniform(-4, 0, 3), strict=True)):
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[0.0, 1.0], [-w * w, -2.0 * zeta * w]]
    return A


KINDS = {
    "integrators": integrators,
    "chain": chain,
    "jordan": jordan,
    "companion": companion,
    "stiff": stiff,
    "integrators, units": lambda rng: rescaled(rng, integrators(rng)),
    "jordan, units": lambda rng: rescaled(rng, jordan(rng)),
    "jordan, dense": lambda rng: rotated(rng, jordan(rng)),
    "stiff, units": lambda rng: rescaled(rng, stiff(rng)),
    "stiff, dense, units": lambda rng: rescaled(rng, rotated(rng, stiff(rng))),
}


def error(values, exact):
    return float((np.abs(values - exact).max(axis=1) / np.abs(exact).max(axis=1)).max())


@pytest.mark.parametrize("kind", KINDS)
@given(seed=seeds)
@examples(60)
def test_motion_matches_arb(kind, seed):
    rng = np.random.default_rng(seed)
    A = KINDS[kind](rng)
    # inputs and outputs in the units of the states
    units = np.sqrt(np.divide(*(np.maximum(np.linalg.norm(A, axis=k), 1e-12) for k in (1, 0))))
    B, C = units[:, None] * rng.standard_normal((len(A), 2)), rng.standard_normal((2, len(A))) / units
    plant = ct.ss(A, B, C, 0.0, inputs=["u", "w"], outputs=["y", "z"])
    h, steps = 10.0 ** rng.uniform(-2, 0.5), 40
    t, U = h * np.arange(steps), rng.choice([0.0, 1.0]) + rng.standard_normal((2, steps))
    near = ct.ss(*(X * (1.0 + 2.0**-52 * rng.choice([-1, 1], X.shape)) for X in (A, B, C)), 0.0)
    exact = exact_response(plant, U, h)
    allowed = 1e-12 + ROUNDING * error(exact_response(near, U, h), exact)
    signals = dict(zip(plant.input_labels, U, strict=True))
    forced, run = bc.forced_response(plant, t, signals), bc.simulate_loop(plant, None, t, signals, sample_time=h)
    assert error(np.array([forced["y"], forced["z"]]), exact) <= forced.error_estimate
    assert error(np.array([run["y"], run["z"]]), exact) <= allowed
    first = exact_response(plant, np.vstack([np.ones(steps), np.zeros(steps)]), h)
    stepped = bc.step(plant, t, inputs="u").outputs[:, 0]
    assert error(stepped, first) <= allowed
    gain, lag = 0.1 / np.abs(first[0]).max(), int(rng.integers(3))
    law = ct.ss([[0.5]], [[1.0]], [[gain]], [[-gain]], h, inputs=["y"], outputs=["u"])
    exact = exact_response(plant, np.vstack([np.zeros(steps), U[1]]), h, law, lag)
    run = bc.simulate_loop(plant, law, t, {"w": U[1]}, sample_time=h, delay=lag * h)
    assert error(np.array([run["y"], run["z"]]), exact) <= allowed


def free_shaft():
    """Return a free steel shaft with a load at an end."""
    section = s.circular_section(0.02)
    steel = s.BeamSegment(0.3, 7850.0 * section.area, 2.1e11 * section.second_moment)
    shaft = s.Beam("shaft", s.GROUND.at(0.0), s.planar("y", "theta"), (0.0, 0.0), (steel,), s.FiniteElements(10))
    loaded, other = shaft.at(0.3), shaft.at(0.0)
    outputs = (s.Output("at", loaded), s.Output("rate", loaded, derivative=1), s.Output("other", other))
    return s.Assembly((shaft,), forces=(s.Force("u", loaded), s.Force("w", other)), outputs=outputs).assemble()


@pytest.mark.parametrize("gains", [None, [[-20.0, -2.0]]])
def test_loop_around_free_shaft_matches_arb(gains):
    model, h, steps = free_shaft(), 0.01, 400
    law = None if gains is None else ct.ss([], [], [], gains, h, inputs=["at", "rate"], outputs=["u"])
    U = np.vstack([np.zeros(steps), np.ones(steps)])
    exact = exact_response(model.to_statespace(), U, h, law)
    run = bc.simulate_loop(model, law, h * np.arange(steps), {"w": U[1]}, sample_time=h)
    assert error(np.array([run[name] for name in model.output_labels]), exact) <= 1e-10


@pytest.mark.parametrize("excitation", ["displacement", "force"])
def test_modal_plant_large_structure_keeps_response(excitation):
    model = bc.spray_boom(elements=60, excitation=excitation)
    modal = modal_plant(model)
    assert len(modal.A) < 2 * model.ncoordinates
    omega = 2.0 * np.pi * np.array([1e-3, 0.01, 0.2, 1.0, 5.0, 20.0])
    found = state_space_response(modal, omega)
    true = np.asarray(model.frequency_response(omega).frdata)
    np.testing.assert_allclose(found, true, rtol=1e-6, atol=1e-12 * np.abs(true).max())
