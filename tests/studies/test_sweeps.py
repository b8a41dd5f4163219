"""Sweeps: the same table with all backends; failures and interrupts lose no computed point; stale checkpoints raise."""

import json
import os
import subprocess
import sys
import threading
import time
from functools import cache, cached_property, partial
from itertools import product

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import boomctl as bc
from boomctl.exceptions import SweepWarning
from boomctl.studies.sweeps import checkpoint as checkpoint_module
from tests.profiles import examples

GRID = {"x": [1.0, 2.0, 3.0], "y": [0, 1], "z": 5.0}
OTHER = r"`checkpoint` must be a file of the function .* as it is now"


def numbers(x, y, z):
    """Return a number, an array and a word."""
    return {"sum": x + y + z, "powers": np.array([x, y, z]) ** 0.5, "who": f"{x:g}/{y}"}


def picky(x, y, z=0.0):
    if x == 2.0 and y == 1:
        raise ValueError(f"not at {x}")
    return x + y + z


def deadly(x):
    """Kill the process at x = 2 once the other points are written."""
    if x == 2:
        time.sleep(1.0)
        os.kill(os.getpid(), 9)
    return x**2


def test_sweep_grid_combines_all_values():
    found = bc.sweep(numbers, GRID)
    assert (found.shape, found.swept, len(found), found.failures) == ((3, 2), ("x", "y"), 6, ())
    assert found["sum"].tolist() == [[x + y + 5.0 for y in GRID["y"]] for x in GRID["x"]]
    assert found["powers"].shape == (3, 2, 3)
    assert [(row["x"], row["y"]) for row in found.table] == list(product(GRID["x"], GRID["y"]))
    assert all(row["who"] == f"{row['x']:g}/{row['y']}" and row["z"] == 5.0 for row in found.table)
    assert found["who"][2].tolist() == ["3/0", "3/1"]
    assert repr(found).startswith("SweepResult: 6 points, 3 values of x, 2 values of y\n  sum [3 x 2, 6 to 9], ")


def test_sweep_zip_combines_values_in_order():
    found = bc.sweep(numbers, {"x": [1.0, 2.0], "y": range(2), "z": 0.0}, mode="zip")
    assert found["sum"].tolist() == [1.0, 3.0]
    assert [list(point.values()) for point in found.points] == [[1.0, 0, 0.0], [2.0, 1, 0.0]]


def test_sweep_labels_objects_by_name():
    booms = {"soft": bc.BoomParameters(spring_stiffness=550.0), "stiff": bc.BoomParameters(spring_stiffness=2200.0)}
    found = bc.sweep(lambda boom: boom.spring_stiffness, {"boom": booms})
    assert found.labels["boom"] == ("soft", "stiff")
    assert found["value"].tolist() == [550.0, 2200.0]
    assert bc.sweep(lambda boom: 1.0, {"boom": list(booms.values())}).labels["boom"] == (0, 1)
    designs = [bc.studies.SuspensionDesign(name, "") for name in ("one", "other")]
    assert bc.sweep(lambda design: 1.0, {"design": designs}).labels["design"] == ("one", "other")
    assert bc.sweep(lambda x: 1.0, {"x": [designs[0], booms["soft"]]}).labels["x"] == (0, 1)


@pytest.mark.parametrize(
    ("changes", "error"),
    [
        ({"parameters": {}}, ValueError),
        ({"parameters": {"x": [], "y": 1, "z": 1}}, ValueError),
        ({"parameters": {"x": [1.0, 1.0], "y": 1, "z": 1}}, ValueError),
        ({"parameters": {"x": range(2000), "y": range(2000), "z": 1}}, ValueError),
        ({"parameters": {"x": [1, 2], "y": [1], "z": 1}, "mode": "zip"}, ValueError),
        ({"parameters": {"x": 1.0, "speed": [1.0]}}, RuntimeError),
        ({"n_jobs": 0}, ValueError),
        ({"n_jobs": 2, "backend": "tow"}, ValueError),
        ({"checkpoint": "."}, ValueError),
    ],
)
def test_sweep_of_bad_arguments_raises(changes, error):
    with pytest.raises(error) as raised:
        bc.sweep(**{"function": numbers, "parameters": GRID, **changes})
    assert "\n" not in str(raised.value)


