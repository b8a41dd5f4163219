"""What these tests share: controllers of random numbers, and a C compiler that takes every warning for an error."""

import shutil
import subprocess

import control
import numpy as np

CC = shutil.which("cc")
STRICT = ["-std=c99", "-O1", "-Wall", "-Wextra", "-Wtrigraphs", "-Werror", "-pedantic", "-I."]


def controller(seed=0, states=5, inputs=2, outputs=2, dt=0.0):
    """Return a stable controller of the boom's signals."""
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((states, states))
    A = 0.3 * A / max(np.abs(np.linalg.eigvals(A)).max(), 1.0) if states else A
    if dt == 0.0:
        A = A - 2.0 * np.eye(states)
    shapes = ((states, inputs), (outputs, states), (outputs, inputs))
    signals = {
        "inputs": [f"stroke_{i}" for i in range(inputs)],
        "outputs": [f"suspension_{i}" for i in range(outputs)],
    }
    return control.ss(A, *(rng.standard_normal(shape) for shape in shapes), dt, **signals)


def compiled(folder, *flags, test="loop_test.c"):
    command = [CC, *STRICT, *flags, "loop.c", test, "-o", "run"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, errors="replace", check=False)


def ran(folder, *flags, test="loop_test.c"):
    """Compile ``loop.c`` with a program that calls it, and return how that ended."""
    made = compiled(folder, *flags, test=test)
    assert not made.returncode, made.stderr
    return subprocess.run([folder / "run"], capture_output=True, text=True, check=False)
