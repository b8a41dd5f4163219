"""Sweeps: one table for all backends; failures, interrupts and dead workers lose no finished point."""

import inspect
import json
import linecache
import os
import signal
import subprocess
import sys
import threading
import time
import warnings
from functools import cache, cached_property, partial
from itertools import product
from pathlib import Path

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.studies.sweeps import SweepResult, SweepWarning
from boomctl.studies.sweeps import checkpoint as checkpoint_module
from tests.profiles import examples

GRID = {"x": [1.0, 2.0, 3.0], "y": [0, 1], "z": 5.0}


def numbers(x, y, z):
    """Return a number, an array and a word."""
    return {"sum": x + y + z, "powers": np.array([x, y, z]) ** 0.5, "who": f"{x:g}/{y}"}


def picky(x, y, z=0.0):
    if x == 2.0 and y == 1:
        raise ValueError(f"not at {x}")
    return x + y + z


def noted(x, folder):
    """Return a number, and leave a note of the call."""
    with open(Path(folder) / "calls", "a") as file:
        file.write(f"{x}\n")
    return {"square": x**2}


def ending(x):
    """End what runs it, as a script does, at x = 2."""
    if x == 2:
        raise SystemExit("no such boom")
    return x**2


def deadly(x, folder):
    """Kill the process at x = 2 once the other points are written."""
    if x == 2:
        time.sleep(1.0)
        os.kill(os.getpid(), signal.SIGKILL)
    return x**2


def threads(x):
    from threadpoolctl import threadpool_info

    np.ones(2) @ np.ones(2)
    return max(pool["num_threads"] for pool in threadpool_info())


def calls(folder):
    return sorted((Path(folder) / "calls").read_text().split())


def same(a, b):
    """Return whether two results hold the same, to the last bit."""
    if a.points != b.points or a.columns != b.columns:
        return False
    return all(np.array_equal(a[name], b[name]) for name in a.columns)


def test_a_grid_is_every_value_with_every_other():
    found = bc.sweep(numbers, GRID)
    assert found.shape == (3, 2)
    assert found["sum"].tolist() == [[x + y + 5.0 for y in GRID["y"]] for x in GRID["x"]]
    assert found["powers"].shape == (3, 2, 3)
    rows = found.table
    assert [(row["x"], row["y"]) for row in rows] == list(product(GRID["x"], GRID["y"]))
    assert all(row["who"] == f"{row['x']:g}/{row['y']}" and row["z"] == 5.0 for row in rows)
    assert len(found) == 6
    assert found.failures == ()
    assert found.swept == ("x", "y")


def test_zipped_values_go_together():
    found = bc.sweep(numbers, {"x": [1.0, 2.0], "y": range(2), "z": 0.0}, combine="zip")
    assert found["sum"].tolist() == [1.0, 3.0]
    assert [list(point.values()) for point in found.points] == [[1.0, 0, 0.0], [2.0, 1, 0.0]]


def test_objects_go_by_their_names():
    booms = {"soft": bc.BoomParameters(spring_stiffness=550.0), "stiff": bc.BoomParameters(spring_stiffness=2200.0)}
    found = bc.sweep(lambda boom: boom.spring_stiffness, {"boom": booms})
    assert found.labels["boom"] == ("soft", "stiff")
    assert found["value"].tolist() == [550.0, 2200.0]
    assert bc.sweep(lambda boom: 1.0, {"boom": list(booms.values())}).labels["boom"] == (0, 1)
    assert bc.sweep(lambda boom: 1.0, {"boom": booms["soft"]}).points == ({"boom": "BoomParameters"},)
    machines = [bc.BoomParameters().scaled(length=9.0), bc.HubBeamParameters(length=7.0)]
    assert bc.sweep(lambda machine: machine.length, {"machine": machines})["value"].tolist() == [9.0, 7.0]


