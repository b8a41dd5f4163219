"""Pictures draw what the results hold: data, limits and words."""

from types import SimpleNamespace

import control
import numpy as np
import pytest
from matplotlib.figure import Figure

import boomctl as bc
from boomctl.plotting import figure_of
from boomctl.plotting.canvas import film
from boomctl.plotting.slew import animate_slew
from boomctl.plotting.suspension import draw_run
from boomctl.structure import SecondOrderModel
from boomctl.structure.response.mode_shapes import BodyShape, ModeShapes
from tests import handed_out

OMEGA = np.array([0.5, 1.0, 2.0])


def test_bode_plot_draws_magnitude_and_phase_of_each_pair():
    plant = control.ss([[-1.0]], [[2.0, -3.0]], [[1.0]], 0.0)
    upper, lower = bc.bode(plant, OMEGA).plot(Figure())
    response = np.array([[2.0], [-3.0]]) / (1j * OMEGA + 1.0)
    for k, found in enumerate(response):
        assert upper.get_lines()[k].get_ydata() == pytest.approx(np.abs(found))
        turned = np.asarray(lower.get_lines()[k].get_ydata()) - np.degrees(np.angle(found))
        assert np.mod(turned + 180.0, 360.0) == pytest.approx(180.0)
    assert lower.get_lines()[0].get_ydata()[0] == pytest.approx(-np.degrees(np.arctan(0.5)))


@pytest.mark.parametrize(("gain", "verdict"), [(0.5, "stable"), (-2.0, "1 unstable")])
def test_nyquist_plot_says_whether_the_loop_is_stable(gain, verdict):
    plant = control.ss([[-1.0]], [[1.0]], [[1.0]], 0.0, inputs="u", outputs="y")
    controller = control.ss([], [], [], [[-gain]], inputs="y", outputs="u")
    found = bc.nyquist(plant, controller)
    assert found.stable == (verdict == "stable")
    label = found.plot(Figure().add_subplot()).get_legend_handles_labels()[1][0]
    assert label.endswith(f": {verdict}")


def test_mode_table_plot_has_damping_in_percent_over_hertz():
    model = SecondOrderModel([[1.0]], [[0.04]], [[4.0]], {"force": [1.0]}, {"place": [1.0]})
    (line,) = bc.mode_table(model).plot(Figure().add_subplot()).get_lines()
    assert (line.get_xdata(), line.get_ydata()) == (pytest.approx([1.0 / np.pi]), pytest.approx([1.0]))


def test_mode_shape_plots_in_the_plane_are_of_one_size():
    upright = np.array([[0.0, 0.0], [0.0, 2.0], [0.0, 4.0]])
    motion = np.zeros((2, 3, 2))
    motion[0, :, 0], motion[1, :, 1] = (0.0, 0.5, 1.0), (0.0, 0.5, 1.0)
    shapes = ModeShapes(np.ones(2), np.eye(2), ("a", "b"), ("", ""), (BodyShape("mast", True, upright, motion),))
    axes = shapes.plot(Figure())
    moved = [np.asarray(ax.get_lines()[1].get_xydata()) for ax in axes]
    assert moved[0][:, 0] == pytest.approx([0.0, 0.3, 0.6])  # 0.15 of a mast of 4 m
    assert moved[1][:, 1] == pytest.approx([0.0, 2.3, 4.6])
    for ax in axes:
        assert ax.get_ylim()[0] < 0.0 < 4.6 < ax.get_ylim()[1] < 6.0
        assert ax.get_xlim()[0] < 0.0 < 0.6 < ax.get_xlim()[1] < 1.0


@pytest.mark.parametrize(("stroke", "limited"), [(0.03, True), (0.01, False)])
def test_draw_run_shows_millimeters_and_limits_that_are_near(stroke, limited):
    time = np.linspace(0.0, 2.0, 41)
    wave = np.sin(np.pi * time)

    def run(controls):
        moved = SimpleNamespace(
            time=time, controls=controls, disturbances={"actuator_left": 0.01 * wave, "actuator_right": 0.02 * wave}
        )
        signals = {"tip_left": 0.1 * wave, "stroke_left": stroke * wave}
        return type("Run", (), {"__getitem__": lambda self, name: signals[name], **vars(moved)})()

    forces = {"suspension_left": 100.0 * wave, "suspension_right": -90.0 * wave}
    figure = draw_run(run({}), run(forces), ("before", "after"), (120.0, 0.05), (0.5, 1.5))
    platform, tip, strokes, force = figure.axes
    seen = wave[10:31]
    for ax, k, values in ((platform, 1, 20.0), (tip, 0, 100.0), (strokes, 1, 1e3 * stroke), (force, 0, 100.0)):
        assert ax.get_lines()[k].get_ydata() == pytest.approx(values * seen)
    levels = [float(line.get_ydata()[0]) for line in strokes.get_lines()[2:]]
    assert levels == ([-50.0, 50.0] if limited else [])
    assert [float(line.get_ydata()[0]) for line in force.get_lines()[2:]] == [-120.0, 120.0]
    assert force.get_xlim() == (0.5, 1.5)


@pytest.mark.parametrize("radius", [0.5, pytest.param(0.0, marks=pytest.mark.slow)])
def test_animate_slew_draws_each_motion(radius):
    beam = bc.hub_beam(bc.HubBeamParameters(hub_radius=radius), modes=1)
    t = np.linspace(0.0, 1.0, 21)
    motions = {
        f"{torque:g} N m": beam.simulate(bc.maneuvers.applied_torque(lambda t, u=torque: u + 0.0 * t), t)
        for torque in (50.0, 100.0)
    }
    shown = animate_slew(beam, motions, title="pushed", time_step=0.25)
    figure = shown._fig
    shown._func(3)  # at 0.75 s
    (spoke, *lines), ax = figure.axes[0].get_lines(), figure.axes[0]
    for line, (name, motion) in zip(lines, motions.items(), strict=True):
        shape = beam.deformed_shape(motion.states[15:16])[0]
        assert line.get_label() == name
        assert np.allclose(line.get_xdata() + 1j * line.get_ydata(), shape, atol=1e-12)
    first = motions["50 N m"].hub_angle[15]
    assert np.angle(complex(spoke.get_xdata()[1], spoke.get_ydata()[1])) == pytest.approx(first)
    assert ax.get_title(loc="left") == "pushed, t = 0.8 s"
    assert film("slew", shown, "two slews").files["gif"].startswith(b"GIF")


def test_slew_comparison_plot_has_vibration_of_each_slew():
    comparison = handed_out.comparison()
    vibrations = figure_of(comparison.plot).axes[-2].get_lines()
    drawn = {line.get_label(): line.get_ydata() for line in vibrations}
    for line in comparison.rows:
        assert drawn[line.name] == pytest.approx([line.residual_vibration])
