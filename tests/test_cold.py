"""Cold paths: what a scene does not use is not imported; each scene in a process of its own."""

import os
import subprocess
import sys

import pytest

COMMAND = "from boomctl.cli import main"
HEAVY = {"numpy", "scipy", "control", "slycot", "casadi", "matplotlib", "mpmath", "flint", "rich"}
BOOM = {"control", "slycot", "casadi", "matplotlib", "mpmath", "flint", "rich", "tomllib", "scipy.optimize"}
BOOM |= {
    "threadpoolctl",
    "scipy.signal",
    "scipy.integrate",
    "scipy.interpolate",
    "scipy.special",
    "boomctl.rotating_beam",
    "boomctl.synthesis",
}
LOOP = {"control", "casadi", "matplotlib", "mpmath", "flint", "rich", "scipy.signal", "scipy.integrate"}
COST = "output_weight={'tip_left': 1.0, 'tip_right': 1.0}, controls=['suspension_left']"
NOISE = "{'actuator_left': 1.0}, 1.0, measurements=['stroke_left']"
BEAM = {"control", "slycot", "casadi", "matplotlib", "mpmath", "flint", "rich", "scipy.signal", "scipy.sparse"}
BEAM |= {"boomctl.boom", "boomctl.structure", "boomctl.analysis", "boomctl.synthesis", "boomctl.slew"}


def imported(scene, *words):
    """Return the modules that are there after some lines of Python, run as a user runs them."""
    code = (
        f"import sys; sys.argv[1:] = {words!r}\ntry:\n    {scene}\nfinally:\n    print(*sys.modules, file=sys.stderr)"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    return set(done.stderr.split())


BOTH = "bc.spray_boom().select('actuator_left', 'tip_left')"
SCENES = {
    "package": ("import boomctl.threads", HEAVY | {"threadpoolctl"}),
    "rooms": ("import boomctl.structure, boomctl.analysis, boomctl.slew, boomctl.plotting", HEAVY),
    "parameters": ("bc.BoomParameters(); bc.HubBeamParameters()", HEAVY - {"numpy"}),
    "boom": ("bc.spray_boom()", BOOM | {"boomctl.analysis"}),
    "sigma": ("bc.sigma(bc.spray_boom()).peak", BOOM | {"boomctl.reduction"}),
    "family": ("bc.boom_family(); bc.split_symmetric(bc.spray_boom())", BOOM),
    "forced": ("bc.forced_response(bc.spray_boom(), [0.0, 0.1, 0.2], {'cradle': [0.0, 1.0, 0.0]})", LOOP),
    "reduction": (f"print(bc.reduce({BOTH}, order=6))", BOOM | {"boomctl.synthesis"}),
    "lqg": (f"print(bc.lqg(bc.spray_boom(), None, 1e-4, {NOISE}, {COST}))", LOOP | {"scipy.optimize"}),
    "synthesis": ("bc.lqg, bc.h2, bc.h_infinity, bc.exceptions.SynthesisError, bc.simulate_loop, bc.reduce", LOOP),
    "figure": ("bc.plotting.figure_of(bc.iso_track(length=50.0).plot)", {"matplotlib.pyplot"}),
    "beam": ("bc.hub_beam(modes=2).eigenfrequencies_hz(1.0)", BEAM | {"scipy.optimize"}),
    "spin-up": ("bc.hub_beam(modes=1).simulate(bc.spin_up(1.0, 1.0), [1.0, 2.0])", BEAM | {"scipy"}),
    "slew": (
        "print(bc.optimal_slew(bc.hub_beam(modes=1), 1.5, 200.0))",
        (LOOP | {"boomctl.boom", "boomctl.synthesis"}) - {"casadi"},
    ),
    "sweep": ("bc.sweep(bc.spray_boom, {'elements': [4, 6]})", BOOM),
}
QUICK = ("package", "rooms", "parameters", "boom")  # the others take half a second each


@pytest.mark.parametrize(
    ("scene", "without"),
    [pytest.param(*scene, id=name, marks=() if name in QUICK else pytest.mark.slow) for name, scene in SCENES.items()],
)
def test_a_first_call_imports_only_what_it_uses(scene, without):
    assert sorted(imported(f"import boomctl as bc; {scene}") & without) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "without"),
    [
        (("--version",), HEAVY | {"json", "inspect"}),
        (("parameters",), HEAVY | {"json", "inspect", "tomllib"}),
        (("parameters", "--json"), {"scipy", "control", "casadi", "matplotlib", "rich"}),
        (("design", "--help"), HEAVY),
        (("sigma",), BOOM),
        (("sigma", "--json"), BOOM),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_a_command_imports_only_what_it_uses(words, without):
    assert sorted(imported(f"{COMMAND}; main()", *words) & without) == []


@pytest.mark.slow
def test_beam_imported_alone_has_other_models():
    imported(
        "from boomctl.rotating_beam.assumed_modes import AssumedModesBeam as B;"
        "from boomctl.rotating_beam.parameters import HubBeamParameters as P;"
        "B(P(), 'foam', 2).with_model('geometrically-exact'); assert 'boomctl.rotating_beam.factory' not in sys.modules"
    )


@pytest.mark.slow
def test_module_with_public_name_imports():
    imported(
        "import warnings, boomctl.analysis; warnings.simplefilter('error', ImportWarning); import boomctl.analysis.nyquist; "
        "assert not isinstance(boomctl.analysis.nyquist, type(sys))"
    )


@pytest.mark.slow
def test_python_control_systems_pickle():
    """The package learns of python-control where a system of it is made or met, and so does pickle."""
    scene = (
        "import boomctl as bc, sys; system = bc.spray_boom(); assert 'control' not in sys.modules;"
        "import pickle; made = system.to_statespace(); again = pickle.loads(pickle.dumps(made));"
        "assert (again.A == made.A).all() and again.input_labels == made.input_labels"
    )
    assert "control" in imported(scene)
