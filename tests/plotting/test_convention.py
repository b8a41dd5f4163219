"""One convention for every result: ``.plot(ax=None, **style)`` returns axes, of a figure that pyplot shows or of the user.

Reports draw the same pictures on figures that pyplot does not know.
"""

import functools
import inspect
import multiprocessing
import os
import threading
import warnings
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module

import control
import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import boomctl as bc
from boomctl.identification import MeasuredFrequencyResponse
from boomctl.plotting import figure_bytes, figure_of, style
from tests import fuzz
from tests import handed_out as one
from tests.handed_out import FACTORIES
from tests.profiles import is_quick

ENDS = ["actuator_left", "actuator_right"], ["tip_left", "tip_right"]
MARK = "#123456"  # a color that no picture has by itself


def plots():
    """Return the methods of public classes that draw, by the name of their class."""
    packages = "structure boom rotating_beam analysis reduction synthesis tuning simulation slew studies.sweeps"
    found = {}
    for package in packages.split():
        module = import_module(f"boomctl.{package}")
        owners = [getattr(module, name) for name in module.__all__]
        found |= {owner.__name__: owner.plot for owner in owners if isinstance(owner, type) and hasattr(owner, "plot")}
    return found


PLOTS = plots()
EACH = pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow if name == "TrackingStudy" else ()) for name in sorted(PLOTS)]
)


@pytest.fixture(autouse=True)
def _nothing_left():
    """Begin and end without a figure of pyplot, drawn on no screen."""
    mpl.use("Agg")
    plt.close("all")
    yield
    plt.close("all")


@functools.cache
def made(name):
    """Return a result, and how many axes its picture has."""
    result = FACTORIES[name]()
    return result, np.size(result.plot())


def test_every_plot_has_arguments_of_convention():
    for plot in PLOTS.values():
        parameters = list(inspect.signature(plot).parameters.values())[1:]
        assert (parameters[0].name, parameters[0].default) == ("ax", None)
        assert parameters[-1].kind is inspect.Parameter.VAR_KEYWORD
        assert all(p.kind is p.KEYWORD_ONLY for p in parameters[1:-1])


@EACH
def test_plot_returns_axes_and_report_matches(name):
    before, (result, count) = dict(mpl.rcParams), made(name)
    plt.close("all")
    axes = result.plot()
    assert isinstance(axes, np.ndarray if count > 1 else Axes)
    several = np.ravel(np.asarray(axes, dtype=object))
    assert all(isinstance(each, Axes) and each.has_data() for each in several)
    assert all(each.get_ylabel() or each.get_title(loc="left") or each.texts for each in several)
    assert several[-1].get_xlabel()
    assert len(plt.get_fignums()) == 1
    assert plt.gcf() is several[0].figure
    plain = figure_of(result.plot)
    assert len(plt.get_fignums()) == 1
    if not is_quick():  # drawing takes a fifth of a second
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            assert figure_bytes(plain, "png").startswith(b"\x89PNG")
    assert plain.get_size_inches() == pytest.approx(plt.gcf().get_size_inches())
    assert [len(each.get_lines()) for each in plain.axes] == [len(each.get_lines()) for each in plt.gcf().axes]
    assert dict(mpl.rcParams) == before