def test_sweep_failed_point_is_reported_and_tried_again(tmp_path):
    file, failed = tmp_path / "s", r"1 of 6 points failed.*x = 2, y = 1, z = 5: ValueError: not at 2.0"
    for resumed in (0, 5):
        with pytest.warns(SweepWarning, match=failed):
            found = bc.sweep(picky, GRID, checkpoint=file)
        assert found.resumed == resumed
    rows = [json.loads(line) for line in file.read_text().splitlines()[1:]]
    assert {k: row["error"] for k, row in enumerate(rows) if row["error"]} == dict.fromkeys(
        (3, 6), "ValueError: not at 2.0"
    )
    assert len(rows) == 7
    assert rows[3]["point"] == rows[6]["point"] == {"x": 2.0, "y": 1, "z": 5.0}
    (failure,) = found.failures
    assert failure.point == {"x": 2.0, "y": 1, "z": 5.0}
    assert "in picky" in failure.trace
    assert np.argwhere(np.isnan(found["value"])).tolist() == [[1, 1]]
    assert found.table[3]["value"] is None
    assert "1 failed: x = 2, y = 1" in repr(found)
    with pytest.raises(RuntimeError, match=r"failed at every point; at x = 2, y = 1: ValueError: not at 2\.0"):
        bc.sweep(picky, {"x": 2.0, "y": 1})
    with pytest.raises(ValueError, match="must return names that are not swept, got 'x'"):
        bc.sweep(lambda x: {"x": 1.0}, {"x": [1.0]}).table  # noqa: B018
    with pytest.warns(SweepWarning, match="SystemExit: no such boom"):  # as scripts end
        assert bc.sweep(lambda x: x if x < 2 else sys.exit("no such boom"), {"x": [1, 2]})["value"][0] == 1


@pytest.mark.parametrize("backend", ["threading", pytest.param("loky", marks=pytest.mark.slow)])
def test_sweep_backends_return_same_table(backend):
    there, here = bc.sweep(numbers, GRID, n_jobs=2, backend=backend), bc.sweep(numbers, GRID)
    assert there.points == here.points
    assert all(np.array_equal(there[name], here[name]) for name in here.columns)
    with pytest.warns(SweepWarning):
        failed = bc.sweep(picky, GRID, n_jobs=2, backend=backend)
    assert [each.text for each in failed.failures] == ["x = 2, y = 1, z = 5: ValueError: not at 2.0"]


@pytest.mark.slow  # starts workers
def test_sweep_of_lock_in_processes_raises():
    lock = threading.Lock()
    with pytest.raises(TypeError, match=r"must be picklable with n_jobs = 2.*backend='threading'"):
        bc.sweep(lambda x: lock and x, {"x": [1.0, 2.0]}, n_jobs=2)


@pytest.mark.slow  # starts two workers, which die
@pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL")
def test_sweep_dead_worker_raises_and_keeps_points(tmp_path):
    with pytest.raises(RuntimeError, match=r"A worker process died.*in the checkpoint"):
        bc.sweep(deadly, {"x": range(6)}, n_jobs=2, checkpoint=tmp_path / "s")
    rows = [json.loads(line) for line in (tmp_path / "s").read_text().splitlines()[1:]]
    assert {row["point"]["x"]: row["found"]["value"] for row in rows} == {x: x**2 for x in (0, 1, 3, 4, 5)}