@pytest.mark.parametrize(
    ("changes", "refused"),
    [
        ({"over": {}}, ValueError),
        ({"over": {"x": [], "y": 1, "z": 1}}, ValueError),
        ({"over": {"x": [1.0, 1.0], "y": 1, "z": 1}}, ValueError),
        ({"over": {"x": [float("nan")], "y": 1, "z": 1}}, ValueError),
        ({"over": {"x": range(2000), "y": range(2000), "z": 1}}, ValueError),
        ({"over": {"x": [1, 2], "y": [1], "z": 1}, "combine": "zip"}, ValueError),
        ({"combine": "zipped"}, ValueError),
        ({"over": {"x": 1.0, "speed": [1.0]}}, TypeError),
        ({"over": [1.0]}, TypeError),
        ({"over": {1: [1.0]}}, TypeError),
        ({"function": 3.0}, TypeError),
        ({"n_jobs": "two"}, TypeError),
        ({"n_jobs": 0}, ValueError),
        ({"n_jobs": 2, "backend": "tow"}, ValueError),
        ({"backend": 2}, TypeError),
        ({"chunk": 0}, ValueError),
        ({"units": {"x": 1.0}}, TypeError),
        ({"checkpoint": "."}, ValueError),
        ({"checkpoint": 3}, TypeError),
        ({"progress": 3}, TypeError),
    ],
)
def test_what_is_no_sweep_is_refused(changes, refused):
    with pytest.raises(refused) as error:
        bc.sweep(**{"function": numbers, "over": GRID, **changes})
    assert "\n" not in str(error.value)


def test_a_point_that_fails_is_told_and_the_others_are_kept():
    with pytest.warns(SweepWarning, match=r"1 of 6 points failed.*x = 2, y = 1, z = 5: ValueError: not at 2.0"):
        found = bc.sweep(picky, GRID)
    (failure,) = found.failures
    assert failure.point == {"x": 2.0, "y": 1, "z": 5.0}
    assert "in picky" in failure.trace
    assert np.argwhere(np.isnan(found["value"])).tolist() == [[1, 1]]
    assert found.table[3]["value"] is None
    assert "1 failed: x = 2, y = 1" in repr(found)


def test_a_sweep_that_fails_everywhere_says_why():
    with pytest.raises(RuntimeError, match=r"failed at every point; at x = 2, y = 1: ValueError: not at 2\.0"):
        bc.sweep(picky, {"x": 2.0, "y": 1})


def test_an_answer_is_no_parameter():
    found = bc.sweep(lambda x: {"x": 1.0}, {"x": [1.0]})
    with pytest.raises(ValueError, match="'x', which is swept"):
        found.table  # noqa: B018


@pytest.mark.parametrize("backend", ["threading", pytest.param("loky", marks=pytest.mark.slow)])
@pytest.mark.parametrize("chunk", [1, 4])
def test_sweep_backends_return_same_table(backend, chunk):
    assert same(bc.sweep(numbers, GRID, n_jobs=2, backend=backend, chunk=chunk), bc.sweep(numbers, GRID))


def test_sweep_failures_in_workers_same_as_in_process():
    with pytest.warns(SweepWarning):
        here = bc.sweep(picky, GRID)
    with pytest.warns(SweepWarning):
        there = bc.sweep(picky, GRID, n_jobs=2)
    assert [f.text for f in here.failures] == [f.text for f in there.failures]
    assert "in picky" in there.failures[0].trace


@pytest.mark.slow  # starts workers twice
def test_sweep_processes_take_local_function():
    assert bc.sweep(lambda x: x**2, {"x": [1.0, 2.0]}, n_jobs=2)["value"].tolist() == [1.0, 4.0]
    lock = threading.Lock()
    with pytest.raises(TypeError, match=r"must be picklable with n_jobs = 2.*backend='threading'"):
        bc.sweep(lambda x: lock and x, {"x": [1.0, 2.0]}, n_jobs=2)
    assert bc.sweep(lambda x: lock and x, {"x": [1.0]}, n_jobs=2, backend="threading")["value"].tolist() == [1.0]


