"""Whatever users are handed survives pickle and deepcopy, and prints in a few lines that say what it is."""

import copy
import dataclasses
import functools
import multiprocessing
import pickle
import re
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import control
import numpy as np
import pytest

import boomctl as bc
from boomctl.exchange import ControllerNotes
from boomctl.reduction.result import ReductionError
from boomctl.rotating_beam.result import SimulationError
from boomctl.slew import SlewError, resolve, shaper
from boomctl.slew.least_time.arc_count import Overflows
from boomctl.slew.least_time.switching import SwitchesNotFound
from boomctl.slew.result import LimitsTooTight
from boomctl.studies.sweeps import FailedPoint
from tests import handed_out as one


def abs_of(x):
    return abs(x)


FACTORIES = {
    "BoomParameters": bc.BoomParameters,
    "SecondOrderModel": one.boom,
    "SecondOrderModel, by accuracy": lambda: bc.spray_boom(accuracy=0.01, band_hz=2.0),
    "SecondOrderModel, user's": one.mass,
    "Assembly": one.machine,
    "CrossSection": lambda: bc.structure.tube_section(0.06, 0.02, 0.002),
    "AffineFamily": one.family,
    "PolynomialFamily": lambda: one.hub_beam().family((0.0, 2.0)),
    "ScheduledController": one.drive,
    "Track": one.track,
    "PlatformMotion": one.motion,
    "TractorParameters": bc.boom.TractorParameters,
    "Footprint": bc.boom.Footprint,
    "SprayResult": one.spray,
    "FieldScene": bc.studies.FieldScene,
    "SuspensionDesign": lambda: bc.studies.SuspensionDesign(
        "mine", "of two springs", controller=one.suspension(), facts={"peak": "9.87 with its best dampers" * 20}
    ),
    "MachineResult": lambda: bc.studies.MachineDesign("mine", "a half", one.yaw(), one.suspension()).evaluate(),
    "SlewDesign": lambda: bc.studies.SlewDesign("mine", "a turn", one.hub_beam(), {"planned": one.slew()}),
    "SweepResult": lambda: bc.sweep(abs_of, {"x": [1.0, -2.0]}, units={"x": "m"}),
    "SweepResult, of arrays": lambda: bc.sweep(np.full, {"shape": 3, "fill_value": [1.0, 2.0]}),
    "FailedPoint": lambda: FailedPoint({"x": 1.0}, "ValueError: no", "trace"),
    "SigmaResult": lambda: bc.sigma(one.boom()),
    "SigmaResult, norm not yet computed": lambda: bc.sigma(one.boom(), one.OMEGA),
    "SigmaResult, of data": lambda: bc.sigma(one.boom().frequency_response(one.OMEGA)),
    "ModeTable": lambda: bc.mode_table(one.yaw()),
    "Margins": lambda: bc.margins(one.yaw(), one.suspension()),
    "RobustStability": lambda: bc.robust_stability(one.family(), one.suspension()),
    "StructuredMargin": lambda: bc.analysis.structured_margin(one.family(), one.suspension(), largest=1.2),
    "WorstCase": lambda: bc.worst_case(one.family(), one.suspension(), ["actuator_anti"], ["tip_anti"]),
    "ExactLoopStability": one.exact_loop,
    "MeasuredCurve": one.measured_curve,
    "MeasuredResponse": one.measured_response,
    "Identification": one.identified,
    "FitResult": one.fitted,
    "FitResult, not determined": lambda: bc.fit(
        bc.hub_beam, [0.46, 2.9], ["youngs_modulus", "second_moment"], bc.HubBeamParameters(), starts=1
    ),
    "ReductionResult": lambda: bc.reduce(one.yaw().select("actuator_anti", "tip_anti"), order=4),
    "ReductionResult, second-order": lambda: bc.reduce(
        one.yaw().select("actuator_anti", "tip_anti"), order=2, method="second-order"
    ),
    "LqrResult": lambda: bc.lqr(one.mass(), np.eye(2), np.eye(1)),
    "KalmanResult": lambda: bc.kalman(one.mass(), np.eye(2), np.eye(1)),
    "LqgResult": lambda: bc.lqg(one.mass(), np.eye(2), 1.0, np.eye(2), 1.0),
    "RecoveryResult": lambda: bc.synthesis.loop_transfer_recovery(
        one.mass(), np.eye(2), 1.0, np.eye(2), 1.0, strengths=[1.0, 100.0], band=(0.1, 10.0)
    ),
    "H2Result": lambda: bc.h2(one.generalized(), 1, 1),
    "HInfinityResult": one.h_infinity,
    "HInfinityResult, of a reduction": one.designed_on_a_reduction,
    "TuneResult": one.tuned,
    "ReducedController": lambda: bc.reduce_controller(one.generalized(), one.h_infinity().controller, order=1),
    "ControllerNotes": lambda: ControllerNotes({"tip": "m", "torque": ""}, {"norm": 1.0}, {"boomctl": "0"}),
    "CoulombFriction": lambda: bc.CoulombFriction(8.0),
    "LoopResult": one.loop,
    "ForcedResponse": lambda: bc.forced_response(one.mass(), {"force": np.ones(50)}, np.linspace(0.0, 5.0, 50)),
    "LoopResult, of a hub-beam": one.beam_loop,
    "BeamSensor": lambda: bc.BeamSensor("gauge", "strain", 0.5, 0.01),
    "HubBeamParameters": bc.HubBeamParameters,
    "AssumedModesBeam": one.hub_beam,
    "AssumedModesBeam, by accuracy": lambda: bc.hub_beam(accuracy=1e-3, manoeuvre=bc.spin_up(1.0, 2.0), time=3.0),
    "GeometricallyExactBeam, by accuracy": lambda: bc.hub_beam(accuracy=1e-5, manoeuvre=bc.spin_up(2.0, 4.0), time=5.0),
    "GeometricallyExactBeam": lambda: bc.hub_beam(model="geometrically-exact", modes=2),
    "SimulationResult": lambda: one.hub_beam().simulate(bc.spin_up(0.5, 5.0), np.linspace(0.0, 6.0, 50)),
    "SpinUp": lambda: bc.spin_up(2.8, 30.0),
    "SineTorque": lambda: bc.sine_torque(200.0, 10.0, 10.0),
    "Torque": lambda: bc.torque(np.sin),
    "Hold": bc.hold,
    "Free": bc.free,
    "SlewResult": one.slew,
    "TrackedSlew": one.tracked,
    "TrackingStudy": one.tracking_study,
    "SlewResult, of a StateSpace": one.linear_slew,
    "SlewComparison": one.comparison,
    "Shaper": lambda: shaper("ZV", 1.0, 0.0),
    "BodeResult": lambda: bc.bode(one.boom()),
    "NyquistResult": lambda: bc.nyquist(one.yaw(), one.suspension()),
    "TransientResult": lambda: bc.step(one.mass()),
    "PoleZeroResult": lambda: bc.pzmap(one.yaw()),
    "Comparison": lambda: bc.compare({"run": one.loop(), "loop": [one.mass(), bc.sigma(one.yaw())]}),
    "ModeShapes": lambda: one.boom().mode_shapes(5),
    "CampbellDiagram": lambda: one.hub_beam().campbell([0.0, 1.0, 4.0]),
}

