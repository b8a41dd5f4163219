"""Discrete regulators, filters and LQG: against the sum they minimize, python-control, duality, and many digits."""

import control
import flint
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import linalg

import boomctl as bc
from tests.profiles import examples


def random_plant(seed, largest=1.2):
    rng = np.random.default_rng(seed)
    n, m, p = int(rng.integers(1, 7)), int(rng.integers(1, 3)), int(rng.integers(1, 3))
    A = rng.standard_normal((n, n))
    A *= rng.uniform(0.3, largest) / np.abs(np.linalg.eigvals(A)).max()
    return control.ss(A, rng.standard_normal((n, m)), rng.standard_normal((p, n)), rng.standard_normal((p, m)), 0.1)


@examples(100)
@given(st.integers(0, 10_000))
def test_dlqr_matches_python_control(seed):
    plant = random_plant(seed)
    rng, n, m = np.random.default_rng(seed + 1), plant.nstates, plant.ninputs
    half = rng.standard_normal((n + m, n + m + 1))
    joint = half @ half.T
    Q, R, N = joint[:n, :n], joint[n:, n:], joint[:n, n:]
    found = bc.lqr(plant, Q, R, N=N)
    F, X, _ = control.dlqr(plant.A, plant.B, Q, R, N)
    assert found.gain == pytest.approx(F, rel=1e-7, abs=1e-8)
    assert found.riccati_solution == pytest.approx(X, rel=1e-7, abs=1e-8 * np.abs(X).max())
    x0 = rng.standard_normal(n)
    x, total = x0, 0.0
    for _ in range(3000):
        u = -found.gain @ x
        total += x @ Q @ x + u @ R @ u + 2.0 * x @ N @ u
        x = plant.A @ x + plant.B @ u
    assert total == pytest.approx(x0 @ found.riccati_solution @ x0, rel=1e-6)
    assert np.abs(found.poles).max() < 1.0
    assert found.certificate.regulator_riccati.residual < 1e-12
    assert found.closed_loop.dt == found.controller.dt == 0.1
    found = bc.lqr(plant, 1.0, 1.0)
    assert found.certificate.min_return_difference >= 1.0 - 1e-6
    wide = linalg.cholesky(np.eye(m) + plant.B.T @ found.riccati_solution @ plant.B)
    for angle in np.linspace(0.0, np.pi, 50):
        L = found.gain @ np.linalg.solve(np.exp(1j * angle) * np.eye(n) - plant.A, plant.B + 0j)
        assert np.linalg.svd(wide @ (np.eye(m) + L), compute_uv=False)[-1] >= 1.0 - 1e-6


def servo(seed):
    """Return a servo of two stages, sampled: a rigid body with modes, a second stage that no noise moves, colored noises.

    Its numbers are those of the trade: forces of 1e-11 beside gains of 1e9.
    """
    rng = np.random.default_rng(seed)
    gain, dt, noise = 10.0 ** rng.uniform(5, 9), 10.0 ** rng.uniform(-5, -4.2), 10.0 ** rng.uniform(-4, 1)

    def modes(count, slowest, fastest, damping):
        w, z = 2.0 * np.pi * 10.0 ** rng.uniform(slowest, fastest, count), 10.0 ** rng.uniform(*damping, count)
        return [np.array([[0.0, 1.0], [-(a**2), -2.0 * b * a]]) for a, b in zip(w, z, strict=True)]

    body = [np.array([[0.0, 1.0], [0.0, 0.0]]), *modes(rng.integers(1, 4), 2.5, 4.3, (-3, -1.3))]
    second, colors = modes(rng.integers(1, 3), 3.5, 4.5, (-3, -1.3)), modes(rng.integers(1, 3), 1.5, 3.7, (-3, -0.5))
    blocks = [*body, *second, *colors]
    n, m, ends = 2 * len(blocks), 2 + len(colors) + 1, (2 * len(body), 2 * len(body) + 2 * len(second))
    A, B, C = np.zeros((n + 2, n + 2)), np.zeros((n + 2, m)), np.zeros((1, n + 2))
    A[:n, :n], C[0, :n:2] = linalg.block_diag(*blocks), 1.0
    force = gain * np.concatenate([[1.0], rng.standard_normal(len(body) - 1)])
    A[1 : ends[0] : 2, n] = B[1 : ends[0] : 2, 0] = force
    B[ends[0] + 1 : ends[1] : 2, 1] = 10.0 ** rng.uniform(4, 10)
    for k, block in enumerate(colors):
        B[ends[1] + 2 * k + 1, 2 + k] = 10.0 ** rng.uniform(-2, 1) * -block[1, 0]
    a, b = 10.0 ** rng.uniform(1, 4, 2)
    A[n, n], A[n, n + 1], A[n + 1, n + 1] = -a, 1.0, -b
    B[n + 1, -1] = (2.0 * np.pi * 10.0 ** rng.uniform(0.5, 3)) ** 2 * np.sqrt(noise) * a * b / gain
    sampled = linalg.expm(dt * np.block([[A, B], [np.zeros((m, n + 2 + m))]]))
    names = ["coil", "piezo", *(f"d{k}" for k in range(m - 2))]
    A, B = np.split(sampled[: n + 2], [n + 2], axis=1)
    return control.ss(A, B, C, np.zeros((1, m)), dt, inputs=names, outputs="y"), names[2:], noise