@pytest.mark.parametrize("n_jobs", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_sweep_exit_of_function_fails_one_point(n_jobs):
    with pytest.warns(SweepWarning):
        found = bc.sweep(ending, {"x": [1, 2, 3]}, n_jobs=n_jobs)
    assert [f.error for f in found.failures] == ["SystemExit: no such boom"]
    assert found["value"].tolist()[::2] == [1, 9]


@pytest.mark.slow
def test_sweep_workers_use_one_blas_thread():
    assert bc.sweep(threads, {"x": [1, 2]}, n_jobs=2)["value"].tolist() == [1, 1]


class Recorder:
    """A function that leaves a note of its calls and may be interrupted."""

    stop_at = None

    def __init__(self, folder):
        self.folder = folder

    def __call__(self, x):
        if (self.folder / "stop").exists() and x == 3:
            raise KeyboardInterrupt
        return noted(x, self.folder)


def test_sweep_interrupted_resumes_to_last_bit(tmp_path):
    file, over, function = tmp_path / "sweep.jsonl", {"x": np.sqrt(range(6))}, Recorder(tmp_path)
    over["x"][3] = 3.0
    (tmp_path / "stop").touch()
    with pytest.raises(KeyboardInterrupt):
        bc.sweep(function, over, checkpoint=file)
    (tmp_path / "stop").unlink()
    assert len(calls(tmp_path)) == 3
    with open(file, "a") as cut_off:
        cut_off.write('{"point": {"x": 3, "fold')
    found = bc.sweep(function, over, checkpoint=file)
    assert (found.resumed, len(calls(tmp_path))) == (3, 6)
    assert same(found, bc.sweep(function, over))
    more = bc.sweep(function, {"x": [5.5, 3.0, 9.0]}, checkpoint=file)
    assert more.resumed == 1
    assert more["square"].tolist() == [5.5**2, 9.0, 81.0]


class Times:
    def __init__(self, factor):
        self.factor = factor

    def of(self, x):
        return {"value": self.factor * x}

    def __call__(self, x):
        return self.of(x)


def times(factor):
    return lambda x: {"value": factor * x}


def with_default(factor):
    def own(x, by=factor):
        return {"value": by * x}

    return own


def with_nested(factor):
    inner = times(factor)
    return lambda x: max(inner(y)["value"] for y in (x,))


def local_times(factor):
    class Local:
        def __init__(self, factor):
            self.factor = factor

        def of(self, x):
            return {"value": self.factor * x}

    return Local(factor).of


def class_attribute(factor):
    class Local:
        by = factor

        @staticmethod
        def of(x):
            return {"value": Local.by * x}

    return Local.of


def with_property(factor, kind):
    class Local:
        @kind
        def by(self):
            return factor

        def of(self, x):
            return {"value": self.by * x}

    return Local().of


def with_methods(factor):
    inner = Times(factor)
    chosen = [inner.of]
    return lambda x: chosen[0](x)


def cached_times(factor):
    return cache(times(factor))


def scaled(x, factor):
    return {"value": factor * x}


FACTOR = 1.0


def times_global(x):
    return {"value": FACTOR * x}


def times_nested_global(x):
    return {"value": max(FACTOR * y for y in (x,))}


MADE = {
    "method": lambda f: Times(f).of,
    "object": Times,
    "closure": times,
    "default": with_default,
    "nested closure": with_nested,
    "local class": local_times,
    "class attribute": class_attribute,
    "partial": lambda f: partial(scaled, factor=f),
    "cache": cached_times,
    "property": lambda f: with_property(f, property),
    "cached property": lambda f: with_property(f, cached_property),
    "method in a list": with_methods,
}


@pytest.mark.parametrize("made", MADE.values(), ids=MADE)
def test_checkpoint_of_other_function_raises(tmp_path, made):
    over, file = {"x": [1.0, 2.0]}, tmp_path / "sweep.jsonl"
    for resumed in (0, 2):  # an equal function, created again, is the same
        found = bc.sweep(made(2.0), over, checkpoint=file)
        assert (found["value"].tolist(), found.resumed) == ([2.0, 4.0], resumed)
    before = file.read_bytes()
    with pytest.raises(ValueError, match=r"`checkpoint` must be a file of the function .* as it is now"):
        bc.sweep(made(3.0), over, checkpoint=file)
    assert file.read_bytes() == before


@pytest.mark.parametrize("function", [times_global, times_nested_global])
def test_checkpoint_after_changed_global_raises(tmp_path, monkeypatch, function):
    over, file = {"x": [1.0]}, tmp_path / "sweep.jsonl"
    bc.sweep(function, over, checkpoint=file)
    assert bc.sweep(function, over, checkpoint=file).resumed == 1
    monkeypatch.setitem(globals(), "FACTOR", 2.0)
    with pytest.raises(ValueError, match="must be a file of the function"):
        bc.sweep(function, over, checkpoint=file)


def cell(source, namespace, number):
    """Run a cell of a notebook, whose source IPython stores for `inspect`."""
    name = f"<ipython-input-{number}>"
    linecache.cache[name] = (len(source), None, source.splitlines(keepends=True), name)
    exec(compile(source, name, "exec"), namespace)


def test_checkpoint_after_edited_notebook_cell_raises(tmp_path):
    notebook, over, file = {"__name__": "__main__"}, {"x": [1.0]}, tmp_path / "sweep.jsonl"
    cell("def helper(x):\n    return 2 * x\n", notebook, 1)
    cell("def f(x):\n    return helper(x)\n", notebook, 2)
    assert inspect.getsource(notebook["f"]).endswith("helper(x)\n")
    bc.sweep(notebook["f"], over, checkpoint=file)
    cell("def f(x):\n    return helper(x)\n", notebook, 3)  # run again
    assert bc.sweep(notebook["f"], over, checkpoint=file).resumed == 1
    for number, edited in enumerate(["def helper(x):\n    return 3 * x\n", "def f(x):\n    return helper(x) + 1\n"], 4):
        other = dict(notebook)
        cell("def helper(x):\n    return 2 * x\ndef f(x):\n    return helper(x)\n", other, 10)
        cell(edited, other, number)
        with pytest.raises(ValueError, match="must be a file of the function"):
            bc.sweep(other["f"], over, checkpoint=file)


def test_checkpoint_without_source_compares_code(tmp_path):
    spaces = [{}, {}]
    for space, body in zip(spaces, ("x + 1", "x + 2"), strict=True):
        exec(f"f = lambda x: {body}", space)
    bc.sweep(spaces[0]["f"], {"x": [1.0]}, checkpoint=tmp_path / "s")
    assert bc.sweep(spaces[0]["f"], {"x": [1.0]}, checkpoint=tmp_path / "s").resumed == 1
    with pytest.raises(ValueError, match="must be a file of the function"):
        bc.sweep(spaces[1]["f"], {"x": [1.0]}, checkpoint=tmp_path / "s")


def imports_helper(x):
    import checkpoint_helper

    return {"value": checkpoint_helper.by() * x}


def test_checkpoint_after_edited_module_raises(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "checkpoint_helper.py").write_text("def by():\n    return 2.0\n")
    for resumed in (0, 1):
        assert bc.sweep(imports_helper, {"x": [1.0]}, checkpoint=tmp_path / "s").resumed == resumed
    (tmp_path / "checkpoint_helper.py").write_text("def by():\n    return 3.0\n")
    with pytest.raises(ValueError, match="must be a file of the function"):
        bc.sweep(imports_helper, {"x": [1.0]}, checkpoint=tmp_path / "s")
    monkeypatch.delitem(sys.modules, "checkpoint_helper")


def script(tmp_path, name, body):
    path = tmp_path / name
    path.write_text(f"import boomctl as bc, helper\n{body}\n")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path]), "PYTHONHASHSEED": "random"}
    return subprocess.run([sys.executable, path], capture_output=True, text=True, env=environment, check=False)


