"""Controllers with a matrix for each sample, around linear plants and hub-beams."""

import control as ct
import numpy as np
import pytest

import boomctl as bc

_TS = 0.02
_NAMES = ["hub_angle", "hub_speed"], ["torque"]
_LAW = ct.ss([[0.6]], [[0.4, 0.02]], [[-60.0]], [[-80.0, -240.0]], _TS, inputs=_NAMES[0], outputs=_NAMES[1])


def _repeated(count, scale=None):
    """The same law at each sample, its gains scaled."""
    A, B, C, D = (np.repeat(np.asarray(each)[None], count, axis=0) for each in (_LAW.A, _LAW.B, _LAW.C, _LAW.D))
    if scale is not None:
        C, D = C * scale[:, None, None], D * scale[:, None, None]
    return bc.simulation.TimeVaryingController(A, B, C, D, *_NAMES, sample_time=_TS)


def _plants():
    beam = bc.hub_beam(modes=2)
    return {"hub-beam": beam, "linear": beam.linearize()}


@pytest.mark.parametrize("kind", ["hub-beam", "linear"])
def test_each_sample_has_its_own_matrices_and_the_last_stay(kind):
    """A controller that goes on with other matrices is one that is started anew where the first ended."""
    plant, time = _plants()[kind], np.arange(0.0, 1.0, _TS)
    scale = np.array([1.0, 0.5, 2.0, 0.0, 1.5])
    start = np.linspace(0.1, 0.2, 6)
    run = bc.simulate_loop(plant, _repeated(5, scale), None, time, sample_time=_TS, initial=start)
    state = np.zeros(1)
    for k in range(8):
        read = np.array([run["hub_angle"][k], run["hub_speed"][k]])
        asked = scale[min(k, 4)] * (_LAW.C @ state + _LAW.D @ read)
        assert run.asked["torque"][k] == pytest.approx(float(asked[0]), rel=1e-9)
        state = _LAW.A @ state + _LAW.B @ read
