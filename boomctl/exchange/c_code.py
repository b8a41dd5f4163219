"""A sampled controller as C99, and a program that compares it with numbers computed here.

In double precision the C code does the same operations in the same order as :meth:`RunningController.run`, so that it gives
the same bits, where the compiler does not contract products and sums (``-std=c99``, ``-ffp-contract=off``).  In single
precision the program prints the largest difference.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite, log

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.system import Lti

_SAMPLES = 240  # of the comparison, at most: half of them within the limits, half beyond
_GROWN = 1e3  # times by which an unstable controller may grow in each half (a choice: its digits are still compared)
_BEYOND = 20.0  # times the limits, which the second half asks for
_HUGE = 1e200  # largest measurement of the comparison (a choice: gains below 1e100 ask for numbers still)


@dataclass(frozen=True)
class RunningController:
    """``asked = C x + D y``; ``given``: force limited, then rate; ``x+ = A x + B y + L (given - asked)``.

    At a sample of which one of these numbers is beyond all numbers, the last controls are given again and nothing changes.

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
        x, last, result = [0.0] * n, [0.0] * u, []
        for y in measured.tolist():
            asked = [_sum(D[i], y, _sum(C[i], x, 0.0)) for i in range(u)]
            given = [self._limited(value, last[i], i) for i, value in enumerate(asked)]
            following = [_sum(B[i], y, _sum(A[i], x, 0.0)) for i in range(n)]
            if self.L.any():
                kept = [given[i] - asked[i] for i in range(u)]
                following = [_sum(L[i], kept, following[i]) for i in range(n)]
            if all(map(isfinite, [*y, *asked, *following])):
                x, last = following, given
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
        ``name`` is no name in C; a controller without inputs or outputs.
    """
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
        raise ValueError(f"path: {name!r} is no name in C: expected letters, digits and _, a letter first")
    K = running.K
    if not (K.input_labels and K.output_labels):
        raise ValueError("controller: expected at least one input and one output")
    measured = _measurements(running)
    controls = running.run(measured)
    stored = (K.A, K.B, K.C, K.D, running.L, *(x[np.isfinite(x)] for x in (running.force, running.step)))
    largest = max(float(np.abs(item).max(initial=0.0)) for item in stored)
    plain = {
        "NAME": name,
        "GUARD": f"{name.upper()}_H",
        "SINGLE": f"{name.upper()}_SINGLE",
        "UPPER": name.upper(),
    }
    parts = {
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
        "NEXT_STATES": _NEXT_STATES if len(K.A) else "",
        "TAKEN": _TAKEN if len(K.A) else "",
        "RESET": _RESET if len(K.A) else "",
        "ONLY_DOUBLE": _ONLY_DOUBLE if largest > float(np.finfo(np.float32).max) else "",
    }
    words = plain | {key: _filled(text, plain) for key, text in parts.items()}
    words |= {
        "INPUT_COUNT": str(len(K.input_labels)),
        "OUTPUT_COUNT": str(len(K.output_labels)),
        "STATE_COUNT": str(len(K.A)),
        "TIME": f"{K.dt!r}",
        "INPUT_LIST": _listed(K.input_labels, units),
        "OUTPUT_LIST": _listed(K.output_labels, units),
        "SAMPLE_COUNT": str(len(measured)),
        "MEASURED": _table(measured),
        "CONTROLS": _table(controls),
    }
    files = {f"{name}.c": _SOURCE, f"{name}.h": _HEADER, f"{name}_test.c": _TEST}
    return {file: _filled(text, words) for file, text in files.items()}


def _filled(text: str, words: Mapping[str, str]) -> str:
    """Return a text with its words filled in; what is filled in is not looked at."""
    return re.sub(r"@([A-Z_]+)@", lambda found: words[found[1]], text)


def _measurements(running: RunningController) -> Array:
    """Return measurements that ask for what the limits allow, then for more."""
    K, rng = running.K, np.random.default_rng(0)
    own = float(np.abs(np.linalg.eigvals(K.A)).max()) if len(K.A) else 0.0
    half = _SAMPLES // 2 if own <= 1.0 else max(2, min(_SAMPLES // 2, int(log(_GROWN) / log(own))))
    noise = rng.standard_normal((2 * half, len(K.input_labels)))
    with np.errstate(all="ignore"):  # of gains beyond all numbers the measurements are zero
        scale = np.abs(np.vstack([K.D, K.C @ K.B if len(K.A) else K.D])).max(axis=0)
        noise = np.clip(noise / np.where(scale > 0.0, scale, 1.0), -_HUGE, _HUGE)
        free = RunningController(K, np.zeros_like(running.L), np.full(len(K.C), np.inf), np.full(len(K.C), np.inf))
        asked = free.run(noise)[:half]
        changes = np.abs(np.diff(asked, axis=0, prepend=0.0)).max(axis=0, initial=0.0)
        room = np.minimum(
            running.force / np.maximum(np.abs(asked).max(axis=0, initial=0.0), np.finfo(float).tiny),
            running.step / np.maximum(changes, np.finfo(float).tiny),
        ).min(initial=np.inf)
        if not np.isfinite(room):
            return noise
        noise = noise * (0.5 * room)
        noise[half:] *= 2.0 * _BEYOND
        return np.clip(noise, -_HUGE, _HUGE)


def _matrix(name: str, letter: str, matrix: Array) -> str:
    rows = ",\n".join(f"    {{{', '.join(f'R({value.hex()})' for value in row)}}}" for row in matrix.tolist())
    return f"static const {name}_real {letter}[{len(matrix)}][{matrix.shape[1]}] = {{\n{rows}\n}};\n\n"


def _limits(name: str, running: RunningController) -> str:
    """Return the limits as arrays; what is not limited is so to the largest number."""
    result = ""
    for label, values in (("FORCE", running.force), ("STEP", running.step)):
        if np.isfinite(values).any():
            entries = ", ".join(f"R({x.hex()})" if isfinite(x) else "@NAME@_NONE" for x in values.tolist())
            result += f"static const {name}_real {label}[{len(values)}] = {{{entries}}};\n"
    return result


def _table(values: Array) -> str:
    """Return numbers in C's hexadecimal notation, which is exact."""
    return ",\n".join("    {" + ", ".join(value.hex() for value in row) + "}" for row in values.tolist())