@pytest.mark.slow  # six processes
def test_checkpoint_of_two_scripts_with_one_main_f(tmp_path):
    (tmp_path / "helper.py").write_text("def by():\n    return 2.0\n")
    text = "def f(x):\n    return {} * x if 'a' in {{'a', 'b', 'c'}} else None\n"
    run = f"print(bc.sweep(f, {{'x': [1.0]}}, checkpoint={str(tmp_path / 's.jsonl')!r}).resumed)"
    first = text.format("helper.by()") + run
    assert [script(tmp_path, "one.py", first).stdout for _ in range(2)] == ["0\n", "1\n"]
    assert script(tmp_path, "same.py", first).stdout == "1\n"  # the same function, by its content
    for name, body in (("two.py", text.format("3.0") + run), ("one.py", first)):
        if name == "one.py":  # unchanged, but not the module that it reads
            (tmp_path / "helper.py").write_text("def by():\n    return 4.0\n")
        done = script(tmp_path, name, body)
        assert "must be a file of the function f as it is now" in done.stderr
        assert done.stdout == ""


def test_checkpoint_of_function_that_cannot_be_hashed_raises(tmp_path):
    lock, file = threading.Lock(), tmp_path / "sweep.jsonl"
    with pytest.raises(TypeError, match=r"`checkpoint` must be None where a part of the function .* cannot be hashed"):
        bc.sweep(lambda x: lock and x, {"x": 1.0}, checkpoint=file)
    with pytest.raises(TypeError, match=r"a part of over\['x'\] cannot be hashed"):
        bc.sweep(abs_of, {"x": {"lock": lock}}, checkpoint=file)
    with pytest.raises(TypeError, match="values that cannot be pickled"):
        bc.sweep(lambda x: threading.Lock(), {"x": 1.0}, checkpoint=tmp_path / "new.jsonl")


