"""A sampled controller as C99, and a program that compares it with numbers computed here.

In double precision the C code does the same operations in the same order as :meth:`RunningController.run`, so that it gives
the same bits, where the compiler does not contract products and sums (``-std=c99``, ``-ffp-contract=off``).  In single
precision its distance is bounded: each sample adds at most what rounding changes of the sums, and ``C A^k`` carries that on.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.system import Lti

_SAMPLES = 240  # of the comparison: half of them within the limits, half beyond
_BEYOND = 20.0  # times the limits, which the second half asks for
_SINGLE = 2.0**-24  # unit of rounding in single precision
_ROOM = 2.0  # times the bound of first order, for what is of second


@dataclass(frozen=True)
class RunningController:
    """``asked = C x + D y``; ``given``: force limited, then rate; ``x+ = A x + B y + L (given - asked)``.

    Attributes
    ----------
    K : Lti
        In discrete time.
    L : (n, u) ndarray
        Anti-windup; zero without.
    force : (u,) ndarray
        Largest control; ``inf`` without.
    step : (u,) ndarray
        Largest change of a control from one sample to the next; ``inf`` without.
    """

    K: Lti
    L: Array
    force: Array
    step: Array

    def run(self, measured: Array) -> Array:
        """Return the controls given to measurements, one a row, from rest: plain sums, from the first term to the last."""
        A, B, C, D, L = (matrix.tolist() for matrix in (self.K.A, self.K.B, self.K.C, self.K.D, self.L))
        n, u = len(A), len(D)
        x, last, found = [0.0] * n, [0.0] * u, []
        for y in measured.tolist():
            asked = [_sum(D[i], y, _sum(C[i], x, 0.0)) for i in range(u)]
            for i, value in enumerate(asked):
                last[i] = self._limited(value, last[i], i)
            kept = [last[i] - asked[i] for i in range(u)]
            x = [_sum(L[i], kept, _sum(B[i], y, _sum(A[i], x, 0.0))) for i in range(n)]
            found.append(list(last))
        return np.array(found).reshape(len(measured), u)

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
        ``name`` is no name in C; a controller without inputs or outputs.
    """
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
        raise ValueError(f"path: {name!r} is no name in C: expected letters, digits and _, a letter first")
    K = running.K
    if not (K.inputs and K.outputs):
        raise ValueError("controller: expected at least one input and one output")
    measured = _measurements(running)
    controls, half = running.run(measured), len(measured) // 2
    bound = _single_bound(running, measured[:half])
    words = {
        "NAME": name,
        "GUARD": f"{name.upper()}_H",
        "SINGLE": f"{name.upper()}_SINGLE",
        "UPPER": name.upper(),
        "INPUT_COUNT": str(len(K.inputs)),
        "OUTPUT_COUNT": str(len(K.outputs)),
        "STATE_COUNT": str(len(K.A)),
        "TIME": f"{K.dt!r}",
        "INPUT_LIST": _listed(K.inputs, units),
        "OUTPUT_LIST": _listed(K.outputs, units),
        "MATRICES": "".join(
            _matrix(name, letter, matrix)
            for letter, matrix in (("A", K.A), ("B", K.B), ("C", K.C), ("D", K.D), ("L", running.L))
            if (matrix.any() if letter == "L" else matrix.size)
        ),
        "LIMITS": _limits(name, running),
        "LIMITING": _LIMIT_FORCE * bool(np.isfinite(running.force).any())
        + _LIMIT_RATE * bool(np.isfinite(running.step).any()),
        "OWN_STATES": _OWN_STATES if len(K.A) else "",
        "NEXT": (_NEXT + (_CORRECTED if running.L.any() else "") + _KEPT) if len(K.A) else "",
        "RESET": _RESET if len(K.A) else "",
        "SAMPLE_COUNT": str(len(measured)),
        "WITHIN": str(half),
        "MEASURED": _table(measured),
        "CONTROLS": _table(controls),
        "BOUND": _hex(bound),
        "BOUND_TEXT": f"{bound:.3g}",
    }
    files = {f"{name}.c": _SOURCE, f"{name}.h": _HEADER, f"{name}_test.c": _TEST}
    return {file: _filled(text, words) for file, text in files.items()}


def _filled(text: str, words: Mapping[str, str]) -> str:
    # twice, as what is filled in holds words of its own
    for _ in range(2):
        text = re.sub(r"@([A-Z_]+)@", lambda found: words[found[1]], text)
    return text


