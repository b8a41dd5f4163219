"""C99 code of sampled controllers, and a program that tests it.

In double precision the C code performs the operations of :meth:`RunningController.run` in the same order and gives the same
bits, if the compiler does not contract products and sums (``-std=c99``, ``-ffp-contract=off``). In single precision the
program prints the largest difference.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite, log

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.system import Lti

_TESTED = 240  # Largest number of samples of the test: half of them within the limits, half beyond.
_DIVERGED = 1e3  # Largest growth of an unstable controller's states in each half.
_EXCESS = 20.0  # Requested controls of the second half, relative to the limits.
_HUGE = 1e200  # Largest measurement of the test; products with gains below 1e100 do not overflow.


@dataclass(frozen=True)
class RunningController:
    """Controller with limits: ``v = C x + D y``; ``u`` is ``v``, limited, then rate-limited; ``x+ = A x + B y + L (u - v)``.

    If one of these numbers is not finite, the previous controls are returned and the states do not change.

    Attributes
    ----------
    K : Lti
        Controller in discrete time.
    L : (n, u) ndarray
        Anti-windup gain; zero for none.
    force : (u,) ndarray
        Largest control; ``inf`` for none.
    step : (u,) ndarray
        Largest change of a control per sample; ``inf`` for none.
    """

    K: Lti
    L: Array
    force: Array
    step: Array

    def run(self, measured: Array) -> Array:
        """Return the controls for measurements, one row per sample, from zero states; sums run from the first term on."""
        A, B, C, D, L = (matrix.tolist() for matrix in (self.K.A, self.K.B, self.K.C, self.K.D, self.L))
        n, u = len(A), len(D)
        x, last, result = [0.0] * n, [0.0] * u, []
        for y in measured.tolist():
            requested = [_sum(D[i], y, _sum(C[i], x, 0.0)) for i in range(u)]
            allowed = [self._limited(value, last[i], i) for i, value in enumerate(requested)]
            excess = [allowed[i] - requested[i] for i in range(u)]
            following = [_sum(L[i], excess, _sum(B[i], y, _sum(A[i], x, 0.0))) for i in range(n)]
            if all(map(isfinite, [*y, *requested, *following])):
                x, last = following, allowed
            result.append(last)
        return np.array(result).reshape(len(measured), u)

    def _limited(self, value: float, last: float, i: int) -> float:
        force, step = float(self.force[i]), float(self.step[i])
        value = force if value > force else -force if value < -force else value
        change = value - last
        return last + step if change > step else last - step if change < -step else value


def _sum(row: list[float], values: list[float], start: float) -> float:
    for a, b in zip(row, values, strict=True):
        start = start + a * b
    return start


def c_files(name: str, running: RunningController, units: Mapping[str, str]) -> dict[str, str]:
    """Return the contents of ``NAME.c``, ``NAME.h`` and ``NAME_test.c``.

    Raises
    ------
    ValueError
        If ``name`` is not an identifier of C, or the controller has no inputs or outputs.
    """
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
        raise ValueError(f"path: {name!r} is no name in C: expected letters, digits and _, a letter first")
    K = running.K
    if not (K.input_labels and K.output_labels):
        raise ValueError("controller: expected at least one input and one output")
    measured = _measurements(running)
    stored = (K.A, K.B, K.C, K.D, running.L, *(x[np.isfinite(x)] for x in (running.force, running.step)))
    largest = max(float(np.abs(item).max(initial=0.0)) for item in stored)
    words = {
        "NAME": name,
        "UPPER": name.upper(),
        "MATRICES": "".join(
            _matrix(name, letter, matrix)
            for letter, matrix in (("A", K.A), ("B", K.B), ("C", K.C), ("D", K.D), ("L", running.L))
        ),
        "FORCE": _limits(name, running.force),
        "STEP": _limits(name, running.step),
        "EXCEEDS_SINGLE": str(int(largest > float(np.finfo(np.float32).max))),
        "INPUT_COUNT": str(len(K.input_labels)),
        "OUTPUT_COUNT": str(len(K.output_labels)),
        "STATE_COUNT": str(len(K.A)),
        "STATE_ROOM": str(max(len(K.A), 1)),
        "TIME": f"{K.dt!r}",
        "INPUT_LIST": _listed(K.input_labels, units),
        "OUTPUT_LIST": _listed(K.output_labels, units),
        "SAMPLE_COUNT": str(len(measured)),
        "MEASURED": _rows(measured, "{}"),
        "CONTROLS": _rows(running.run(measured), "{}"),
    }
    files = {f"{name}.c": _SOURCE, f"{name}.h": _HEADER, f"{name}_test.c": _TEST}
    return {file: re.sub(r"@([A-Z_]+)@", lambda match: words[match[1]], text) for file, text in files.items()}


def _measurements(running: RunningController) -> Array:
    """Return measurements for which the controls are within the limits, then beyond."""
    K, rng = running.K, np.random.default_rng(0)
    own = float(np.abs(np.linalg.eigvals(K.A)).max()) if len(K.A) else 0.0
    half = _TESTED // 2 if own <= 1.0 else max(2, min(_TESTED // 2, int(log(_DIVERGED) / log(own))))
    noise = rng.standard_normal((2 * half, len(K.input_labels)))
    with np.errstate(all="ignore"):  # Measurements are zero if the gains overflow.
        scale = np.abs(np.vstack([K.D, K.C @ K.B if len(K.A) else K.D])).max(axis=0)
        noise = np.clip(noise / np.where(scale > 0.0, scale, 1.0), -_HUGE, _HUGE)
        free = RunningController(K, np.zeros_like(running.L), np.full(len(K.C), np.inf), np.full(len(K.C), np.inf))
        requested = free.run(noise)[:half]
        changes = np.abs(np.diff(requested, axis=0, prepend=0.0)).max(axis=0, initial=0.0)
        factor = np.minimum(
            running.force / np.maximum(np.abs(requested).max(axis=0, initial=0.0), np.finfo(float).tiny),
            running.step / np.maximum(changes, np.finfo(float).tiny),
        ).min(initial=np.inf)
        if not np.isfinite(factor):
            return noise
        noise = noise * (0.5 * factor)
        noise[half:] *= 2.0 * _EXCESS
        return np.clip(noise, -_HUGE, _HUGE)


def _matrix(name: str, letter: str, matrix: Array) -> str:
    """Return the array of a matrix; C has no empty arrays, so that one without rows or columns has one, which is not used."""
    held = np.pad(matrix, [(0, int(size == 0)) for size in matrix.shape])
    return f"static const {name}_real {letter}[{len(held)}][{held.shape[1]}] = {{\n{_rows(held, 'R({})')}\n}};\n\n"


def _limits(name: str, values: Array) -> str:
    """Return the entries of an array of limits; unlimited controls have the largest number."""
    return ", ".join(f"R({x.hex()})" if isfinite(x) else f"{name}_NONE" for x in values.tolist())


def _rows(values: Array, form: str) -> str:
    """Return numbers in C's hexadecimal notation, which is exact, each put into a form."""
    return ",\n".join("    {" + ", ".join(form.format(x.hex()) for x in row) + "}" for row in values.tolist())