def abs_of(x):
    return abs(x)


def test_checkpoint_value_changed_under_its_label_is_recomputed(tmp_path):
    file, old = tmp_path / "sweep.jsonl", {"soft": np.array([1.0]), "hard": np.array([9.0])}
    assert bc.sweep(first_of, {"x": old}, checkpoint=file)["value"].tolist() == [1.0, 9.0]
    for resumed in (1, 2):
        found = bc.sweep(first_of, {"x": {**old, "soft": np.array([2.0])}}, checkpoint=file)
        assert (found["value"].tolist(), found.resumed) == ([2.0, 9.0], resumed)
    assert len(file.read_text().splitlines()) == 1 + 3


def first_of(x):
    return {"value": float(x[0])}


def test_checkpoint_ignores_number_in_name_of_system(tmp_path):
    """python-control counts systems that are made without a name."""

    def made(gain):
        K = control.ss([[-1.0]], [[1.0]], [[gain]], [[0.0]])
        return lambda x: float(K.C[0, 0]) * x

    for resumed in (0, 1):
        assert bc.sweep(made(2.0), {"x": 3.0}, checkpoint=tmp_path / "s").resumed == resumed
    with pytest.raises(ValueError, match="must be a file of the function"):
        bc.sweep(made(2.5), {"x": 3.0}, checkpoint=tmp_path / "s")


@pytest.mark.parametrize("made", [lambda: bc.hub_beam(modes=2), lambda: bc.spray_boom(elements=2)])
def test_checkpoint_ignores_what_a_record_has_computed(tmp_path, made):
    file, used = tmp_path / "sweep.jsonl", made()
    for k, machine in enumerate((made(), used, made(), used)):
        assert bc.sweep(lowest_of, {"machine": {"own": machine}}, checkpoint=file).resumed == (k > 0)
        lowest_of(used)


def lowest_of(machine):
    if isinstance(machine, bc.rotating_beam.HubBeam):
        return {"value": machine.simulate(bc.spin_up(1.0, 1.0), [0.0, 1.0]).tip_displacement[-1]}
    return {"value": machine.eigenfrequencies_hz(1)[0], "peak": bc.sigma(machine).peak}


def test_checkpoint_failed_point_is_written_and_tried_again(tmp_path):
    file = tmp_path / "sweep.jsonl"
    with pytest.warns(SweepWarning, match="1 of 4 points failed"):
        bc.sweep(picky, {"x": [1.0, 2.0], "y": [0, 1]}, checkpoint=file)
    rows = [json.loads(line) for line in file.read_text().splitlines()[1:]]
    assert [row["error"] for row in rows] == [None, None, None, "ValueError: not at 2.0"]
    assert rows[3]["point"] == {"x": 2.0, "y": 1}
    with pytest.warns(SweepWarning, match="1 of 6 points failed"):
        found = bc.sweep(picky, {"x": [1.0, 2.0, 3.0], "y": [0, 1]}, n_jobs=2, checkpoint=file)
    assert found.resumed == 3
    assert len(file.read_text().splitlines()) == 1 + 4 + 3


def test_checkpoint_of_something_else_raises(tmp_path):
    file = tmp_path / "sweep.jsonl"
    bc.sweep(picky, {"x": 1.0, "y": [0]}, checkpoint=file)
    with pytest.raises(ValueError, match=r"must be a file of the function numbers as it is now, got .* of picky"):
        bc.sweep(numbers, {**GRID}, checkpoint=file)
    whole = file.read_text()
    file.write_text(whole + "[]\n")
    with pytest.raises(ValueError, match="line 3 is no point"):
        bc.sweep(picky, {"x": 1.0, "y": [0]}, checkpoint=file)
    for other in ("time,value\n1,2\n", "one line, without an end"):
        file.write_text(other)
        with pytest.raises(ValueError, match="must be a file that a sweep wrote"):
            bc.sweep(picky, {"x": 1.0, "y": [0]}, checkpoint=file)
        assert file.read_text() == other
    for begun in ("", '{"for', whole.splitlines()[0]):  # interrupted while the first line was written
        file.write_text(begun)
        assert bc.sweep(picky, {"x": 1.0, "y": [0]}, checkpoint=file)["value"].tolist() == [1.0]
        assert len(file.read_text().splitlines()) == 2


