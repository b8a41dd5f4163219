"""Signals in units of their own."""

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc

sizes = st.floats(1e-3, 1e3)


def plant() -> control.StateSpace:
    rng = np.random.default_rng(3)
    A = rng.standard_normal((4, 4)) - 4.0 * np.eye(4)
    B, C, D = rng.standard_normal((4, 2)), rng.standard_normal((2, 4)), rng.standard_normal((2, 2))
    return control.ss(A, B, C, D, inputs=["push", "pull"], outputs=["stroke", "tip"])


@given(sizes, sizes)
def test_a_loop_closed_in_units_is_the_loop_closed_in_si(force, stroke):
    """What the controller is given and gives is the same in both, so the poles are."""
    units = {"push": force, "stroke": stroke}
    G = plant()
    scaled = bc.in_units(G, units)
    K = control.ss([[-2.0]], [[1.0]], [[0.3]], 0.1, inputs=["stroke"], outputs=["push"])
    poles = []
    for system, law in ((scaled, K), (G, bc.from_units(K, units))):
        one = control.ss(system.A, system.B[:, [0]], system.C[[0]], system.D[[0]][:, [0]])
        poles.append(np.sort_complex(control.feedback(one, control.ss(law.A, law.B, law.C, law.D), sign=1).poles()))
    assert np.allclose(*poles, rtol=1e-8, atol=1e-8)
    assert scaled.input_labels == G.input_labels
    assert scaled.output_labels == G.output_labels


def test_units_are_what_counts_as_one():
    scaled = bc.in_units(plant(), {"push": 100.0, "tip": 0.2})
    assert np.allclose(scaled(0.5j)[1, 0], plant()(0.5j)[1, 0] * 100.0 / 0.2)
    assert np.allclose(scaled(0.5j)[0, 1], plant()(0.5j)[0, 1])


def test_bad_units_are_refused():
    with pytest.raises(ValueError, match=r"units\['push'\] = 0"):
        bc.in_units(plant(), {"push": 0.0})
    with pytest.raises(ValueError, match="did you mean 'stroke'"):
        bc.in_units(plant(), {"strokes": 0.1})


def test_what_is_no_mapping_no_system_or_beyond_numbers_is_refused():
    K = control.ss([[-2.0]], [[1.0]], [[0.3]], 0.1, inputs=["stroke"], outputs=["push"])
    for units in (None, 2.0, "push", [0.1]):
        for call in (lambda u: bc.in_units(plant(), u), lambda u: bc.from_units(K, u)):
            with pytest.raises(TypeError, match=r"units = .*: expected a mapping of signals to what counts as one"):
                call(units)
    for wrong in (None, control.frd([1.0], [1.0])):
        with pytest.raises(TypeError, match=r"controller: expected StateSpace"):
            bc.from_units(wrong, {})
    for call in (lambda u: bc.in_units(plant(), u), lambda u: bc.from_units(K, u)):
        with pytest.raises(
            ValueError, match=r"in these units: expected finite numbers|expected a number of at least 1e-100"
        ):
            call({"stroke": 1e-310})
    with pytest.raises(ValueError, match=r"controller: expected finite numbers, got A\[0, 0\] = nan"):
        bc.from_units(control.ss([[np.nan]], [[1.0]], [[0.3]], 0.1), {})
