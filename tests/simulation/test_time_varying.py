"""Controllers with a matrix for each sample, around linear plants and hub-beams."""

import control as ct
import numpy as np
import pytest

import boomctl as bc

_TS = 0.02
_NAMES = ["hub_angle", "hub_speed"], ["torque"]
_LAW = ct.ss([[0.6]], [[0.4, 0.02]], [[-60.0]], [[-80.0, -240.0]], _TS, inputs=_NAMES[0], outputs=_NAMES[1])


@pytest.mark.parametrize("kind", ["hub-beam", "linear"])
def test_each_sample_has_its_own_matrices_and_the_last_stay(kind):
    """A controller that goes on with other matrices is one that is started anew where the first ended."""
    beam, time = bc.hub_beam(modes=2), np.arange(0.0, 1.0, _TS)
    plant, scale = beam if kind == "hub-beam" else beam.linearize(), np.array([1.0, 0.5, 2.0, 0.0, 1.5])
    A, B, C, D = (np.repeat(np.asarray(each)[None], 5, axis=0) for each in (_LAW.A, _LAW.B, _LAW.C, _LAW.D))
    C, D = C * scale[:, None, None], D * scale[:, None, None]
    varying = bc.simulation.TimeVaryingController(A, B, C, D, *_NAMES, dt=_TS)
    start = np.linspace(0.1, 0.2, 6)
    run = bc.simulate_loop(plant, varying, time, None, sample_time=_TS, initial_state=start)
    state = np.zeros(1)
    for k in range(8):
        read = np.array([run["hub_angle"][k], run["hub_speed"][k]])
        asked = scale[min(k, 4)] * (_LAW.C @ state + _LAW.D @ read)
        assert run.commanded["torque"][k] == pytest.approx(float(asked[0]), rel=1e-9)
        state = _LAW.A @ state + _LAW.B @ read
