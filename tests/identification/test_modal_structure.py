"""Structures of modal models have their transfer functions, with real poles, rigid bodies and any kind of output."""

import numpy as np
import pytest

from boomctl.identification.modal.modal_structure import modal_structure

OMEGA = np.geomspace(0.03, 3e3, 60)


def drawn(seed):
    """Return a random modal model: arguments of `modal_structure`."""
    rng = np.random.default_rng(seed)
    m, p, r = (int(rng.integers(low, high)) for low, high in ((1, 4), (1, 4), (0, 5)))
    k = int(rng.integers(0 if r else 1, 6))

    def normal(*shape):
        return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)

    size, damping = 10.0 ** rng.uniform(-1.0, 3.0, k), 10.0 ** rng.uniform(-4.0, -0.05, k)
    real_poles = -(10.0 ** rng.uniform(-1.0, 3.0, r))
    real_poles[:1] *= rng.random() < 0.5
    residues, b = rng.standard_normal((r, m, p)), normal(k, m)
    if rng.random() < 0.3:  # one direction of all real poles
        residues = rng.standard_normal((1, m, 1)) * rng.standard_normal((r, 1, p))
    if rng.random() < 0.3:
        b = b.real + 0j
    given = {
        "poles": size * (-damping + 1j * np.sqrt(1.0 - damping**2)),
        "b": b,
        "c": normal(k, p) * 10.0 ** rng.uniform(-2.0, 2.0, (k, 1)),
        "D": rng.standard_normal((p, m)),
    }
    options = {
        "derivatives": rng.integers(0, 3, p).tolist(),
        "modes": int(rng.integers(0, k + 1)),
        "real_poles": real_poles,
        "real_residues": residues,
        "double_residue": rng.standard_normal((m, p)) if rng.random() < 0.4 else None,
    }
    return given, options


def response(poles, b, c, D, real_poles=(), real_residues=(), double_residue=None, **_):
    """Return the sum of partial fractions, outputs by inputs by frequencies."""
    s = 1j * OMEGA
    total = np.repeat(D[:, :, None], len(s), axis=2).astype(complex)
    for pole, force, row in zip(poles, b, c, strict=True):
        R = np.outer(row, force)[:, :, None]
        total += R / (s - pole) + R.conj() / (s - pole.conjugate())
    for pole, residue in zip(real_poles, real_residues, strict=True):
        total += residue.T[:, :, None] / (s - pole)
    return total if double_residue is None else total + double_residue.T[:, :, None] / s**2


def structure_of(given, options):
    p, m = given["D"].shape
    return modal_structure(*given.values(), [f"u{i}" for i in range(m)], [f"y{i}" for i in range(p)], **options)


@pytest.mark.parametrize("seed", range(20))
def test_structure_of_modal_model_has_its_response(seed):
    given, options = drawn(seed)
    model, wanted = structure_of(given, options), response(**given, **options)
    size = np.abs(wanted).max(axis=(0, 1))
    assert (np.abs(model.frequency_response(OMEGA).frdata - wanted).max(axis=(0, 1)) < 1e-12 * size).all()
    assert (model.to_statespace().poles().real <= 1e-12).all()


def test_mass_with_friction_is_one_coordinate():
    """Of ``k/(s (s + a))`` the residues at 0 and at ``-a`` are ``k/a`` and ``-k/a``."""
    residues = np.array([[[0.5]], [[-0.5]]])
    none = np.zeros((0, 1))
    model = modal_structure(
        np.zeros(0), none, none, np.zeros((1, 1)), ["volt"], ["angle"], real_poles=[0.0, -4.0], real_residues=residues
    )
    assert (model.coordinates, model.K.tolist(), model.C.tolist()) == (("real_pole_1_2",), [[0.0]], [[4.0]])
    np.testing.assert_allclose(model.ports.L[:, 0, 0] * model.ports.B[0, 0, 0], [2.0, 0.0, 0.0], atol=1e-15)


def test_acceleration_keeps_shape_where_frequency_changes():
    """An accelerometer on a mass reads ``s^2/(s^2 + C s + K)`` at every stiffness, without feedthrough besides."""
    pole = complex(-0.1, 5.0)
    c = pole**2 / (2j * pole.imag)
    model = modal_structure(
        np.array([pole]), np.ones((1, 1)), np.array([[c]]), np.ones((1, 1)), ["u"], ["a"], derivatives=[2]
    )
    np.testing.assert_allclose(model.ports.L[:, 0, 0] * model.ports.B[0, 0, 0], [0.0, 0.0, 1.0], atol=1e-14)
    np.testing.assert_allclose(model.ports.E, 0.0, atol=1e-14)
