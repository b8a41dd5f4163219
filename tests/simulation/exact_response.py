"""Responses of structures from their stored rows or matrices, by matrix exponentials in ball arithmetic."""

import numpy as np
from flint import arb_mat, ctx


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
