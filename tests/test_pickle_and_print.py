"""Whatever users are handed survives pickle and deepcopy, and prints in a few lines that say what it is."""

import copy
import dataclasses
import functools
import pickle
import re
import sys

import control
import numpy as np
import pytest

import boomctl as bc
from boomctl.exceptions import LimitsTooTightError
from boomctl.printing import percent
from boomctl.slew import replan
from tests import handed_out as one
from tests.handed_out import FACTORIES

# python-control prints these, and only pickling was mended
SYSTEMS = {
    "StateSpace": lambda: one.boom().to_statespace(),
    "StateSpace, of a hub-beam": lambda: one.hub_beam().linearize(),
    "StateSpace, user's": lambda: control.ss(-1.0, 1.0, 1.0, 0.0, inputs="u", outputs="y", name="lag"),
    "StateSpace, without states": lambda: control.ss([], [], [], [[2.0, 1.0]]),
    "NonlinearIOSystem": lambda: one.hub_beam().to_nlsys(),
    "FrequencyResponseData": lambda: one.boom().frequency_response(one.OMEGA),
}


# boxes, runs, and searches of models: a quarter to half a second each
SLOW = (
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
def test_repr_is_short_and_names_in_brackets_are_offered(make):
    given = make()
    assert repr(given).startswith(type(given).__name__)
    for part in {id(part): part for part in [given, *_parts(given, depth=2)]}.values():
        lines = repr(part).splitlines()
        assert 1 <= len(lines) <= 5, type(part)
        assert max(map(len, lines)) <= 100, type(part)
        assert " object at 0x" not in repr(part)
        if getattr(getattr(part, "__getitem__", None), "__module__", "").startswith("boomctl"):
            offered = part._ipython_key_completions_()  # which IPython completes in brackets
            assert offered
            assert all(part[name] is not None for name in offered)
    if html := getattr(given, "_repr_html_", lambda: None)():
        assert html.startswith("<table>")
        assert html.count("<tr>") == html.count("</tr>") > 0


@pytest.mark.parametrize("package", [bc, bc.studies], ids=["boomctl", "studies"])
def test_package_is_pickled_by_name(package):
    """As functions of a script that read it are sent to the processes of a sweep."""
    assert pickle.loads(pickle.dumps(package)) is package


@_parametrised(FACTORIES)
def test_results_say_how_the_search_ended_and_make_tables(make, monkeypatch):
    result = make()
    if hasattr(result, "success"):
        assert result.success is True
        assert re.fullmatch(r"\S.*[^.\s]", result.message)
        assert all((getattr(result, word, None) or 1.0) > 0 for word in ("nit", "nfev", "elapsed"))
    if getattr(getattr(result, "to_pandas", None), "__module__", "").startswith("boomctl"):
        pytest.importorskip("pandas")
        frame = result.to_pandas()
        assert frame.size
        if hasattr(result, "time"):
            assert (frame.index.name, list(frame.index)) == ("time [s]", result.time.tolist())
            assert all(np.array_equal(frame[column], result[column]) for column in frame)
            assert frame.attrs["units"] == getattr(result, "units", {})
        monkeypatch.setitem(sys.modules, "pandas", None)
        with pytest.raises(ImportError, match=r"pandas is not installed: pip install 'boomctl\[tables\]'"):
            result.to_pandas()


def test_slew_error_survives_pickle_with_its_limit():
    error = LimitsTooTightError("tip_limit binds", 0.3)
    other = pickle.loads(pickle.dumps(error))
    assert (str(other), vars(other)) == (str(error), vars(error))


def test_parameters_print_as_python_that_makes_them_again():
    p = bc.BoomParameters(spring_stiffness=900.0, cradle_damping=1.0 / 3.0)
    assert eval(repr(p), {"BoomParameters": bc.BoomParameters}) == p
    t = bc.boom.TractorParameters(mass=5432.1)
    assert repr(t) == "TractorParameters(mass=5432.1)"


def test_lazy_attributes_after_pickling():
    s = bc.sigma(one.boom(), one.OMEGA)
    stored = pickle.loads(pickle.dumps(s))
    assert "computed on first access to .peak" in repr(stored)
    assert stored.peak == s.peak
    assert f"peak {s.peak:.6g}" in repr(stored)


@pytest.mark.slow  # replays on two other models, two slews: 5 s
def test_a_stored_slew_is_replayed_and_solved_again():
    slew = pickle.loads(pickle.dumps(one.slew()))
    assert slew.replay() == one.slew().replay()
    assert replan(slew, angle=1.5).cost == pytest.approx(replan(one.slew(), angle=1.5).cost, rel=1e-9)


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


@_parametrised(FACTORIES)
def test_result_systems_cached_and_pickled(make):
    result = make()
    fresh, printed = pickle.loads(pickle.dumps(result)), repr(result)
    for name in ("system", "controller", "closed_loop", "control_loop", "estimator"):
        system = getattr(result, name, None)
        if isinstance(system, control.StateSpace):
            assert getattr(result, name) is system
            for again in (fresh, pickle.loads(pickle.dumps(result))):
                assert alike(getattr(again, name), system)
    assert repr(result) == repr(fresh) == printed


@pytest.fixture
def no_proofs(monkeypatch):
    """Let proofs raise."""
    from boomctl.lti.inequality import Inequality
    from boomctl.lti.proof import Exact

    def started(*_, **__):
        raise AssertionError("a proof was started")

    monkeypatch.setattr(Exact, "of", started)
    monkeypatch.setattr(Inequality, "of", started)


def test_printing_drawing_comparing_and_searching_start_no_proof(no_proofs):
    rng = np.random.default_rng(1)
    A, B = np.diag(-rng.uniform(0.1, 10.0, 20)), rng.normal(size=(20, 12))
    flat = control.ss(A, B, B.T, 0.0)  # too many signals for the sum over the modes
    curves = bc.sigma(flat)
    for result in (bc.hinf_norm(flat), bc.h2_norm(one.mass()), curves, bc.margins(one.yaw(), one.suspension())):
        assert repr(result)
        assert str(result)
        assert alike(pickle.loads(pickle.dumps(result)), result)
    assert bc.hinf_norm(flat).status == "verified"
    curves.plot()
    compared = bc.compare({"flat": flat, "half": control.ss(A, 0.5 * B, B.T, 0.0)})
    compared.to_dict()
    compared.plot()
    print(compared, bc.compare_sigma({"flat": flat}))
    bc.h_infinity(one.generalized(), 1, 1)
    bc.reduce(one.boom().select(("actuator_left",), ("tip_left",)), max_error=10.0)
    one.tuned.__wrapped__()
    with pytest.raises(AssertionError, match="proof"):
        _ = bc.hinf_norm(flat).certified


def test_percent_of_large_fraction_has_no_exponent():
    assert [percent(x) for x in (0.0085, 0.0996, 2.5, 200.0)] == ["0.85 %", "10 %", "250 %", "20,000 %"]
