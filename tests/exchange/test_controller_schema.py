"""Controllers read from files that are not whole: refused in one line, or read as they stand."""

import copy
import json
import math
import sys

import control
import numpy as np
import pytest
from hypothesis import given

import boomctl as bc
from tests.exchange.cases import controller
from tests.profiles import examples
from tests.strategies import seeds

DEEP = 100_000  # levels of nesting
_VALUES = [None, True, False, 0, 1, -1, 1.5, math.nan, math.inf, 10**400, "1", "", "NaN", [], [[]], {}, {"a": 1}, [1], [[1]],
           ["a"], [True], [[True]], [["1"]], "x" * 300, [[[1.0]]], 1e308, "\ud800", "\0", "y.0", "y_0"]  # fmt: skip


def _written(folder, rng):
    n, m, p = int(rng.integers(0, 4)), int(rng.integers(1, 4)), int(rng.integers(1, 4))
    K = controller(int(rng.integers(1000)), n, m, p, [0.0, 0.01, True][rng.integers(3)])
    bc.write_controller(K, folder / "k.json", certificate={"bound": 1.0})
    return json.loads((folder / "k.json").read_text())


def _places(held, way=()):
    if way:
        yield way
    for key in held if isinstance(held, dict) else range(len(held)) if isinstance(held, list) else ():
        yield from _places(held[key], (*way, key))


def _changed(held, rng):
    """Return what a file holds with one value, list or name replaced, left out, flattened or nested."""
    ways = list(_places(held))
    *way, last = ways[rng.integers(len(ways))]
    for key in way:
        held = held[key]
    kind = rng.integers(6)
    if kind == 0:
        del held[last]
    elif kind == 2 and isinstance(held[last], list) and all(isinstance(row, list) for row in held[last]):
        held[last] = [value for row in held[last] for value in row]
    elif kind == 3:
        held[last] = [held[last]]
    else:
        held[last] = copy.deepcopy(_VALUES[rng.integers(len(_VALUES))])


def _number(value):
    return type(value) in (int, float) and abs(value) <= sys.float_info.max


def _whole(held):
    """Return whether a file's content is that of a controller, written down apart from the package."""
    try:
        kinds = [held[kind] for kind in ("inputs", "outputs", "states")]
        m, p, n = map(len, kinds)
        shapes = {"A": (n, n), "B": (n, m), "C": (p, n), "D": (p, m)}
        time = held["sample_time"]
        return (
            (held["format"], held["version"]) == ("boomctl controller", 1)
            and all(type(kind) is list and all(type(name) is str for name in kind) for kind in kinds)
            and all(len({name.replace(".", "_") for name in kind}) == len(kind) for kind in kinds)
            and all(type(held[letter]) is list and len(held[letter]) == shape[0] for letter, shape in shapes.items())
            and all(type(row) is list and len(row) == shapes[letter][1] for letter in shapes for row in held[letter])
            and all(_number(value) for letter in shapes for row in held[letter] for value in row)
            and (time is True or (_number(time) and 0.0 <= time <= 1e100))
            and all(type(held.get(key, {})) is dict for key in ("units", "certificate", "provenance"))
            and all(type(unit) is str for unit in held.get("units", {}).values())
        )
    except (KeyError, TypeError):
        return False


@given(seed=seeds)
@examples(500)
def test_a_file_is_a_controller_or_is_refused_in_one_line(tmp_path_factory, seed):
    folder, rng = tmp_path_factory.mktemp("json"), np.random.default_rng(seed)
    held = _written(folder, rng)
    for _ in range(int(rng.integers(1, 3))):
        _changed(held, rng)
    file = folder / "k.json"
    file.write_text(json.dumps(held))
    if not _whole(held):
        with pytest.raises(ValueError) as caught:  # noqa: PT011 - the message is looked at below
            bc.read_controller(file)
        assert str(caught.value).startswith(str(file))
        assert "\n" not in str(caught.value)
        assert len(str(caught.value)) < 300 + len(str(file))
        return
    K = bc.read_controller(file)
    assert bc.exchange.read_controller_metadata(file).certificate == held.get("certificate", {})
    for letter in "ABCD":
        found = getattr(K, letter)
        np.testing.assert_array_equal(found, np.array(held[letter], dtype=float).reshape(found.shape))
    assert K.input_labels == [name.replace(".", "_") for name in held["inputs"]]


@pytest.mark.parametrize(
    ("key", "deep"), [("A", "[" * DEEP + "]" * DEEP), ("certificate", '{"a":' * DEEP + "1" + "}" * DEEP)]
)
def test_read_controller_nested_too_deep_raises(tmp_path, key, deep):
    held = _written(tmp_path, np.random.default_rng(0))
    held[key] = "HERE"
    (tmp_path / "k.json").write_text(json.dumps(held).replace('"HERE"', deep))
    with pytest.raises(ValueError, match="nested too deep"):
        bc.read_controller(tmp_path / "k.json")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"B": np.ones((1, 4))}, "B: expected 2 rows of 2 numbers, as there are names, got 1 of 4"),
        ({"A": "abcd"}, "A = .*: expected a list of rows of numbers"),
        ({"A": 1j * np.eye(2)}, "A = .*: expected a list of rows of numbers"),
        ({"D": np.array([[np.inf, 0.0]])}, "expected finite numbers in D, got inf"),
        ({"sample_time": np.inf}, "sample_time = inf: expected a finite number"),
        ({"sample_time": "soon"}, "sample_time = .*: expected a real number"),
        ({"inputs": np.array([["y", "y"]], dtype=object)}, "inputs = .*: expected names that are there once"),
        ({"inputs": np.array([[1.0, 2.0]])}, "inputs = .*: expected a list of names"),
    ],
)
def test_a_mat_file_that_is_no_controller_is_refused(tmp_path, change, message):
    from scipy.io import savemat

    held = {"A": -np.eye(2), "B": np.ones((2, 2)), "C": np.ones((1, 2)), "D": np.zeros((1, 2)), "sample_time": 0.0}
    savemat(tmp_path / "k.mat", held)
    assert bc.read_controller(tmp_path / "k.mat").input_labels == ["i0", "i1"]
    savemat(tmp_path / "k.mat", held | change)
    with pytest.raises(ValueError, match=message):
        bc.read_controller(tmp_path / "k.mat")


def test_a_file_whose_name_has_dots_is_read(tmp_path):
    K = control.ss([], [], [], [[1.0]], inputs="y", outputs="u")
    bc.write_controller(K, tmp_path / "yaw.v2.json")
    assert bc.read_controller(tmp_path / "yaw.v2.json").name == "yaw_v2"
