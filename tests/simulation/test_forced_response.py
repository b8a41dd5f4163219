"""The open-loop response: against ball arithmetic, the sampled loop, and its own error estimate."""

import numpy as np
import pytest
from flint import arb_mat, ctx
from hypothesis import given

import boomctl as bc
from boomctl.simulation import forced_response, simulate_loop
from boomctl.simulation.plant import basis
from boomctl.structure import split_symmetric
from tests.profiles import examples
from tests.strategies import seeds

_TIME = np.linspace(0.0, 6.0, 3001)
_PLATFORM = {
    "actuator_left": 0.01 * np.sin(4.0 * _TIME) + 0.002 * np.sin(31.0 * _TIME),
    "actuator_right": 0.01 * np.sin(2.5 * _TIME + 0.4) - 0.01 * np.sin(0.4),
}
_STORED = 1e-10  # of a response, by rounding of stored rows: rigid motions, far larger, strain them a little


def _error(found, exact):
    """Return the largest error of outputs that move, each relative to its largest value."""
    sizes = {name: np.abs(values).max() for name, values in exact.items()}
    moving = [name for name, size in sizes.items() if size > 1e-13 * max(sizes.values())]
    return max(np.abs(found[name] - exact[name]).max() / sizes[name] for name in moving)


def test_error_half_boom_ramp_below_estimate():
    half, _ = split_symmetric(bc.spray_boom(elements=42, excitation="force"))
    time = np.linspace(0.0, 100.0, 101)
    signals = {half.input_labels[0]: np.minimum(time, 1.0)}
    found = forced_response(half, time, signals)
    error = _error(found, exact_response(half, signals, 1.0))
    assert found.modes < half.ncoordinates
    assert error <= max(found.error_estimate, _STORED)
    assert found.error_estimate <= 1e-6


def test_response_driven_body_above_soft_modes_complete():
    n, eye, time = 20, np.eye(20), np.linspace(0.0, 5.0, 501)
    signals, line, nothing = {"f": np.sin(40.0 * time)}, 2.0 * eye - np.eye(20, k=1) - np.eye(20, k=-1), np.zeros(20)
    stiff = bc.structure.SecondOrderModel(eye, 10.0 * line, 1e4 * line, {"f": eye[0]}, {"y": eye[5]})
    K = np.block([[line, np.zeros((n, n))], [np.zeros((n, n)), 1e4 * line]])
    driven, read = ({name: np.r_[nothing, eye[k]]} for name, k in (("f", 0), ("y", 5)))
    both = bc.structure.SecondOrderModel(np.eye(2 * n), 1e-3 * K, K, driven, read)
    expected = forced_response(stiff, time, signals)["y"]
    np.testing.assert_allclose(forced_response(both, time, signals)["y"], expected, atol=1e-6 * np.abs(expected).max())


def test_projection_dependent_statics_is_orthonormal():
    """Of 27 coordinates 13 modes and static responses of three orders span all but a few."""
    model = _random_chain(np.random.default_rng(500158)).select("a", None)
    _, V = basis(model, 13, 3)
    np.testing.assert_allclose(V.T @ model.M @ V, np.eye(V.shape[1]), atol=1e-12)


@pytest.mark.slow
@given(seed=seeds)
@examples(100)
def test_error_random_structures_below_accuracy_or_estimate(seed):
    rng = np.random.default_rng(seed)
    model = _random_boom(rng) if seed % 2 else _random_chain(rng)
    time = np.linspace(0.0, 10.0 ** rng.uniform(0.0, 2.0), int(rng.integers(100, 300)))
    names = rng.permutation(model.input_labels)[: rng.integers(1, 3)]
    signals = {name: _random_signal(rng, time) for name in names.tolist()}
    accuracy = 10.0 ** rng.integers(-10, -2)
    found = forced_response(model, time, signals, rtol=accuracy)
    error = _error(found, exact_response(model, signals, time[-1] / (len(time) - 1)))
    assert error <= max(found.error_estimate, _STORED)
    assert found.error_estimate <= max(accuracy, 1e-8)


