"""Pictures of slews draw what the results hold."""

import re

import numpy as np
import pytest

import boomctl as bc
from boomctl.plotting import figure_of
from boomctl.plotting.canvas import film
from boomctl.plotting.slew import animate_slew
from boomctl.slew import compare_slews


@pytest.mark.parametrize("radius", [0.0, 0.5])
def test_animate_slew_draws_each_motion(radius):
    beam = bc.hub_beam(bc.HubBeamParameters(hub_radius=radius), modes=1)
    t = np.linspace(0.0, 1.0, 21)
    motions = {
        f"{torque:g} N m": beam.simulate(bc.torque(lambda t, u=torque: u + 0.0 * t), t) for torque in (50.0, 100.0)
    }
    shown = animate_slew(beam, motions, title="pushed", time_step=0.25)
    figure = shown._fig
    shown._func(3)  # at 0.75 s
    (spoke, *lines), ax = figure.axes[0].get_lines(), figure.axes[0]
    for line, (name, motion) in zip(lines, motions.items(), strict=True):
        shape = beam.shape(motion.states[15:16])[0]
        assert line.get_label() == name
        assert np.allclose(line.get_xdata() + 1j * line.get_ydata(), shape, atol=1e-12)
    first = motions["50 N m"].hub_angle[15]
    assert np.angle(complex(spoke.get_xdata()[1], spoke.get_ydata()[1])) == pytest.approx(first)
    assert ax.get_title(loc="left") == "pushed, t = 0.8 s"
    assert film("slew", shown, "two slews").files["gif"].startswith(b"GIF")


@pytest.mark.slow
def test_no_two_slews_share_a_look_or_a_place():
    comparison = compare_slews(bc.hub_beam(modes=1), 0.5, 100.0)
    names = ("bang-bang", "bang-bang, ZV", "bang-bang, EI")
    figure = figure_of(comparison.plot, names=names)
    right = figure.axes[-1]
    markers = {c.get_label(): c for c in right.get_lines() if not re.match("_|frequencies", str(c.get_label()))}
    assert set(markers) == {line.name for line in comparison.lines}
    looks = {(c.get_marker(), c.get_color(), c.get_markerfacecolor()) for c in markers.values()}
    assert len(looks) == len(markers)
    places = np.sort([float(c.get_xdata()[0]) for c in markers.values()])
    assert np.diff(places).min() > 0.02 * np.ptp([line.duration for line in comparison.lines])
    for line in comparison.lines:
        assert markers[line.name].get_ydata()[0] == max(line.vibration, 1e-4)
    assert len({markers[name].get_color() for name in names}) == len(names)