# written as they are, escaped, and in two, three and four bytes: all of Unicode takes seconds to be listed
TEXTS = st.text('aZ0 _/"\\\n\x00\x7f\u00e9\u2028\uffff\U0001d11e', max_size=5)
CELLS = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | TEXTS | st.complex_numbers(),
    lambda inside: st.lists(inside, max_size=3) | st.dictionaries(TEXTS, inside, max_size=3) | st.tuples(inside),
    max_leaves=6,
)


@examples(200)
@given(CELLS)
def test_a_file_holds_what_was_answered(cell):
    line = json.loads(json.dumps(checkpoint_module._encoded(cell)))
    assert repr(checkpoint_module._decoded(line)) == repr(cell)


def test_a_file_holds_arrays_and_objects_to_the_last_bit(tmp_path):
    answers = {
        "array": np.random.default_rng(0).normal(size=(2, 3)) + 1j,
        "whole": np.arange(3),
        "number": np.float64(1.0) / 3.0,
        "parameters": bc.BoomParameters(spring_stiffness=1.0 / 3.0),
    }
    file = tmp_path / "sweep.jsonl"

    def answer(x):
        return answers

    first, again = (bc.sweep(answer, {"x": 1}, checkpoint=file) for _ in range(2))
    assert again.resumed == 1
    for name in ("array", "whole", "number"):
        assert np.array_equal(first[name], again[name])
        assert first[name].dtype == again[name].dtype
    assert again.table[0]["parameters"] == answers["parameters"]


@pytest.mark.slow  # starts two workers, which die
@pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL")
def test_sweep_dead_worker_raises_and_keeps_points(tmp_path):
    over, file = {"x": range(6), "folder": str(tmp_path)}, tmp_path / "sweep.jsonl"
    with pytest.raises(RuntimeError, match=r"A worker process died.*in the checkpoint"):
        bc.sweep(deadly, over, n_jobs=2, checkpoint=file)
    rows = [json.loads(line) for line in file.read_text().splitlines()[1:]]
    assert {row["point"]["x"] for row in rows} == {0, 1, 3, 4, 5}
    assert {row["point"]["x"]: row["found"]["value"] for row in rows} == {x: x**2 for x in (0, 1, 3, 4, 5)}