def _random_boom(rng):
    excitation = rng.choice(["displacement", "velocity", "acceleration", "force"])
    if rng.random() < 0.5:
        return bc.spray_boom(elements=int(rng.integers(4, 24)), excitation=str(excitation))
    nodes = np.linspace(-6.0, 6.0, int(rng.integers(6, 20)))
    nodes[1:-1] += 0.3 * (nodes[1] - nodes[0]) * rng.uniform(-1.0, 1.0, len(nodes) - 2)
    return bc.spray_boom(elements=nodes, excitation=str(excitation))


def _random_chain(rng):
    """Return masses in line, perhaps floating or in two bodies; sums of stiffnesses and dampers are exact."""
    n = int(rng.integers(6, 40))
    k = 10.0 ** rng.uniform(2.0, 5.0, n + 1)
    c = k * 10.0 ** rng.uniform(-4.0, -2.0) * rng.integers(0, 2)
    c[rng.integers(1, n, 2)] += 10.0 ** rng.uniform(-1.0, 2.0, 2)
    k, c = (np.round(values * 2.0**20) / 2.0**20 for values in (k, c))
    cut = np.array([0, n, n // 2])[rng.random(3) < 0.4]
    k[cut], c[cut] = 0.0, 0.0
    rows, eye = np.eye(n + 1, n) - np.eye(n + 1, n, -1), np.eye(n)
    C, K = (rows.T @ (values[:, None] * rows) for values in (c, k))
    i, j = rng.permutation(n)[:2]
    lines = {"first": eye[rng.integers(n)], "apart": eye[n // 2] - eye[n // 3]}
    M = np.diag(10.0 ** rng.uniform(-1.0, 1.0, n))
    model = bc.structure.SecondOrderModel(M, C, K, {"a": eye[i], "b": eye[j]}, lines)
    motion = rng.choice(["", "displacement", "velocity", "acceleration"])
    return bc.structure.prescribe_displacement(model, "a", motion=str(motion)) if motion else model


def _random_signal(rng, time):
    share, freq = time / time[-1], 10.0 ** rng.uniform(-1.0, 1.0)
    return (
        10.0 ** rng.uniform(-3.0, 1.0)
        * [
            np.minimum(share / rng.uniform(0.01, 1.0), 1.0),
            (share >= rng.uniform(0.0, 0.5)).astype(float),
            np.sin(2.0 * np.pi * freq * time),
            np.sin(2.0 * np.pi * freq * time * share),
            rng.standard_normal(len(time)).cumsum(),
        ][rng.integers(5)]
    )


def test_one_actuator_alone_and_superposition():
    model = bc.spray_boom(elements=20)
    both = forced_response(model, _TIME, _PLATFORM, "tip_left")
    alone = [
        forced_response(model, _TIME, {name: values}, "tip_left")["tip_left"] for name, values in _PLATFORM.items()
    ]
    np.testing.assert_allclose(both["tip_left"], sum(alone), atol=1e-6 * np.abs(both["tip_left"]).max())
    assert tuple(both.outputs) == ("tip_left",)
    assert both.response.input_labels == list(_PLATFORM)


@pytest.mark.parametrize(
    ("elements", "excitation", "tolerance"),
    [
        (6, "displacement", 1e-9),
        ([-6.0, -3.5, -1.0, 0.5, 3.0, 6.0], "displacement", 1e-9),
        (24, "acceleration", 1e-6),
    ],
    ids=["halves", "no symmetry", "many modes"],
)
def test_forced_response_equals_open_sampled_loop(elements, excitation, tolerance):
    model = bc.spray_boom(elements=elements, excitation=excitation)
    loop = simulate_loop(model, None, _TIME, _PLATFORM, sample_time=float(_TIME[1]))
    found = forced_response(model, _TIME, _PLATFORM, rtol=1e-9)
    for name, values in loop.outputs.items():
        np.testing.assert_allclose(found[name], values, atol=tolerance * max(1.0, np.abs(values).max()))


def exact_response(model, signals, step, bits=200):
    """Return outputs by name of a structure at rest; its signals are linear between samples ``step`` apart."""
    before, ctx.prec = ctx.prec, bits
    try:
        model = model.select(tuple(signals), None)
        return dict(zip(model.output_labels, _outputs(model, np.array(list(signals.values())), step), strict=True))
    finally:
        ctx.prec = before


def _exact(matrix):
    return arb_mat((matrix.toarray() if hasattr(matrix, "toarray") else np.asarray(matrix, dtype=float)).tolist())


def _matrices(structure, ports):
    """Return mass, damping, stiffness and the loads of displacements."""
    if not structure.has_strains:
        return *(_exact(matrix) for matrix in (structure.M, structure.C, structure.K)), _exact(ports.B[0])
    N, R, weights = _exact(structure.layout.N), _exact(structure.layout.R), structure.weights
    M, C, K = (
        rows.transpose() * _exact(np.diag(w)) * rows for rows, w in ((N, weights.m), (R, weights.c), (R, weights.k))
    )
    if ports.strains is None:
        return M, C, K, _exact(ports.B[0])
    moved = np.array(ports.moved)
    loads = R.transpose() * _exact(np.diag(weights.k)) * _exact(-ports.strains * moved)
    return M, C, K, loads + _exact(ports.B[0] * ~moved)


def _outputs(model, U, step):
    ports, n, m = model.ports, model.ncoordinates, len(U)
    order = np.array(ports.integrators)
    M, C, K, B0 = _matrices(model.structure, ports)
    size = 2 * n + int(order.sum())  # states: q - G d, q' less its part in d, integrals of inputs
    d, rates, first = np.zeros((3, m, size + m)), [], 2 * n
    for i, count in enumerate(order):
        places = [*range(first, first + count), size + i]
        for k, place in enumerate(places):
            d[k, i, place] = 1.0
        rates += [d[k + 1, i] for k in range(count)]
        first += count
    d = [_exact(rows) for rows in d]
    G = M.solve(_exact(ports.B[2] * (order == 0)))
    H = M.solve(_exact(ports.B[1] * (order == 0)) - C * G)
    q = _exact(np.eye(n, size + m)) + G * d[0]
    v = _exact(np.eye(n, size + m, n)) + H * d[0] + M.solve(_exact(ports.B[2] * (order == 1))) * d[1]
    force = B0 * d[0] + _exact(ports.B[1] * (order > 0)) * d[1] + _exact(ports.B[2] * (order > 1)) * d[2]
    a = M.solve(force - K * q - C * v)
    y = _exact(np.zeros((len(ports.outputs), size + m)))
    for L, E, x, u in zip(ports.L, ports.E, (q, v, a), d, strict=True):
        y += _exact(L) * x + _exact(E) * u
    # exponential of the states, the inputs and their slopes
    moving = v.tolist() + a.tolist() + (_exact(rates).tolist() if rates else [])
    rows = [[x * step for x in row] + [0] * m for row in moving]
    generator = rows + np.eye(2 * m, size + 2 * m, size + m).astype(int).tolist()
    advance = arb_mat(arb_mat(generator).exp().tolist()[:size]).mid()
    state, found = [[0]] * size, []
    for here, there in zip(U.T, np.vstack([U.T[1:], U.T[-1:]]), strict=True):
        u, after = ([[x] for x in values.tolist()] for values in (here, there))
        found.append([float(x) for (x,) in (y * arb_mat(state + u)).tolist()])
        slope = (arb_mat(after) - arb_mat(u)).tolist()
        state = (advance * arb_mat(state + u + slope)).mid().tolist()
    return np.array(found).T