def doubled(A, C, W, V):
    """Return the covariance by structure-preserving doubling in 600 binary digits: it shares no step with the solver."""
    before, flint.ctx.prec = flint.ctx.prec, 600
    try:
        A, C, H, V = (flint.arb_mat(matrix.tolist()) for matrix in (A.T, C.T, W, V))
        middle = lambda M: flint.arb_mat([[entry.mid() for entry in row] for row in M.table()])  # noqa: E731
        one = flint.arb_mat(np.eye(A.nrows()).tolist())
        G = C * V.inv() * C.transpose()
        for _ in range(60):
            inverse = middle((one + G * H).inv())
            G, H = middle(G + A * inverse * G * A.transpose()), middle(H + A.transpose() * H * inverse * A)
            A = middle(A * inverse * A)
            if max(abs(float(entry)) for entry in A.entries()) < 1e-100:
                break
        return np.array([[float(entry) for entry in row] for row in H.table()])
    finally:
        flint.ctx.prec = before


@pytest.mark.slow
@examples(200)
@given(st.integers(0, 100_000))
def test_servo_filter_exact_for_small_noise(seed):
    plant, disturbances, noise = servo(seed)
    found = bc.kalman(plant, dict.fromkeys(disturbances, 1.0), {"y": noise}, disturbances=disturbances)
    B = plant.B[:, 2:]
    exact = doubled(plant.A, plant.C, B @ B.T, np.array([[noise]]))
    size = np.sqrt(np.diag(exact))
    reached = size > 0.0
    assert not found.covariance[~reached].any()
    error = (found.covariance - exact)[np.ix_(reached, reached)] / np.outer(size[reached], size[reached])
    assert np.abs(error).max() < 1e-7
    assert found.certificate.cost_error < 1e-7
    assert np.abs(found.poles).max() < 1.0


def test_the_certificate_says_which_solver_answered():
    plant = control.ss(1.5, 1.0, 1.0, 0.0, 0.1)
    assert bc.lqr(plant, 1.0, 1.0).certificate.regulator_riccati.stages == ("structure-preserving doubling",)
    mirrored = bc.lqr(plant, 0.0, 1.0)
    assert mirrored.certificate.regulator_riccati.stages == ("structure-preserving doubling", "SciPy, extended pencil")
    assert mirrored.poles == pytest.approx(1.0 / 1.5)


def test_integral_action_leaves_no_error():
    A, B = [[0.9, 0.1], [-0.1, 0.9]], [[0.0, 0.1], [0.1, 0.0]]
    plant = control.ss(A, B, [[1.0, 0.0]], 0.0, 0.1, inputs=["force", "wind"], outputs="place")
    found = bc.lqr(plant, 1.0, 1.0, controls="force", integral_action=["place"])
    loop = found.closed_loop
    assert (loop.input_labels, loop.dt) == (["wind"], 0.1)
    rest = loop.C @ np.linalg.solve(np.eye(loop.nstates) - loop.A, loop.B)
    assert rest == pytest.approx(0.0, abs=1e-9)
    seen = control.ss(plant.A, plant.B, np.vstack([np.eye(2), plant.C]), 0.0, 0.1,
                      inputs=["force", "wind"], outputs=[*plant.state_labels, "place"])  # fmt: skip
    reached = np.abs(bc.feedback_loop(seen, found.controller).poles()).max()
    assert reached == pytest.approx(np.abs(found.poles).max())
