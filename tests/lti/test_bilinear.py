"""The bilinear map: the same response at frequencies that belong together."""

import mpmath as mp
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from boomctl.lti.bilinear import continuous_image, image_of_omega
from boomctl.lti.modal import ModalSystem, continuous_image_of_modes
from boomctl.lti.system import Lti
from tests.profiles import examples


def discrete(seed):
    rng = np.random.default_rng(seed)
    n, m, p = (int(k) for k in rng.integers(1, 7, 3))
    A = rng.standard_normal((n, n))
    A *= 0.9 / np.abs(np.linalg.eigvals(A)).max()
    B, C, D = rng.standard_normal((n, m)), rng.standard_normal((p, n)), rng.standard_normal((p, m))
    return Lti(A, B, C, D, dt=float(10.0 ** rng.uniform(-4, 1)))


@given(st.integers(0, 10_000))
def test_an_image_responds_alike(seed):
    system = discrete(seed)
    omega = np.linspace(0.0, 0.999 * np.pi / system.dt, 50)
    image = continuous_image(system)
    there = image.response(image_of_omega(omega, system.dt))
    assert np.allclose(there, system.response(omega), rtol=1e-9, atol=1e-10 * np.abs(there).max())
    last = system.response(np.array([np.pi / system.dt]))[:, :, 0].real
    assert np.allclose(image.D, last, rtol=1e-9, atol=1e-10)


@examples(60)
@given(st.integers(0, 100_000))
def test_bilinear_image_of_modes_same_response(seed):
    rng = np.random.default_rng(seed)
    n, dt = int(rng.integers(1, 6)), float(10.0 ** rng.uniform(-4.0, 0.0))
    angles = np.pi * rng.choice([1.0, 10.0 ** rng.uniform(-6.0, 0.0), 1.0 - 10.0 ** rng.uniform(-6.0, 0.0)], n)
    half = (1.0 - 10.0 ** rng.uniform(-7.0, -0.1, n)) * np.exp(1j * angles)
    B, C = (rng.standard_normal((n, 2)) @ [1.0, 1j] for _ in range(2))
    modes = ModalSystem(
        np.concatenate([half, half.conj()]),
        np.concatenate([B, B.conj()])[:, None],
        np.concatenate([C, C.conj()])[None],
        np.ones((1, 1)),
    )
    image, lost = continuous_image_of_modes(modes, dt)
    omega = np.concatenate([[0.0, 1e9 / dt], image.poles.imag * (1.0 + 1e-7), 10.0 ** rng.uniform(-3.0, 3.0, 5) / dt])
    found = image.response(omega)[0, 0]
    with mp.workdps(60):
        for w, G in zip(omega.tolist(), found.tolist(), strict=True):
            s = mp.mpc(0.0, w) * dt / 2
            z = (1 + s) / (1 - s)
            terms = [mp.mpc(c) * b / (z - p) for c, b, p in zip(modes.C[0], modes.B[:, 0], modes.poles, strict=True)]
            assert abs(G - (1 + mp.fsum(terms))) <= lost