@EACH
def test_plot_on_given_axes_and_style(name):
    result, count = made(name)
    plt.close("all")
    own = Figure().subplots(count, 1)
    drawn = result.plot(ax=own if count > 1 else [own])
    assert list(np.ravel(drawn)) == list(np.ravel(own))
    assert all(each.has_data() for each in np.ravel(own))
    if name == "SprayResult":
        result.plot(own, cmap="viridis", label="mine")
        assert own.collections[-1].get_cmap().name == "viridis"
        assert own.get_title(loc="left").startswith("mine\nCV")
    else:
        result.plot(own, c=MARK, lw=3.25, label="mine")  # an overlay
        lines = [line for each in np.ravel(own) for line in each.get_lines()]
        marked = [line for line in lines if mpl.colors.to_hex(line.get_color()) == MARK]
        # what stands beside curves over time, vibrations left, has a look of its own
        assert len({line.axes for line in marked}) == count - 2 * (name == "SlewComparison")
        assert 3.25 in {line.get_linewidth() for line in marked}
        assert any(str(line.get_label()).startswith("mine") for line in marked)
    assert not plt.get_fignums()


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=() if n[0] in "SP" else pytest.mark.slow) for n in sorted(PLOTS)]
)  # one place refuses
def test_plot_invalid_axes_or_style_raises(name):
    (result, count), ax = made(name), Figure().add_subplot()
    plt.close("all")
    with pytest.raises(ValueError, match=rf"ax: expected {count} axes .*, got {count + 1}"):
        result.plot([ax] * (count + 1))
    with pytest.raises(TypeError, match="ax = 'mine': expected matplotlib axes"):
        result.plot("mine")
    unknown = "no_such_property" if name == "SprayResult" else "unexpected keyword argument 'no_such_property'"
    with pytest.raises((TypeError, AttributeError), match=unknown):
        result.plot(no_such_property=1)
    assert not plt.get_fignums()


def test_a_part_of_a_figure_is_divided():
    left, right = Figure(layout="constrained").subfigures(1, 2)
    axes = one.loop().plot(left)
    one.track().plot(right)
    assert {each.get_figure(root=False) for each in axes} == {left}
    assert len(right.axes) == 1


def test_plots_in_threads():
    before, tracks = (
        dict(mpl.rcParams),
        [bc.bump_track(0.1, 1.0 + seed, length=50.0) for seed in range(24)],
    )  # 20 of pyplot would warn
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with ThreadPoolExecutor(4) as pool:
            figures = list(pool.map(lambda track: figure_of(track.plot), tracks))
    assert dict(mpl.rcParams) == before
    assert not plt.get_fignums()
    assert {figure.axes[0].spines["top"].get_visible() for figure in figures} == {False}  # each has the look


def _drawn(seed):
    figure_of(bc.iso_track("C", 50.0, seed).plot)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes cannot be forked here")
@pytest.mark.filterwarnings("ignore:.*multi-threaded.*fork:DeprecationWarning")
def test_fork_while_thread_draws():
    drawing, done = threading.Event(), threading.Event()

    def draw():
        with style():
            drawing.set()
            done.wait(0.2)

    thread = threading.Thread(target=draw)
    thread.start()
    drawing.wait()
    process = multiprocessing.get_context("fork").Process(target=_drawn, args=(1,))
    process.start()
    process.join(30.0)
    assert process.exitcode == 0
    thread.join()


@pytest.mark.slow  # a kernel starts: 5 s
def test_notebook_shows_each_figure_once():
    pytest.importorskip("ipykernel")
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    cells = [
        "import sys, boomctl as bc; t = bc.iso_track(length=50.0); assert 'matplotlib.pyplot' not in sys.modules",
        "t.plot();",
        "t.plot(); print('not on the last line')",
        "bc.sigma(bc.spray_boom()).plot()",
        "import matplotlib.pyplot as plt; _, ax = plt.subplots(); t.plot(ax); t.plot(ax, linestyle='--');",
        "from boomctl.plotting import figure_of; figure_of(t.plot);",
    ]
    book = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell) for cell in cells])
    nbclient.NotebookClient(book, timeout=120).execute()
    pictures = [sum("image/png" in output.get("data", {}) for output in cell.outputs) for cell in book.cells]
    assert pictures == [0, 1, 1, 1, 1, 0]


