"""Spectra of records and measured responses, and what modes are in them: columns of a linear least-squares problem."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import fft

from boomctl.arrays import Array
from boomctl.identification.record import Record
from boomctl.lti.python_control import control

_HEAVIEST = 100.0  # Largest weight of a row of a measured response, relative to the median weight.
_FREQUENCIES = 8  # Fewest frequencies of a response in the band, to determine a mode on a background.
FEWEST = 24  # lines in the band for each input: fewer do not determine a mode with its background.
# Powers of frequency, from -1 (a drift) on, for the effect of the ends of a record, in addition to free motions.
_EDGES = 5


@dataclass(frozen=True)
class Spectra:
    """Rows of complex equations ``Y = G U + transients``, those of several records below each other.

    Attributes
    ----------
    s : (n,) ndarray
        ``j omega`` [rad/s].
    U, Y : (n, m), (n, p) ndarray
        Spectra of inputs and outputs; outputs are divided by ``scale``.
    record : (n,) ndarray of int
        Of which record a row is.
    lines : tuple of ndarray
        Which lines of each record's spectrum its rows are.
    lengths : tuple of int
        Samples of each record; empty for a measured response, which has no transients.
    step : float
        Time between samples [s].
    held : bool
        Whether inputs are held between samples.
    scale : (p,) ndarray
        What the outputs are divided by.
    """

    s: Array
    U: Array
    Y: Array
    record: Array
    lines: tuple[Array, ...]
    lengths: tuple[int, ...]
    step: float
    held: bool
    scale: Array

    @classmethod
    def of_record(cls, record: Record, low: float, high: float) -> "Spectra":
        """Return the spectra of each record within a band [Hz], zero left out."""
        parts, lines = [], []
        for k, (u, y) in enumerate(zip(record.u, record.y, strict=True)):
            hz = np.fft.rfftfreq(max(len(u), 2), record.step)
            use = np.flatnonzero((hz > 0.0) & (hz >= low) & (hz <= high) & (hz < 0.5 / record.step))
            if len(use) < FEWEST * u.shape[1]:
                raise ValueError(
                    f"inputs: expected at least {FEWEST * u.shape[1]} frequencies in the band, got {len(use)} in"
                    " the fitted or validation part; use a longer record or a wider excited band"
                )
            spectra = (np.fft.rfft(x - x.mean(axis=0), axis=0)[use] / np.sqrt(len(u)) for x in (u, y))
            parts.append((2j * np.pi * hz[use], *spectra, np.full(len(use), k)))
            lines.append(use)
        s, U, Y, which = (np.concatenate(item) for item in zip(*parts, strict=True))
        held = record.intersample == "zoh"
        lengths = tuple(map(len, record.u))
        return cls(s, U, Y, which, tuple(lines), lengths, record.step, held, np.ones(Y.shape[1])).scaled(rms(Y))

    @classmethod
    def of_response(
        cls, response: "control.FrequencyResponseData", low: float, high: float, deviation: Array | None
    ) -> "Spectra":
        """Return a measured response as rows with one input of one each, weighed so that their errors are alike."""
        omega = np.asarray(response.omega)
        use = np.flatnonzero((omega > 0.0) & (omega >= 2.0 * np.pi * low) & (omega <= 2.0 * np.pi * high))
        G = np.asarray(response.frdata)[..., use]
        if len(use) < _FREQUENCIES:
            raise ValueError(
                f"inputs: expected a response at {_FREQUENCIES} frequencies or more in the band, got {len(use)}; a wider band"
                " or a longer record has more"
            )
        m = G.shape[1]
        Y = G.transpose(1, 2, 0).reshape(-1, len(G))
        U = np.repeat(np.eye(m), len(use), axis=0).astype(complex)
        if deviation is not None:
            error = deviation[..., use].transpose(1, 2, 0).reshape(Y.shape) / rms(Y)
            weight = np.median(rms(error.T)) / np.maximum(rms(error.T), np.finfo(float).tiny)
            weight = np.minimum(weight, _HEAVIEST)[:, None]
            U, Y = U * weight, Y * weight
        s, which = np.tile(1j * omega[use], m), np.repeat(np.arange(m), len(use))
        return cls(s, U, Y, which, (use,) * m, (), 0.0, False, np.ones(len(G))).scaled(rms(Y))

    def scaled(self, scale: Array) -> "Spectra":
        """Return the same with outputs divided by a scale (p,) once more."""
        return replace(self, Y=self.Y / scale, scale=self.scale * scale)

    def within(self, low: float, high: float) -> "Spectra":
        """Return the rows of frequencies from low to high [rad/s]."""
        use = (self.s.imag >= low) & (self.s.imag <= high)
        lines = tuple(item[use[self.record == k]] for k, item in enumerate(self.lines))
        return replace(self, s=self.s[use], U=self.U[use], Y=self.Y[use], record=self.record[use], lines=lines)

    def of_record_number(self, k: int) -> "Spectra":
        """Return the rows of one record."""
        use = self.record == k
        rows = {"s": self.s[use], "U": self.U[use], "Y": self.Y[use], "record": np.zeros(use.sum(), int)}
        return replace(self, **rows, lines=self.lines[k : k + 1], lengths=self.lengths[k : k + 1])

    @property
    def records(self) -> int:
        """Number of records with transients."""
        return len(self.lengths)

    @property
    def output_rms(self) -> Array:
        """Root mean square of each output within the band, in its unit, (p,)."""
        return rms(self.Y) * self.scale

    @property
    def resolution(self) -> float:
        """Between two lines [rad/s]."""
        return (self.top - float(np.abs(self.s).min())) / max(max(map(len, self.lines)) - 1, 1)

    @property
    def top(self) -> float:
        """Highest frequency [rad/s]."""
        return float(np.abs(self.s).max())

    @cached_property
    def _shift(self) -> Array:
        """Shift by one sample at each row, ``exp(s step)``."""
        return np.exp(self.s * self.step)

    def simple(self, poles: Array) -> tuple[Array, Array, Array, Array]:
        """Return responses to the inputs and free motions of simple poles, each with its derivative, (poles, n)."""
        s, poles = self.s, poles[:, None]
        decay = np.exp(poles * self.step)
        if self.records:
            distance = self._shift - decay
            free = self._shift / np.sqrt(max(self.lengths)) / distance
            free_slope = free * (self.step * decay) / distance
        else:
            free = free_slope = np.zeros((0, len(s)))
        if not self.held:
            forced = 1.0 / (s - poles)
            return forced, np.square(forced), free, free_slope
        gain = np.expm1(poles * self.step) / poles
        gain_slope = (self.step * decay - gain) / poles
        distance = self._shift - decay
        forced = gain / distance
        return forced, (gain_slope + forced * self.step * decay) / distance, free, free_slope

    def rows(self, above: tuple[Array, ...], below: tuple[Array, ...], derived: bool) -> Array:
        """Return what pairs of poles give by their `simple` responses, or its derivatives: (poles 2 (m + records), 2 n).

        Real coefficients of the two responses of a pair are the real and the imaginary part of a residue.  The
        derivative for the real part of the pole is the same of the derivatives; for the imaginary part
        ``(second, -first)``.
        """
        m = self.U.shape[1]
        result = np.empty((len(above[0]), 2, m + self.records, len(self.s)), complex)
        for which, signals, at in ((0, self.U.T, slice(m)), (2, self._own.T, slice(m, None))):
            if len(signals):
                for part, pair in enumerate(pairs(above[which + derived], below[which + derived])):
                    np.multiply(pair[:, None], signals, out=result[:, part, at])
        return result.reshape(-1, len(self.s)).view(float)

    def free(self, poles: Array) -> Array:
        """Return columns of free motions of each record, (2 n, 2 poles records)."""
        return real(_both(self.simple(poles)[2], self.simple(poles.conj())[2], self._own))

    @property
    def _own(self) -> Array:
        """Which record each row belongs to, as columns of zeros and ones."""
        return (self.record[:, None] == np.arange(self.records)).astype(float)

    def rest(self, fixed: Array, integrators: int = 0) -> Array:
        """Return the columns other than those of the poles, (2 n, k): feedthrough, fixed pairs, integrators, ends."""
        columns = [self.U]
        if len(fixed):
            columns.append(_both(self.simple(fixed)[0], self.simple(fixed.conj())[0], self.U))
        columns += [response[:, None] * self.U for response in self.integrated(integrators)]
        return np.concatenate([real(np.concatenate(columns, axis=1)), self.ends(integrators)], axis=1)

    def integrated(self, count: int) -> list[Array]:
        """Return the responses of one and of two integrators in series, up to a count."""
        if not self.held:
            return [1.0 / self.s, 1.0 / np.square(self.s)][:count]
        z = self._shift
        return [self.step / (z - 1.0), 0.5 * self.step**2 * (z + 1.0) / np.square(z - 1.0)][:count]

    def ends(self, integrators: int = 0) -> Array:
        """Return columns of the difference of the ends of each record, in addition to free motions, (2 n, k)."""
        powers = np.arange(-max(integrators, 1), _EDGES - 1.0)
        columns = (self.s[:, None] / self.top) ** powers
        return real((self._own[:, :, None] * columns[:, None, :]).reshape(len(self.s), len(powers) * self.records))

    def windowed(self, columns: Array) -> Array:
        """Return complex columns (n, k) of each record under a Hann window over time; of a response as they are."""
        if not self.records:
            return columns
        parts = (columns[self.record == k] for k in range(self.records))
        return np.concatenate([2.0 * part[1:-1] - part[2:] - part[:-2] for part in parts])

    def over_time(self, columns: Array) -> tuple[Array, ...]:
        """Return the complex envelopes of real columns (2 n, k) over time as real rows, (2 N, k) for each record.

        The transform is unitary: products of columns are the same.  Rows of a measured response are sorted by frequency.
        """
        if not self.records:
            return (columns[np.argsort(np.repeat(np.abs(self.s), 2), kind="stable")],)
        whole = np.ascontiguousarray(columns.T).view(complex)
        result = []
        for k, lines in enumerate(self.lines):
            samples = fft.next_fast_len(len(lines))
            part = whole[:, self.record == k] if self.records > 1 else whole
            result.append(fft.ifft(part, samples, axis=1, norm="ortho").view(float).T)
        return tuple(result)


def pairs(above: Array, below: Array) -> tuple[Array, Array]:
    """Return what the real and the imaginary part of a residue multiply, by responses of conjugate poles."""
    return above + below, 1j * (above - below)


def _both(above: Array, below: Array, signals: Array) -> Array:
    """Return the two real combinations of responses of conjugate poles (k, n), times each signal: (n, 2 k m)."""
    both = np.stack(pairs(above, below), axis=1)
    return (both[:, :, None] * signals.T).reshape(2 * above.shape[0] * signals.shape[1], len(signals)).T


def real(columns: Array) -> Array:
    """Return complex rows as twice as many real ones: real and imaginary part in turns."""
    return np.ascontiguousarray(columns.T).view(float).T


def complex_of(rows: Array) -> Array:
    """Return real rows as half as many complex ones."""
    return np.ascontiguousarray(rows.T).view(complex).T


def rms(columns: Array) -> Array:
    """Return the root mean square of each column; one where it is zero."""
    size = np.sqrt(np.square(np.abs(columns)).mean(axis=0))
    return np.where(size > 0.0, size, 1.0)