def _listed(names: tuple[str, ...], units: Mapping[str, str]) -> str:
    marked = (f"{i}: {name}" + (f" [{units[name]}]" if units.get(name) else "") for i, name in enumerate(names))
    return "".join(f" *   {_commented(line)}\n" for line in marked)


def _commented(line: str) -> str:
    """Return a text as one line of a C comment; unprintable characters are replaced by their code points."""
    result = "".join(letter if letter.isprintable() and letter != "\\" else f"<U+{ord(letter):04X}>" for letter in line)
    for pair in ("*/", "/*", "??"):
        while pair in result:
            result = result.replace(pair, " ".join(pair))
    return result


_HEADER = """\
/* @NAME@: a sampled controller u = K y, once every @TIME@ s.
 *
 * Measurements:
@INPUT_LIST@ * Controls:
@OUTPUT_LIST@ *
 * Compile with -D@UPPER@_SINGLE for single precision, and without contraction of products and sums (-std=c99).
 */
#ifndef @UPPER@_H
#define @UPPER@_H

#if defined(@UPPER@_SINGLE) && @EXCEEDS_SINGLE@
#error "@NAME@: numbers exceed the range of single precision"
#endif

#ifdef @UPPER@_SINGLE
typedef float @NAME@_real;
#else
typedef double @NAME@_real;
#endif

#define @UPPER@_MEASUREMENTS @INPUT_COUNT@
#define @UPPER@_CONTROLS @OUTPUT_COUNT@
#define @UPPER@_STATES @STATE_COUNT@
#define @UPPER@_SAMPLE_TIME @TIME@

typedef struct {
    @NAME@_real x[@STATE_ROOM@];
    @NAME@_real last[@UPPER@_CONTROLS]; /* controls of the last sample */
} @NAME@_controller;

/* Set states and controls to zero. */
void @NAME@_reset(@NAME@_controller *controller);

/* Take one sample: read the measurements, write the controls.
 * Returns 0; or 1 if a number is not finite: the controls are then those of the last sample and the states do not change. */
int @NAME@_step(@NAME@_controller *controller, const @NAME@_real measured[@UPPER@_MEASUREMENTS],
                @NAME@_real control[@UPPER@_CONTROLS]);

#endif
"""