def test_frequencies_are_drawn_in_unit_of_argument_or_axes():
    hz, rad = bc.sigma(one.mass(), frequency_hz=[1.0, 2.0]), bc.sigma(one.mass(), [1.0, 2.0])
    assert hz.omega == pytest.approx(2.0 * np.pi * np.array([1.0, 2.0]))
    for result, unit in ((hz, "Hz"), (rad, "rad/s")):
        ax = result.plot(Figure().subplots())
        assert ax.get_xlabel() == f"frequency [{unit}]"
        assert ax.get_lines()[0].get_xdata() == pytest.approx([1.0, 2.0])
    MeasuredFrequencyResponse(np.array([1.0, 2.0]), np.array([[3.0, 4.0]]), ("upper",)).plot(ax)
    assert ax.get_lines()[-1].get_xdata() == pytest.approx(2.0 * np.pi * np.array([1.0, 2.0]))
    ax = bc.sigma(one.mass()).plot(Figure().subplots())
    for options in ({}, {"frequency_unit": "Hz"}):
        rad.plot(ax, **options)
        assert ax.get_lines()[-2].get_xdata() == pytest.approx(rad.frequency_hz)
    with pytest.raises(ValueError, match="frequency_unit = 'rad/s': the curves on these axes are in Hz"):
        rad.plot(ax, frequency_unit="rad/s")
    with pytest.raises(ValueError, match="frequency_unit = 'kHz': expected 'Hz' or 'rad/s'"):
        rad.plot(frequency_unit="kHz")
    with pytest.raises(ValueError, match="omega, frequency_hz: expected one of them, got both"):
        bc.sigma(one.mass(), [1.0], frequency_hz=[1.0])
    theirs = control.singular_values_plot(control.singular_values_response(one.mass().to_statespace(), [1.0, 2.0]))
    ax = hz.plot(theirs.axes.ravel()[0])
    assert ax.get_lines()[-2].get_xdata() == pytest.approx(hz.omega)


def test_sigma_plot_of_zero_system_has_no_warning():
    zero = bc.sigma(control.ss([[-1.0]], [[0.0]], [[1.0]], 0.0), [0.0, 1.0])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert figure_bytes(figure_of(zero.plot), "png").startswith(b"\x89PNG")


def test_compare_sigma_grid_resolves_peaks_of_all_systems():
    slow, fast, undamped = (
        bc.structure.SecondOrderModel([[1.0]], [[c]], [[k]], {"f": [1.0]}, {"y": [1.0]})
        for c, k in ((0.1, 4.0), (0.2, 1e6), (0.0, 9.0))
    )
    found = bc.compare_sigma({"slow": slow, "fast": fast, "undamped": undamped})
    for name, system in (("slow", slow), ("fast", fast)):
        assert np.array_equal(found[name].omega, found["undamped"].omega)
        assert found[name].sigma.max() == pytest.approx(bc.sigma(system).peak, rel=1e-9)
        assert found[name].certified
    assert np.isfinite(found["undamped"].sigma).all()
    assert found["undamped"].peak == np.inf
    some = bc.compare_sigma({"slow": slow, "data": slow.frequency_response([1.0, 2.0])}, frequency_hz=[0.3, 0.4])
    assert some["slow"].frequency_hz == pytest.approx([0.3, 0.4])
    assert some["data"].omega == pytest.approx([1.0, 2.0])
    with pytest.raises(ValueError, match="systems: expected at least one"):
        bc.compare_sigma({})
    with pytest.raises(TypeError, match=r"systems\['mine'\]: .*expected SecondOrderModel"):
        bc.compare_sigma({"mine": 3.0})
    ax = bc.compare_sigma({"slow": slow, "fast": fast}).plot(Figure().subplots())
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["slow", "fast", "verified peak"]


@pytest.mark.parametrize("band", [None, (0.0, 20.0)])
def test_reduction_plot_error_below_bound(band):
    given = one.boom().select(*ENDS)
    result = bc.reduce(given, order=10, omega_range=band)
    curves = result.curves
    inside = slice(None) if band is None else curves.omega <= band[1]
    assert curves.error[inside].max() <= result.error_norm
    assert curves.error.max() <= result.error_bound
    assert curves.error[inside].max() > 0.9 * result.error_norm  # the peak of the error is on the grid
    exact = bc.sigma(given, curves.omega)
    assert curves.full == pytest.approx(exact.sigma, rel=1e-9)
    ax = result.plot(Figure().subplots())
    said = [text.get_text() for text in ax.get_legend().get_texts()]
    place = "everywhere" if band is None else "in the band"
    assert f"verified: at most {result.error_norm:.3g} {place}" in said