def test_sweep_progress_reports_each_point():
    seen = []
    bc.sweep(lambda x: bc.sigma(bc.spray_boom()).peak, {"x": [1, 2]}, progress=seen.append)
    assert [(each.task, each.stage, each.completed, each.total) for each in seen] == [
        ("sweep", "", k, 2) for k in range(3)
    ]


class Recorder:
    """A function that leaves a note of its calls and may be interrupted."""

    def __init__(self, folder):
        self.folder = folder

    def __call__(self, x):
        if (self.folder / "stop").exists() and x == 3:
            raise KeyboardInterrupt
        with open(self.folder / "calls", "a") as file:
            file.write("x")
        return {"square": x**2}


def test_checkpoint_of_interrupted_sweep_resumes(tmp_path):
    file, over, function = tmp_path / "sweep.jsonl", {"x": np.sqrt(range(6))}, Recorder(tmp_path)
    over["x"][3] = 3.0
    (tmp_path / "stop").touch()
    with pytest.raises(KeyboardInterrupt):
        bc.sweep(function, over, checkpoint=file)
    (tmp_path / "stop").unlink()
    with open(file, "a") as cut_off:
        cut_off.write('{"point": {"x": 3, "fold')
    found = bc.sweep(function, over, checkpoint=file)
    assert (found.resumed, (tmp_path / "calls").read_text()) == (3, 6 * "x")
    assert found["square"].tolist() == (over["x"] ** 2).tolist()  # to the last bit
    more = bc.sweep(function, {"x": [5.5, 3.0, 9.0]}, checkpoint=file)
    assert (more.resumed, more["square"].tolist()) == (1, [5.5**2, 9.0, 81.0])


class Times:
    def __init__(self, factor):
        self.factor = factor

    def of(self, x):
        return {"value": self.factor * x}

    def __call__(self, x):
        return self.of(x)


def times(factor):
    return lambda x: {"value": factor * x}


def run_cell(source, **namespace):
    """Return the function ``own`` of a notebook's cell, which reads the names of the notebook."""
    namespace["__name__"] = "__main__"
    exec(source, namespace)
    return namespace["own"]


def system_gain(factor):
    """Return a function of a system, which python-control numbers in its name."""
    K = control.ss([[-1.0]], [[1.0]], [[factor]], [[0.0]])
    return lambda x: {"value": float(K.C[0, 0]) * x}


def local_class(factor, kind):
    class Local:
        by = factor

        @kind
        def computed(self):
            return factor

        @staticmethod
        def of(x):
            return {"value": Local.by * x}

        def __call__(self, x):
            return {"value": self.computed * x}

    return Local


MADE = {
    "method": lambda f: Times(f).of,
    "object": Times,
    "closure": times,
    "default": lambda f: lambda x, by=f: {"value": by * x},
    "nested function": lambda f: lambda x: max(f * y for y in (x,)),
    "partial": lambda f: partial(lambda x, factor: {"value": factor * x}, factor=f),
    "recursion": lambda f: run_cell("def own(x): return {'value': f if x <= 1.0 else f + own(x - 1.0)['value']}", f=f),
    "helper of a notebook": lambda f: run_cell(
        "def helper(x): return f * x\ndef own(x): return {'value': helper(x)}", f=f
    ),
    "code of a notebook": lambda f: run_cell(f"def own(x): return {{'value': {f} * x}}"),
    "system": system_gain,
    "cache": lambda f: cache(times(f)),
    "class attribute": lambda f: local_class(f, property).of,
    "property": lambda f: local_class(f, property)(),
    "cached property": lambda f: local_class(f, cached_property)(),
}


@pytest.mark.parametrize("made", MADE.values(), ids=MADE)
def test_checkpoint_of_other_function_raises(tmp_path, made):
    over, file = {"x": [1.0, 2.0]}, tmp_path / "sweep.jsonl"
    for resumed in (0, 2):  # an equal function, created again, is the same
        found = bc.sweep(made(2.0), over, checkpoint=file)
        assert (found["value"].tolist(), found.resumed) == ([2.0, 4.0], resumed)
    before = file.read_bytes()
    with pytest.raises(ValueError, match=OTHER):
        bc.sweep(made(3.0), over, checkpoint=file)
    assert file.read_bytes() == before