def _listed(names: tuple[str, ...], units: Mapping[str, str]) -> str:
    marked = (f"{i}: {name}" + (f" [{units[name]}]" if units.get(name) else "") for i, name in enumerate(names))
    return "".join(f" *   {_commented(line)}\n" for line in marked)


def _commented(line: str) -> str:
    """Return a text that is one line of a comment whatever it holds: what would end it, or is not seen, by its number."""
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
 * Compile with -D@SINGLE@ for single precision, and without contraction of products and sums (-std=c99).
 */
#ifndef @GUARD@
#define @GUARD@

@ONLY_DOUBLE@#ifdef @SINGLE@
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
 * Returns 0; or 1 if a measurement, or what follows of it, is no finite number: then the last controls are given again and
 * nothing changes. */
int @NAME@_step(@NAME@_controller *controller, const @NAME@_real measured[@UPPER@_MEASUREMENTS],
                @NAME@_real control[@UPPER@_CONTROLS]);

#endif
"""

_OWN_STATES = "    @NAME@_real x[@UPPER@_STATES];\n"

_ONLY_DOUBLE = """\
#ifdef @SINGLE@
#error "@NAME@: its numbers are beyond single precision"
#endif

"""

_SOURCE = """\
/* @NAME@: see @NAME@.h. */
#include "@NAME@.h"

#define R(number) ((@NAME@_real)(number))
#ifdef @SINGLE@
#define @NAME@_NONE R(0x1.fffffep+127) /* the largest number */
#else
#define @NAME@_NONE R(0x1.fffffffffffffp+1023)
#endif
#define FINITE(number) ((number) >= -@NAME@_NONE && (number) <= @NAME@_NONE)

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
    @NAME@_real asked[@UPPER@_CONTROLS], allowed[@UPPER@_CONTROLS];
@NEXT_STATES@    int i, j, fine = 1;

    for (j = 0; j < @UPPER@_MEASUREMENTS; j++) {
        fine = fine && FINITE(measured[j]);
    }
    for (i = 0; i < @UPPER@_CONTROLS && fine; i++) {
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
        fine = fine && FINITE(sum);
        asked[i] = sum;
        given = sum;
@LIMITING@        allowed[i] = given;
    }
@NEXT@    for (i = 0; i < @UPPER@_CONTROLS; i++) {
        if (fine) {
            controller->last[i] = allowed[i];
        }
        control[i] = controller->last[i];
    }
@TAKEN@    (void)asked;
    return !fine;
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

_NEXT_STATES = "    @NAME@_real next[@UPPER@_STATES];\n"

_NEXT = """\
    for (i = 0; i < @UPPER@_STATES && fine; i++) {
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
            sum = sum + L[i][j] * (allowed[j] - asked[j]);
        }
"""

_KEPT = """\
        fine = fine && FINITE(sum);
        next[i] = sum;
    }
"""

_TAKEN = """\
    for (i = 0; i < @UPPER@_STATES && fine; i++) {
        controller->x[i] = next[i];
    }
"""

_TEST = """\
/* Compares @NAME@ with numbers computed by boomctl: the same bits in double precision, the difference in single.
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
            double wanted = CONTROLS[sample][i], difference = (double)control[i] - wanted;
            difference = difference < 0.0 ? -difference : difference;
            wanted = wanted < 0.0 ? -wanted : wanted;
            largest = difference > largest ? difference : largest;
            size = wanted > size ? wanted : size;
        }
    }
#ifdef @SINGLE@
    if (largest > size) {
        wrong = 1;
    }
    printf("single precision: off by at most %.9g, largest control %.9g\\n", largest, size);
#else
    if (largest > 0.0) {
        wrong = 1;
    }
    printf("double precision: off by %.17g\\n", largest);
#endif
    return wrong;
}
"""