# python-control prints these, and only pickling was mended
SYSTEMS = {
    "StateSpace": lambda: one.boom().to_statespace(),
    "StateSpace, of a hub-beam": lambda: one.hub_beam().linearize(),
    "StateSpace, user's": lambda: control.ss(-1.0, 1.0, 1.0, 0.0, inputs="u", outputs="y", name="lag"),
    "StateSpace, without states": lambda: control.ss([], [], [], [[2.0, 1.0]]),
    "NonlinearIOSystem": lambda: one.hub_beam().to_nlsys(),
    "FrequencyResponseData": lambda: one.boom().frequency_response(one.OMEGA),
}


# ten slews played back on three beams: 4 s; boxes, runs, and searches of models: a quarter to half a second each
SLOW = (
    "SlewComparison",
    "WorstCase",
    "AssumedModesBeam, by accuracy",
    "GeometricallyExactBeam, by accuracy",
    "HInfinityResult, of a reduction",
)


_made_once = functools.cache(lambda make: functools.cache(make))


def _parametrised(factories):
    marks = dict.fromkeys(SLOW, pytest.mark.slow)
    return pytest.mark.parametrize(
        "make", [pytest.param(_made_once(make), id=name, marks=marks.get(name, ())) for name, make in factories.items()]
    )


def alike(a, b):
    """Return whether two objects hold the same numbers and names, all the way down."""
    if type(a) is not type(b):
        return False
    if isinstance(a, np.ndarray):
        return np.array_equal(a, b, equal_nan=a.dtype.kind in "fc")
    if isinstance(a, dict):
        return list(a) == list(b) and all(alike(a[key], b[key]) for key in a)
    if isinstance(a, (tuple, list)):
        return len(a) == len(b) and all(map(alike, a, b))
    if isinstance(a, control.NonlinearIOSystem):
        hidden = ("updfcn", "outfcn")
        return alike(*({key: part for key, part in vars(x).items() if key not in hidden} for x in (a, b)))
    if isinstance(a, float):
        return a == b or (a != a and b != b)
    if dataclasses.is_dataclass(a):
        given = [field.name for field in dataclasses.fields(a)]
        return all(alike(getattr(a, name), getattr(b, name)) for name in given)
    return True