def test_checkpoint_after_edited_module_raises(tmp_path, monkeypatch):
    def local(x):
        import checkpoint_helper

        return checkpoint_helper.by() * x

    monkeypatch.syspath_prepend(tmp_path)
    module = tmp_path / "checkpoint_helper.py"
    module.write_text("FACTOR = 2.0\ndef by(): return FACTOR\n")
    of_global = run_cell("import checkpoint_helper as m\ndef own(x): return m.FACTOR * x")
    for function in (local, of_global):
        file = tmp_path / function.__name__
        for resumed in (0, 1):
            assert bc.sweep(function, {"x": [1.0]}, checkpoint=file).resumed == resumed
    monkeypatch.setattr("checkpoint_helper.FACTOR", 3.0)
    with pytest.raises(ValueError, match=OTHER):
        bc.sweep(of_global, {"x": [1.0]}, checkpoint=file)
    monkeypatch.setattr("checkpoint_helper.FACTOR", 2.0)
    module.write_text("FACTOR = 3.0\ndef by(): return FACTOR\n")
    for function in (local, of_global):
        with pytest.raises(ValueError, match=OTHER):
            bc.sweep(function, {"x": [1.0]}, checkpoint=tmp_path / function.__name__)
    monkeypatch.delitem(sys.modules, "checkpoint_helper")


@pytest.mark.slow  # four processes
def test_checkpoint_of_two_scripts_with_one_main_f(tmp_path):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "PYTHONHASHSEED": "random"}
    run = f"print(bc.sweep(f, {{'x': [1.0]}}, checkpoint={str(tmp_path / 's.jsonl')!r}).resumed)"
    text = "import boomctl as bc\ndef f(x):\n    return {} * x if 'a' in {{'a', 'b', 'c'}} else None\n"
    for name, factor, expected in (("one", 2.0, "0\n"), ("one", 2.0, "1\n"), ("same", 2.0, "1\n"), ("other", 3.0, "")):
        (tmp_path / name).write_text(text.format(factor) + run)
        command = [sys.executable, tmp_path / name]
        done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
        assert done.stdout == expected
    assert "must be a file of the function f as it is now" in done.stderr


def test_checkpoint_of_what_cannot_be_hashed_raises(tmp_path):
    lock, file = threading.Lock(), tmp_path / "sweep.jsonl"
    with pytest.raises(TypeError, match=r"`checkpoint` must be None where a part of the function .* cannot be hashed"):
        bc.sweep(lambda x: lock and x, {"x": 1.0}, checkpoint=file)
    with pytest.raises(TypeError, match=r"a part of over\['x'\] cannot be hashed"):
        bc.sweep(lambda x: 1.0, {"x": {"lock": lock}}, checkpoint=file)
    with pytest.raises(TypeError, match="values that cannot be pickled"):
        bc.sweep(lambda x: threading.Lock(), {"x": 1.0}, checkpoint=tmp_path / "new.jsonl")


def test_checkpoint_value_changed_under_its_label_is_recomputed(tmp_path):
    old = {"soft": np.array([1.0]), "hard": np.array([9.0])}
    for over, resumed in ((old, 0), ({**old, "soft": np.array([2.0])}, 1), ({**old, "soft": np.array([2.0])}, 2)):
        found = bc.sweep(lambda x: float(x[0]), {"x": over}, checkpoint=tmp_path / "s")
        assert (found["value"].tolist(), found.resumed) == ([over["soft"][0], 9.0], resumed)
    assert len((tmp_path / "s").read_text().splitlines()) == 1 + 3