def _measurements(running: RunningController) -> Array:
    """Return measurements that ask for what the limits allow, then for more."""
    K, rng = running.K, np.random.default_rng(0)
    noise = rng.standard_normal((_SAMPLES, len(K.inputs)))
    scale = np.linalg.norm(np.vstack([K.D, K.C @ K.B if len(K.A) else K.D]), axis=0)
    noise = noise / np.where(scale > 0.0, scale, 1.0)
    free = RunningController(K, np.zeros_like(running.L), np.full(len(K.C), np.inf), np.full(len(K.C), np.inf))
    asked = free.run(noise)[: _SAMPLES // 2]
    changes = np.abs(np.diff(asked, axis=0, prepend=0.0)).max(axis=0, initial=0.0)
    room = np.minimum(
        running.force / np.maximum(np.abs(asked).max(axis=0, initial=0.0), np.finfo(float).tiny),
        running.step / np.maximum(changes, np.finfo(float).tiny),
    ).min(initial=np.inf)
    if not np.isfinite(room):
        return noise
    noise = noise * (0.5 * room)
    noise[_SAMPLES // 2 :] *= 2.0 * _BEYOND
    return noise


def _single_bound(running: RunningController, measured: Array) -> float:
    """Return how far single precision may be off at any sample of a run within the limits."""
    K = running.K
    n, m, u = len(K.A), len(K.inputs), len(K.outputs)
    x, states = np.zeros(n), []
    for y in measured:
        states.append(np.abs(x))
        x = K.A @ x + K.B @ y
    sizes, read = np.array(states).reshape(len(measured), n), np.abs(measured)
    unit = (n + m + u + 3) * _SINGLE  # matrices and measurements stored, products, sums, what limits compare
    added = unit * (sizes @ np.abs(K.A).T + read @ np.abs(K.B).T).max(axis=0, initial=0.0)
    own = unit * (sizes @ np.abs(K.C).T + read @ np.abs(K.D).T).max(axis=0, initial=0.0)
    carried, onward = np.zeros(u), K.C.copy()
    # the correction multiplies what rounding leaves between asked and given, which within the limits is nothing
    for _ in range(len(measured)):
        carried = carried + np.abs(onward) @ added
        onward = onward @ K.A
    return float(_ROOM * (carried + own).max(initial=0.0))


def _hex(value: float) -> str:
    """Return a number in C's hexadecimal notation, which is exact."""
    return float(value).hex()


def _row(values: Array) -> str:
    return ", ".join(f"R({_hex(value)})" for value in values)


def _matrix(name: str, letter: str, matrix: Array) -> str:
    rows = ",\n".join(f"    {{{_row(row)}}}" for row in matrix)
    return f"static const {name}_real {letter}[{len(matrix)}][{matrix.shape[1]}] = {{\n{rows}\n}};\n\n"


def _limits(name: str, running: RunningController) -> str:
    """Return the limits as arrays; what is not limited is so to the largest number."""
    found = ""
    for label, values in (("FORCE", running.force), ("STEP", running.step)):
        if np.isfinite(values).any():
            entries = ", ".join(f"R({_hex(value)})" if np.isfinite(value) else "@NAME@_NONE" for value in values)
            found += f"static const {name}_real {label}[{len(values)}] = {{{entries}}};\n"
    return found


def _table(values: Array) -> str:
    return ",\n".join("    {" + ", ".join(_hex(value) for value in row) + "}" for row in values)


def _listed(names: tuple[str, ...], units: Mapping[str, str]) -> str:
    marked = (f"{i}: {name}" + (f" [{units[name]}]" if units.get(name) else "") for i, name in enumerate(names))
    return "".join(f" *   {line}\n" for line in marked)


_HEADER = """\
/* @NAME@: a sampled controller u = K y, once every @TIME@ s.
 *
 * Measurements:
@INPUT_LIST@ * Controls:
@OUTPUT_LIST@ *
 * Compile with -D@SINGLE@ for single precision, and without contraction of products and sums (-std=c99).
 */
#ifndef @GUARD@
#define @GUARD@

#ifdef @SINGLE@
typedef float @NAME@_real;
#else
typedef double @NAME@_real;
#endif

#define @UPPER@_MEASUREMENTS @INPUT_COUNT@
#define @UPPER@_CONTROLS @OUTPUT_COUNT@
#define @UPPER@_STATES @STATE_COUNT@
#define @UPPER@_SAMPLE_TIME @TIME@

typedef struct {
@OWN_STATES@    @NAME@_real last[@UPPER@_CONTROLS]; /* the controls given at the last sample */
} @NAME@_controller;

/* Put a controller to rest. */
void @NAME@_reset(@NAME@_controller *controller);

/* Take one sample: read the measurements, write the controls.
 * Returns 0; or 1 if a measurement is no finite number: then the last controls are given again and nothing changes. */
int @NAME@_step(@NAME@_controller *controller, const @NAME@_real measured[@UPPER@_MEASUREMENTS],
                @NAME@_real control[@UPPER@_CONTROLS]);

#endif
"""

_OWN_STATES = "    @NAME@_real x[@UPPER@_STATES];\n"

_SOURCE = """\
/* @NAME@: see @NAME@.h. */
#include "@NAME@.h"

#include <float.h>

#define R(number) ((@NAME@_real)(number))
#ifdef @SINGLE@
#define @NAME@_NONE FLT_MAX
#else
#define @NAME@_NONE DBL_MAX
#endif

@MATRICES@@LIMITS@
void @NAME@_reset(@NAME@_controller *controller)
{
    int i;
@RESET@    for (i = 0; i < @UPPER@_CONTROLS; i++) {
        controller->last[i] = R(0.0);
    }
}

int @NAME@_step(@NAME@_controller *controller, const @NAME@_real measured[@UPPER@_MEASUREMENTS],
                @NAME@_real control[@UPPER@_CONTROLS])
{
    @NAME@_real asked[@UPPER@_CONTROLS];
    int i, j;

    for (j = 0; j < @UPPER@_MEASUREMENTS; j++) {
        if (!(measured[j] >= -@NAME@_NONE && measured[j] <= @NAME@_NONE)) {
            for (i = 0; i < @UPPER@_CONTROLS; i++) {
                control[i] = controller->last[i];
            }
            return 1;
        }
    }
    for (i = 0; i < @UPPER@_CONTROLS; i++) {
        @NAME@_real sum = R(0.0);
        @NAME@_real given;
#if @UPPER@_STATES > 0
        for (j = 0; j < @UPPER@_STATES; j++) {
            sum = sum + C[i][j] * controller->x[j];
        }
#endif
        for (j = 0; j < @UPPER@_MEASUREMENTS; j++) {
            sum = sum + D[i][j] * measured[j];
        }
        asked[i] = sum;
        given = sum;
@LIMITING@        control[i] = given;
        controller->last[i] = given;
    }
@NEXT@    (void)asked;
    return 0;
}
"""

_RESET = """\
    for (i = 0; i < @UPPER@_STATES; i++) {
        controller->x[i] = R(0.0);
    }
"""

_LIMIT_FORCE = """\
        if (given > FORCE[i]) {
            given = FORCE[i];
        } else if (given < -FORCE[i]) {
            given = -FORCE[i];
        }
"""

_LIMIT_RATE = """\
        if (given - controller->last[i] > STEP[i]) {
            given = controller->last[i] + STEP[i];
        } else if (given - controller->last[i] < -STEP[i]) {
            given = controller->last[i] - STEP[i];
        }
"""

_NEXT = """\
    {
        @NAME@_real next[@UPPER@_STATES];
        for (i = 0; i < @UPPER@_STATES; i++) {
            @NAME@_real sum = R(0.0);
            for (j = 0; j < @UPPER@_STATES; j++) {
                sum = sum + A[i][j] * controller->x[j];
            }
            for (j = 0; j < @UPPER@_MEASUREMENTS; j++) {
                sum = sum + B[i][j] * measured[j];
            }
"""

_CORRECTED = """\
            for (j = 0; j < @UPPER@_CONTROLS; j++) {
                sum = sum + L[i][j] * (controller->last[j] - asked[j]);
            }
"""

_KEPT = """\
            next[i] = sum;
        }
        for (i = 0; i < @UPPER@_STATES; i++) {
            controller->x[i] = next[i];
        }
    }
"""

_TEST = """\
/* Compares @NAME@ with numbers computed by boomctl: the same bits in double precision, within a bound in single.
 * Compile: cc -std=c99 -Wall -Wextra -Werror -pedantic @NAME@.c @NAME@_test.c -o @NAME@_test
 */
#include "@NAME@.h"

#include <stdio.h>

#define SAMPLES @SAMPLE_COUNT@
#define WITHIN_LIMITS @WITHIN@ /* samples whose controls meet no limit */
#define SINGLE_BOUND @BOUND@ /* @BOUND_TEXT@: of rounding in single precision, there */

static const double MEASURED[SAMPLES][@UPPER@_MEASUREMENTS] = {
@MEASURED@
};

static const double CONTROLS[SAMPLES][@UPPER@_CONTROLS] = {
@CONTROLS@
};

int main(void)
{
    @NAME@_controller controller;
    double largest = 0.0, beyond = 0.0;
    int sample, i, wrong = 0;

    @NAME@_reset(&controller);
    for (sample = 0; sample < SAMPLES; sample++) {
        @NAME@_real measured[@UPPER@_MEASUREMENTS], control[@UPPER@_CONTROLS];
        for (i = 0; i < @UPPER@_MEASUREMENTS; i++) {
            measured[i] = (@NAME@_real)MEASURED[sample][i];
        }
        if (@NAME@_step(&controller, measured, control) != 0) {
            wrong = 1;
        }
        for (i = 0; i < @UPPER@_CONTROLS; i++) {
            double difference = (double)control[i] - CONTROLS[sample][i];
            difference = difference < 0.0 ? -difference : difference;
            if (sample < WITHIN_LIMITS) {
                largest = difference > largest ? difference : largest;
            } else {
                beyond = difference > beyond ? difference : beyond;
            }
        }
    }
#ifdef @SINGLE@
    if (largest > SINGLE_BOUND) {
        wrong = 1;
    }
    printf("single precision: off by %.9g, bound %.9g; beyond the limits by %.9g\\n", largest, SINGLE_BOUND, beyond);
#else
    if (largest > 0.0 || beyond > 0.0) {
        wrong = 1;
    }
    printf("double precision: off by %.17g, beyond the limits by %.17g\\n", largest, beyond);
#endif
    return wrong;
}
"""