@_parametrised(FACTORIES | SYSTEMS)
def test_it_survives_pickle_and_deepcopy(make):
    given = make()
    stored = pickle.dumps(given)
    assert len(stored) < 500_000
    for other in (pickle.loads(stored), copy.deepcopy(given)):
        assert other is not given or dataclasses.is_dataclass(given)
        assert alike(given, other)
        assert alike(other, given)


def _parts(given, depth):
    """Return objects of boomctl that attributes of one lead to."""
    if isinstance(given, (tuple, list)):
        return [part for entry in given[:2] for part in _parts(entry, depth)]
    if isinstance(given, dict):
        return _parts(list(given.values()), depth)
    if not type(given).__module__.startswith("boomctl"):
        return []
    inside = dataclasses.fields(given) if depth and dataclasses.is_dataclass(given) else ()
    deeper = [getattr(given, field.name) for field in inside if not field.name.startswith("_")]
    return [given, *(part for entry in deeper for part in _parts(entry, depth - 1))]


@_parametrised(FACTORIES | {"SecondOrderModel, large": lambda: bc.spray_boom(elements=100)})
def test_it_says_in_a_few_lines_what_it_is_and_so_does_what_its_attributes_lead_to(make):
    given = make()
    assert repr(given).startswith(type(given).__name__)
    for part in {id(part): part for part in [given, *_parts(given, depth=2)]}.values():
        lines = repr(part).splitlines()
        assert 1 <= len(lines) <= 5, type(part)
        assert max(map(len, lines)) <= 100, type(part)
        assert " object at 0x" not in repr(part)


@_parametrised(FACTORIES)
def test_what_is_asked_by_name_offers_its_names(make):
    """In brackets: IPython completes what it offers, and each is an answer."""
    for part in _parts(make(), depth=2):
        if getattr(getattr(part, "__getitem__", None), "__module__", "").startswith("boomctl"):
            offered = part._ipython_key_completions_()
            assert offered
            assert all(part[name] is not None for name in offered)


TABLES = (
    "BoomParameters",
    "TractorParameters",
    "HubBeamParameters",
    "ModeTable",
    "Margins",
    "SlewComparison",
)


@_parametrised({name: FACTORIES[name] for name in TABLES})
def test_what_is_a_table_is_one_in_a_notebook(make):
    html = make()._repr_html_()
    assert html.startswith("<table>")
    assert html.count("<tr>") == html.count("</tr>") > 2


ERRORS = (
    SlewError("no slew"),
    LimitsTooTight("tip_limit binds", 0.3),
    Overflows("no bounds"),
    SwitchesNotFound("none"),
    bc.SynthesisError("not stabilisable"),
    ReductionError("not verified"),
    SimulationError("no solution"),
)


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: type(error).__name__)
def test_errors_survive_pickle_or_a_pool_of_processes_breaks(error):
    other = pickle.loads(pickle.dumps(error))
    assert type(other) is type(error)
    assert str(other) == str(error)
    assert vars(other) == vars(error)


