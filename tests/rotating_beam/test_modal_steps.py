"""Steps of modes in closed form: the forces between them satisfy their equations, settled or solved for."""

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st

from boomctl.rotating_beam.motion.modal_steps import STAGES, _forces, solve_steps
from tests.profiles import examples


def random_steps(seed, m=3, n=3):
    generator = np.random.default_rng(seed)
    omega = np.sort(generator.uniform(2.0, 60.0, (m, n)), axis=1)
    h, push = generator.uniform(0.3, 2.0, m), generator.normal(size=(m, n, STAGES))
    mixed = generator.normal(size=(m, n, n))
    return omega, h, push, generator.normal(size=(m, STAGES)), mixed + mixed.swapaxes(1, 2)


@examples(30)
@given(seed=st.integers(0, 10**6), strength=st.floats(1e-3, 30.0), drive=st.sampled_from([0.0, 1e-6, 1.0, 1e6]))
@example(seed=0, strength=0.0, drive=1.0)
@example(seed=0, strength=1e-3, drive=0.0)
@example(seed=0, strength=30.0, drive=1e6)
def test_answers_superpose_and_satisfy_the_coupled_equations(seed, strength, drive):
    """The hub's column scales with the drive; the forces are those of the coordinates that they make."""
    omega, h, push, remainder, coupling = random_steps(seed)
    steps = solve_steps(omega, h, drive * push, strength * remainder, coupling)
    unit = solve_steps(omega, h, push, strength * remainder, coupling)
    scale = np.abs(unit.ends[..., -1]).max()
    np.testing.assert_allclose(steps.ends[..., -1], drive * unit.ends[..., -1], rtol=1e-9, atol=1e-9 * drive * scale)
    np.testing.assert_allclose(steps.ends[..., :-1], unit.ends[..., :-1], rtol=0.0, atol=1e-9)


@examples(40)
@given(seed=st.integers(0, 10**6), strength=st.floats(0.0, 10.0))
@example(seed=1, strength=0.01)
@example(seed=1, strength=10.0)
def test_forces_between_modes_leave_no_residual(seed, strength):
    generator = np.random.default_rng(seed)
    _, _, _, remainder, coupling = random_steps(seed)
    (m, n), s = coupling.shape[:2], STAGES
    to_nodes = generator.normal(size=(m, n, s, s)) / (3.0 * s)
    free = generator.normal(size=(m, n, s, 2 * n + 1))
    force = _forces(to_nodes, strength * remainder, coupling, free)
    z = free + to_nodes @ force
    wanted = -strength * remainder[:, None, :, None] * np.einsum("mij,mjsc->misc", coupling, z)
    assert np.abs(force - wanted).max() <= 1e-9 * max(np.abs(wanted).max(), strength)