_SOURCE = """\
/* @NAME@: see @NAME@.h. */
#include "@NAME@.h"

#define R(number) ((@NAME@_real)(number))
#ifdef @UPPER@_SINGLE
#define @NAME@_NONE R(0x1.fffffep+127) /* the largest number */
#else
#define @NAME@_NONE R(0x1.fffffffffffffp+1023)
#endif
#define FINITE(number) ((number) >= -@NAME@_NONE && (number) <= @NAME@_NONE)

@MATRICES@static const @NAME@_real FORCE[@UPPER@_CONTROLS] = {@FORCE@};
static const @NAME@_real STEP[@UPPER@_CONTROLS] = {@STEP@};

void @NAME@_reset(@NAME@_controller *controller)
{
    static const @NAME@_controller zero = {{R(0.0)}, {R(0.0)}};
    *controller = zero;
}

int @NAME@_step(@NAME@_controller *controller, const @NAME@_real measured[@UPPER@_MEASUREMENTS],
                @NAME@_real control[@UPPER@_CONTROLS])
{
    @NAME@_real requested[@UPPER@_CONTROLS], allowed[@UPPER@_CONTROLS], next[@STATE_ROOM@];
    int i, j, finite = 1;

    for (j = 0; j < @UPPER@_MEASUREMENTS; j++) {
        finite = finite && FINITE(measured[j]);
    }
    for (i = 0; i < @UPPER@_CONTROLS && finite; i++) {
        @NAME@_real sum = R(0.0);
        for (j = 0; j < @UPPER@_STATES; j++) {
            sum = sum + C[i][j] * controller->x[j];
        }
        for (j = 0; j < @UPPER@_MEASUREMENTS; j++) {
            sum = sum + D[i][j] * measured[j];
        }
        finite = finite && FINITE(sum);
        requested[i] = sum;
        sum = sum > FORCE[i] ? FORCE[i] : sum < -FORCE[i] ? -FORCE[i] : sum;
        if (sum - controller->last[i] > STEP[i]) {
            sum = controller->last[i] + STEP[i];
        } else if (sum - controller->last[i] < -STEP[i]) {
            sum = controller->last[i] - STEP[i];
        }
        allowed[i] = sum;
    }
    for (i = 0; i < @UPPER@_STATES && finite; i++) {
        @NAME@_real sum = R(0.0);
        for (j = 0; j < @UPPER@_STATES; j++) {
            sum = sum + A[i][j] * controller->x[j];
        }
        for (j = 0; j < @UPPER@_MEASUREMENTS; j++) {
            sum = sum + B[i][j] * measured[j];
        }
        for (j = 0; j < @UPPER@_CONTROLS; j++) {
            sum = sum + L[i][j] * (allowed[j] - requested[j]);
        }
        finite = finite && FINITE(sum);
        next[i] = sum;
    }
    for (i = 0; i < @UPPER@_STATES && finite; i++) {
        controller->x[i] = next[i];
    }
    for (i = 0; i < @UPPER@_CONTROLS; i++) {
        if (finite) {
            controller->last[i] = allowed[i];
        }
        control[i] = controller->last[i];
    }
    (void)requested;
    return !finite;
}
"""

_TEST = """\
/* Compares @NAME@ with numbers computed by boomctl: equality in double precision, the difference in single precision.
 * Compile: cc -std=c99 -Wall -Wextra -Werror -pedantic @NAME@.c @NAME@_test.c -o @NAME@_test
 */
#include "@NAME@.h"

#include <stdio.h>

#define SAMPLES @SAMPLE_COUNT@

static const double MEASURED[SAMPLES][@UPPER@_MEASUREMENTS] = {
@MEASURED@
};

static const double CONTROLS[SAMPLES][@UPPER@_CONTROLS] = {
@CONTROLS@
};

int main(void)
{
    @NAME@_controller controller;
    double largest = 0.0, size = 0.0;
    int sample, i, single, wrong = 0;

    @NAME@_reset(&controller);
    for (sample = 0; sample < SAMPLES; sample++) {
        @NAME@_real measured[@UPPER@_MEASUREMENTS], control[@UPPER@_CONTROLS];
        for (i = 0; i < @UPPER@_MEASUREMENTS; i++) {
            measured[i] = (@NAME@_real)MEASURED[sample][i];
        }
        wrong = @NAME@_step(&controller, measured, control) || wrong;
        for (i = 0; i < @UPPER@_CONTROLS; i++) {
            double wanted = CONTROLS[sample][i], difference = (double)control[i] - wanted;
            difference = difference < 0.0 ? -difference : difference;
            wanted = wanted < 0.0 ? -wanted : wanted;
            largest = difference > largest ? difference : largest;
            size = wanted > size ? wanted : size;
        }
    }
    single = sizeof(@NAME@_real) < sizeof(double);
    printf("%s precision: largest difference %.17g, largest control %.9g\\n", single ? "single" : "double", largest, size);
    return wrong || largest > (single ? size : 0.0);
}
"""