def test_checkpoint_ignores_what_a_record_has_computed(tmp_path):
    def tip(beam):
        return beam.simulate(bc.spin_up(1.0, 1.0), [0.0, 1.0]).tip_displacement[-1]

    used = bc.hub_beam(modes=2)
    for k, beam in enumerate((bc.hub_beam(modes=2), used, used)):
        assert bc.sweep(tip, {"beam": {"own": beam}}, checkpoint=tmp_path / "s").resumed == (k > 0)
        tip(used)


def test_checkpoint_of_something_else_raises(tmp_path):
    file, over = tmp_path / "sweep.jsonl", {"x": 1.0, "y": [0]}
    bc.sweep(picky, over, checkpoint=file)
    whole = file.read_text()
    with pytest.raises(ValueError, match=r"of the function numbers as it is now .*begins with .*picky"):
        bc.sweep(numbers, {**GRID}, checkpoint=file)
    for other in ("time,value\n1,2\n", "one line, without an end", whole + "[]\n"):
        file.write_text(other)
        with pytest.raises(ValueError, match=f"{OTHER}|with other lines"):
            bc.sweep(picky, over, checkpoint=file)
        assert file.read_text() == other
    for begun in ("", '{"fun', whole.splitlines()[0]):  # interrupted while the first line was written
        file.write_text(begun)
        assert bc.sweep(picky, over, checkpoint=file)["value"].tolist() == [1.0]
        assert file.read_text().splitlines()[0] == whole.splitlines()[0]


WORD = st.text('aZ0 "/\\\n\x00\u00e9\uffff\U0001d11e', max_size=5)
CELL = st.floats() | st.integers() | WORD | st.complex_numbers()


@examples(200)
@given(st.dictionaries(WORD, CELL | st.none() | st.booleans() | st.lists(CELL), max_size=2))
def test_checkpoint_encoding_is_exact(columns):
    line = json.dumps({name: checkpoint_module._encoded(cell) for name, cell in columns.items()})
    assert repr(checkpoint_module._decoded(json.loads(line))) == repr(columns)


def test_sweep_result_to_pandas_has_units(monkeypatch):
    pytest.importorskip("pandas")
    with pytest.warns(SweepWarning):
        found = bc.sweep(picky, GRID, units={"x": "m", "value": "m"})
    frame = found.to_pandas()
    assert list(frame.columns) == ["x", "y", "z", "value"]
    assert frame["value"].isna().tolist() == [False, False, False, True, False, False]
    assert frame.attrs["units"] == {"x": "m", "value": "m"}
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError, match=r"pandas is not installed: pip install 'boomctl\[tables\]'"):
        found.to_pandas()


def test_sweep_result_plot_groups_and_labels():
    words = bc.sweep(lambda who, x: {"answer": x + len(who)}, {"who": ["a", "bb"], "x": [1.0, 2.0]}, units={"x": "m"})
    ax = words.plot()
    assert ax.get_xlabel() == "x [m]"
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["a", "bb"]
    assert ax.lines[2].get_ydata().tolist() == [3.0, 4.0]
    assert not ax.get_title(loc="left")  # a point at each value: the line is no median
    numbered = bc.sweep(lambda x, y, seed: x + 10.0 * y + seed**2, {"x": [1.0, 2.0], "y": [2, 1], "seed": [0, 1, 2]})
    ax = numbered.plot()
    assert ax.get_title(loc="left") == "dots: all points; line: their median over seed"
    legend = ax.get_legend()
    assert (legend.get_title().get_text(), [t.get_text() for t in legend.get_texts()]) == ("y", ["1", "2"])
    assert [line.get_ydata().tolist() for line in ax.lines[::2]] == [[12.0, 13.0], [22.0, 23.0]]
    with pytest.raises(ValueError, match="swept parameter"):
        words.plot(against="who")
    with pytest.raises(ValueError, match="column: expected one that is a number"):
        bc.sweep(lambda x: "word", {"x": [1.0]}).plot()