def test_parameters_print_as_python_that_makes_them_again():
    p = bc.BoomParameters(spring_stiffness=900.0, cradle_damping=1.0 / 3.0)
    assert eval(repr(p), {"BoomParameters": bc.BoomParameters}) == p
    t = bc.boom.TractorParameters(mass=5432.1)
    assert repr(t) == "TractorParameters(mass=5432.1)"


def test_what_is_computed_when_asked_for_is_so_after_pickling_too():
    s = bc.sigma(one.boom(), one.OMEGA)
    stored = pickle.loads(pickle.dumps(s))
    assert "computed when .peak is asked for" in repr(stored)
    assert stored.peak == s.peak
    assert f"peak {s.peak:.6g}" in repr(stored)


@pytest.mark.slow  # replays on two other models, two slews: 5 s
def test_a_stored_slew_is_replayed_and_solved_again():
    slew = pickle.loads(pickle.dumps(one.slew()))
    assert slew.replays == one.slew().replays
    assert resolve(slew, angle=1.5).cost == pytest.approx(resolve(one.slew(), angle=1.5).cost, rel=1e-9)


def test_singular_values_are_compared_without_an_error():
    s = bc.sigma(one.boom(), one.OMEGA)
    assert s == s
    assert s != bc.sigma(one.boom(), one.OMEGA)  # as systems of python-control: the same object or not
    assert len({s, s}) == 1


def test_a_copied_system_stands_alone():
    first = control.ss(-1.0, 1.0, 1.0, 0.0)
    second = copy.deepcopy(first)
    first.A[0, 0] = -5.0
    assert second.dynamics(0.0, [1.0], [0.0]) == pytest.approx([-1.0])


@pytest.mark.slow  # a new process imports python-control: 3 s
def test_systems_and_results_go_to_a_new_process_and_back():
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=spawn) as pool:
        norm = pool.submit(bc.hinf_norm, one.mass().to_statespace())
        reduced = pool.submit(bc.reduce, one.yaw().select("actuator_anti", "tip_anti"), 4)
        assert norm.result() == bc.hinf_norm(one.mass().to_statespace())
        assert reduced.result().system.nstates == 4
        assert reduced.result().system.output_labels == ["tip_anti"]


def test_python_control_is_imported_where_its_systems_learn_to_pickle():
    package = Path(bc.__file__).parent
    allowed = package / "lti" / "python_control.py"
    for path in set(package.rglob("*.py")) - {allowed, *(package / "lab" / "benchmark").rglob("*.py")}:
        text = re.sub(r"if TYPE_CHECKING:\n(?:(?: .*)?\n)+", "", path.read_text())
        assert not re.search(r"^ *(import control$|from control import)", text, re.MULTILINE), path


MADE_WHEN_READ = {
    "ReductionResult": ("system",),
    "LqrResult": ("controller", "closed_loop", "effort"),
    "KalmanResult": ("estimator",),
    "LqgResult": ("controller", "closed_loop"),
    "H2Result": ("controller", "closed_loop"),
    "HInfinityResult": ("controller", "closed_loop"),
    "TuneResult": ("controller", "closed_loop"),
    "ReducedController": ("controller", "closed_loop"),
}


@pytest.mark.parametrize("name", MADE_WHEN_READ)
def test_systems_of_a_result_are_made_once_when_read_and_survive_pickle_before_and_after(name):
    result = FACTORIES[name]()
    fresh, printed = pickle.loads(pickle.dumps(result)), repr(result)
    for system in MADE_WHEN_READ[name]:
        made = getattr(result, system)
        assert isinstance(made, control.StateSpace)
        assert getattr(result, system) is made
        for again in (getattr(fresh, system), getattr(pickle.loads(pickle.dumps(result)), system)):
            for kind in ("A", "B", "C", "D"):
                np.testing.assert_array_equal(getattr(again, kind), getattr(made, kind))
            assert (again.name, again.input_labels, again.output_labels) == (
                made.name,
                made.input_labels,
                made.output_labels,
            )
    assert repr(result) == repr(fresh) == printed