def test_nyquist_plot_touches_margin_disk():
    loop = bc.margins(one.yaw(), one.suspension())["suspension_anti"]
    omega, L = loop.loop_gain
    low, high = 1.0 / loop.disk_margin.gain_margin, loop.disk_margin.gain_margin
    distance = np.abs(-L + 0.5 * (low + high)) - 0.5 * (high - low)
    assert distance.min() == pytest.approx(0.0, abs=1e-4)
    assert omega[np.argmin(distance)] == pytest.approx(loop.disk_margin.omega, rel=1e-2)
    crossing = L[np.argmin(np.abs(omega - loop.phase_margin_omega))]
    assert abs(crossing) == pytest.approx(1.0, rel=1e-6)
    assert abs(np.degrees(np.angle(crossing))) == pytest.approx(loop.phase_margin_deg, rel=1e-6)
    near = np.abs(L) < 5.0
    assert np.abs(np.diff(L))[near[1:] & near[:-1]].max() < 0.4  # smooth to the eye
    ax = loop.plot(Figure().subplots())
    marks = {line.get_label(): line.get_xydata() for line in ax.get_lines() if str(line.get_label()).startswith("gain")}
    ((_, places),) = marks.items()
    assert places[:, 0] == pytest.approx([-1.0 / g for g in loop.gain_margin if 0.0 < g < np.inf])


def test_controls_of_an_overlay_are_not_cut_off():
    time, axes = 0.1 * np.arange(21), Figure().subplots(2, 1)
    for size in (1.0, 10.0, 0.1):
        run = bc.simulate_loop(fuzz.plant(), fuzz.controller(0.1), time, {"u1": np.full(21, size)}, sample_time=0.1)
        run.plot(axes)
    largest = 100.0 * np.abs(run.controls["u0"]).max()  # of the second run: the loop is linear
    low, high = axes[1].get_ylim()
    assert low < -largest < largest < high


def test_loop_plot_has_axes_for_each_unit():
    """No meters with meters per second squared; signals of a half have a root of two."""
    time, model = 0.01 * np.arange(50), bc.spray_boom(accelerometer_bandwidth_hz=20.0)
    half = ["outputs\n[m, orthonormal]", "accelerations\n[m/s², orthonormal]", "strokes\n[m, orthonormal]"]
    beam = ["outputs [rad]", "outputs [rad/s]", "outputs [m]", "moments [N m]", "accelerations [m/s²]"]
    yaw = bc.split_symmetric(model)[1]
    for plant, drive, wanted in (
        (yaw, "actuator_anti", half),
        (yaw.to_statespace(), "actuator_anti", ["outputs", "accelerations", "strokes"]),  # without units
        (bc.hub_beam(modes=1), "torque", beam),
    ):
        run = bc.simulate_loop(plant, None, time, {drive: np.sin(time)}, sample_time=0.01)
        assert [each.get_ylabel() for each in run.plot(Figure().subplots(len(wanted), 1))] == wanted
    moved = bc.forced_response(model, time, {"actuator_left": time, "cradle": time}, ["tip_left", "stroke_left"])
    assert [each.get_ylabel() for each in moved.plot(Figure())] == ["inputs [m]", "inputs [N]", "outputs [m]"]


def test_the_axis_of_singular_values_has_their_unit():
    model, grid = bc.spray_boom(), [1.0, 2.0]
    assert bc.sigma(model, grid).plot(Figure().subplots()).get_ylabel() == "singular values [m/m]"
    assert bc.sigma(bc.spray_boom(excitation="acceleration"), grid).magnitude_unit == "m per m/s^2"
    assert bc.sigma(model, grid, ["actuator_left", "cradle"]).magnitude_unit == "m per m or N"
    assert bc.sigma(bc.split_symmetric(model)[1], grid).magnitude_unit == "m/m"  # orthonormal on both sides
    assert bc.sigma(model.to_statespace(), grid).plot(Figure().subplots()).get_ylabel() == "singular values"
