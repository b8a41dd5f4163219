"""What cannot be simulated is refused in words that name the parameter."""

import control as ct
import numpy as np
import pytest

from boomctl.simulation import forced_response, simulate_loop

_TIME = 0.01 * np.arange(101)


def _plant(damping=0.4):
    A = [[0.0, 1.0], [-4.0, -damping]]
    ports = {"inputs": ["cradle", "d"], "outputs": ["cradle_slip"]}
    return ct.ss(A, [[0.0, 0.0], [1.0, 1.0]], [[1.0, 0.0]], [[0.0, 0.0]], **ports)


@pytest.mark.parametrize("friction", [1.0, "cradle", {"force": 1.0}])
def test_friction_of_another_kind(friction):
    with pytest.raises(TypeError, match=r"friction = .*: expected CoulombFriction"):
        simulate_loop(_plant(), None, None, _TIME, sample_time=0.01, friction=friction)


@pytest.mark.parametrize("pair", [(1.0,), (), (1.0, "cradle", 2)])
def test_a_stop_that_is_no_pair(pair):
    limit = {"cradle_slip": pair}
    with pytest.raises(ValueError, match=r"stroke_limit\['cradle_slip'\]"):
        simulate_loop(_plant(), None, None, _TIME, sample_time=0.01, stroke_limit=limit)


def test_rows_of_different_lengths_are_refused_by_the_name_of_their_input():
    for run in (
        lambda d: simulate_loop(_plant(), None, d, _TIME, sample_time=0.01),
        lambda d: forced_response(_plant(), d, _TIME),
    ):
        with pytest.raises(ValueError, match="disturbance 'd'"):
            run({"d": [1.0, [2.0]]})


def test_a_response_beyond_all_numbers_is_refused():
    plant = ct.ss([[5.0]], [[1.0]], [[1.0]], 0.0, inputs="d", outputs="y")
    time = 0.5 * np.arange(2000)
    with np.errstate(all="ignore"), pytest.raises(ValueError, match="beyond all numbers"):
        forced_response(plant, {"d": np.ones(len(time))}, time)