def sleeping(x, folder):
    (Path(folder) / f"pid{os.getpid()}").touch()
    if x < 4:
        return {"value": x}
    (Path(folder) / f"slept{x}").touch()
    time.sleep(600.0)
    return {"value": x}


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="it reads /proc")
@pytest.mark.parametrize("to_group", [True, False])
def test_sweep_ctrl_c_leaves_no_process_and_keeps_points(tmp_path, to_group):
    file, over = tmp_path / "sweep.jsonl", {"x": range(8), "folder": str(tmp_path)}
    path = tmp_path / "script.py"
    path.write_text(
        "import boomctl as bc\nfrom tests.studies.test_sweeps import sleeping\n"
        f"if __name__ == '__main__':\n    bc.sweep(sleeping, {over}, n_jobs=2, checkpoint={str(file)!r})\n"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen(
        [sys.executable, path], env=environment, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as child:
        while len(list(tmp_path.glob("slept*"))) < 2 and child.poll() is None:
            time.sleep(0.1)
        time.sleep(1.0)
        if to_group:  # as a terminal does
            os.killpg(child.pid, signal.SIGINT)
        else:
            child.send_signal(signal.SIGINT)
        _, said = child.communicate(timeout=60.0)
    assert "KeyboardInterrupt" in said
    assert child.returncode != 0
    pids = [int(p.name[3:]) for p in tmp_path.glob("pid*")]
    assert len(pids) == 2
    begun = time.monotonic()
    while (alive := [pid for pid in pids if runs(pid)]) and time.monotonic() < begun + 20.0:
        time.sleep(0.1)
    assert not alive
    rows = [json.loads(line) for line in file.read_text().splitlines()[1:]]
    assert sorted(row["point"]["x"] for row in rows) == [0, 1, 2, 3]


def runs(pid):
    """Return whether a process is running; a zombie is not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.parametrize("n_jobs", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_sweep_progress_reports_each_point(n_jobs):
    told = []
    bc.sweep(numbers, GRID, n_jobs=n_jobs, progress=told.append)
    assert {each.task for each in told} == {"sweep"}
    assert [each.done for each in told] == list(range(7))
    assert told[-1].total == 6


@pytest.mark.parametrize("n_jobs", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_sweep_progress_error_ends_it(n_jobs):
    class Enough(Exception):
        pass

    def stop(told):
        if told.done == 2:
            raise Enough

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of joblib, about results that are not used
        with pytest.raises(Enough):
            bc.sweep(numbers, GRID, n_jobs=n_jobs, progress=stop)


def peak(x):
    return bc.sigma(bc.spray_boom()).peak


def test_sweep_hides_progress_within_points():
    told = []
    bc.sweep(peak, {"x": [1, 2]}, progress=told.append)
    assert [(each.stage, each.done) for each in told] == [("", 0), ("", 1), ("", 2)]


@pytest.mark.slow
def test_many_booms_at_once_are_those_one_by_one():
    omega = np.geomspace(0.5, 100.0, 60)
    over = {"spring_stiffness": [600.0, 1100.0], "spring_distance": [1.0, 1.2], "elements": [4, 6]}
    found = bc.sweep(bc.studies.SigmaStudy(omega, certified_peak=True), over)
    for row in found.table:
        p = bc.BoomParameters(spring_stiffness=row["spring_stiffness"], spring_distance=row["spring_distance"])
        single = bc.sigma(bc.spray_boom(p, elements=row["elements"]), omega)
        # outputs of modes are verified to 1e-10 (`_AGREEMENT`), whichever models stand beside
        assert np.allclose(row["sigma"], single.sigma, rtol=1e-9, atol=0.0)
        assert row["peak"] == pytest.approx(single.peak, rel=1e-6)  # the promise of a certified norm
    assert found.units["omega"] == "rad/s"


def test_a_machine_that_is_refused_spoils_no_others():
    study = bc.studies.SigmaStudy([1.0, 2.0])
    with pytest.warns(SweepWarning, match=r"1 of 3 points failed.*spring_stiffness = -1"):
        found = bc.sweep(study, {"spring_stiffness": [500.0, -1.0, 1000.0]})
    assert np.isfinite(found["sigma"][[0, 2]]).all()
    with pytest.raises(RuntimeError, match="unknown parameter of the boom 'spring_stifness'; did you mean"):
        bc.sweep(study, {"spring_stifness": [500.0]})


def test_machines_of_ones_own_are_swept():
    def mass(damping):
        return bc.structure.SecondOrderModel([[1.0]], [[damping]], [[4.0]], {"f": [1.0]}, {"y": [1.0]})

    omega = np.array([1.0, 2.0])
    found = bc.sweep(bc.studies.SigmaStudy(omega, mass, inputs="f"), {"damping": [0.1, 0.2]})
    exact = 1.0 / np.abs(4.0 - omega**2 + 1j * omega * np.array([[0.1], [0.2]]))
    assert np.allclose(found["sigma"][:, 0], exact, rtol=1e-14)
    with pytest.raises(RuntimeError, match="expected a function that returns a SecondOrderModel, got float"):
        bc.sweep(bc.studies.SigmaStudy(omega, lambda x: x), {"x": [1.0]})


@pytest.mark.slow
def test_field_runs_are_those_of_performance():
    scene = bc.studies.FieldScene(run_in=5.0, duration=10.0)
    design = bc.studies.SuspensionDesign("soft", "softer", bc.BoomParameters(spring_stiffness=550.0))
    found = bc.sweep(
        bc.studies.FieldStudy(scene), {"design": design, "speed": [2.0, 3.0], "hinge_damping": [5.0, 50.0]}
    )
    for row in found.table:
        where = bc.studies.FieldScene(run_in=5.0, duration=10.0, speed=row["speed"])
        p = bc.BoomParameters(spring_stiffness=550.0, hinge_damping=row["hinge_damping"])
        run = bc.studies.performance("soft", where, p)
        assert (row["deposit_cv"], row["stroke"], row["peak"]) == (run.spray.cv, run.stroke, run.sigma.peak)
    with pytest.raises(RuntimeError, match="unknown property of scene or machine 'sped'"):
        bc.sweep(bc.studies.FieldStudy(scene), {"sped": 3.0})


@pytest.mark.slow
def test_tables_of_pandas():
    pytest.importorskip("pandas")
    with pytest.warns(SweepWarning):
        frame = bc.sweep(picky, GRID, units={"x": "m", "value": "m"}).to_pandas()
    assert list(frame.columns) == ["x", "y", "z", "value"]
    assert frame["value"].isna().tolist() == [False, False, False, True, False, False]
    assert frame.attrs["units"] == {"x": "m", "value": "m"}


@pytest.mark.slow
def test_data_sets_of_xarray():
    pytest.importorskip("xarray")
    found = bc.sweep(numbers, GRID, units={"x": "m", "sum": "m"})
    data = found.to_xarray(dims={"powers": ["root"]})
    assert data["powers"].dims == ("x", "y", "root")
    assert float(data["sum"].sel(x=2.0, y=1)) == 8.0
    assert data["sum"].attrs["units"] == data["x"].attrs["units"] == "m"
    assert data.attrs == {"z": 5.0}
    with pytest.raises(ValueError, match="expected 1 names"):
        found.to_xarray(dims={"powers": ["a", "b"]})
    curves = bc.sweep(bc.studies.SigmaStudy([1.0, 2.0]), {"spring_stiffness": [600.0, 1100.0]}).to_xarray()
    assert curves["sigma"].dims == ("spring_stiffness", "singular_value", "omega")
    assert curves["omega"].values.tolist() == [1.0, 2.0]
    zipped = bc.sweep(numbers, {"x": [1.0, 2.0], "y": [0, 1], "z": 0.0}, combine="zip").to_xarray()
    assert zipped["sum"].dims == ("point",)
    assert zipped["x"].values.tolist() == [1.0, 2.0]


@pytest.mark.parametrize("library", ["pandas", "xarray"])
def test_a_library_that_is_missing_is_named(monkeypatch, library):
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(ImportError, match=rf"{library} is not installed: pip install 'boomctl\[tables\]'"):
        getattr(bc.sweep(numbers, GRID), f"to_{library}")()


def test_a_sweep_is_drawn():
    words = bc.sweep(lambda who, x: {"answer": x + len(who)}, {"who": ["a", "bb"], "x": [1.0, 2.0]}, units={"x": "m"})
    ax = words.plot()
    assert ax.get_xlabel() == "x [m]"
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["a", "bb"]
    assert ax.lines[2].get_ydata().tolist() == [3.0, 4.0]
    assert not ax.get_title(loc="left")  # a point at each value: the line is no median
    numbered = bc.sweep(lambda x, y, seed: x + 10.0 * y + seed**2, {"x": [1.0, 2.0], "y": [2, 1], "seed": [0, 1, 2]})
    ax = numbered.plot()
    assert ax.get_title(loc="left") == "dots: all points; line: their median over seed"
    assert (ax.get_legend().get_title().get_text(), [t.get_text() for t in ax.get_legend().get_texts()]) == (
        "y",
        ["1", "2"],
    )
    assert [line.get_ydata().tolist() for line in ax.lines[::2]] == [[12.0, 13.0], [22.0, 23.0]]
    assert len({line.get_color() for line in ax.lines}) == 2
    many = bc.sweep(lambda x, y: x * y, {"x": [1.0, 2.0], "y": np.linspace(0.0, 1.0, 9)}).plot()
    assert len(many.get_legend().get_texts()) == 6
    assert len({tuple(line.get_color()) for line in many.lines}) == 9
    with pytest.raises(ValueError, match="swept parameter"):
        words.plot(against="who")
    assert isinstance(words, SweepResult)
    with pytest.raises(ValueError, match="column: expected one that is a number"):
        bc.sweep(lambda x: "word", {"x": [1.0]}).plot()


@pytest.mark.slow
def test_sweep_dask_backend_returns_same_table():
    distributed = pytest.importorskip("distributed")
    scene = bc.studies.FieldScene(run_in=5.0, duration=10.0)
    over = {"speed": [2.0, 3.0], "seed": [1, 2]}
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster),
    ):
        assert same(bc.sweep(numbers, GRID, n_jobs=-1, backend="dask"), bc.sweep(numbers, GRID))
        assert same(
            bc.sweep(bc.studies.FieldStudy(scene), over, n_jobs=-1, backend="dask"),
            bc.sweep(bc.studies.FieldStudy(scene), over),
        )
