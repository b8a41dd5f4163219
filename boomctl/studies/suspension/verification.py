"""Robustness of a suspension: margins, proofs for uncertain springs and masses, the exact boom.

A sampled loop is evaluated on a fine mesh, a continuous-time loop on the exact beam.  Intersample behavior is included in the
field run; ``boomctl.analysis.sampled_data_norm`` bounds it.
"""

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import inf

import numpy as np

from boomctl.analysis.box.robustness import robust_stability
from boomctl.analysis.box.worst_case import worst_case
from boomctl.analysis.loops import closed_loop_response
from boomctl.analysis.margins import Margins, margins
from boomctl.analysis.nyquist import nyquist_stability
from boomctl.analysis.sigma import SigmaResult, sigma
from boomctl.arrays import Array
from boomctl.boom.exact import exact_frequency_response
from boomctl.boom.families import boom_family, family_of, scaled_boom, spring_for_yaw
from boomctl.boom.model import ACTUATORS, TIPS
from boomctl.boom.parameters import BoomParameters
from boomctl.exceptions import MarginLossWarning
from boomctl.lti.python_control import control
from boomctl.lti.rounding import LEVEL
from boomctl.structure.families import AffineFamily
from boomctl.structure.model import SecondOrderModel, split_symmetric
from boomctl.studies.evaluation import Finding, box_method, stability_finding
from boomctl.studies.suspension.performance import InField
from boomctl.studies.suspension.scenario import ACCELERATIONS, CONTROLS, FAMILY_ELEMENTS, MASS, SPRING, STROKES
from boomctl.synthesis.plants.symmetry import split_controller

MEASURED_YAW_HZ = 0.34  # the first frequency that the paper measured, where its Table 2 gives 0.245 Hz
_FREQUENCIES = np.geomspace(0.15, 130.0, 260)  # [rad/s], drawn: from below the slow yaw to beyond the accelerometers
_HIGH = 0.9  # fraction of the peak above which frequencies of the mesh are added for the exact boom
_EXACT_ELEMENTS, _EXACT_POLES = 40, 60  # of a mesh, those nearest to zero: around them the exact boom's steps are small
_FINE = 60  # elements of the finer mesh: frequencies below half the sampling rate as those of the exact beam to 1e-5
_SIDES = {"jolt": "sym", "yaw": "anti"}


@dataclass(frozen=True)
class SuspensionVerification(InField):
    """A suspension that is to be examined; a machine of its own has a family over springs and masses.

    Such a machine is examined as a whole, and its controller is one in continuous time.
    """

    family: AffineFamily | None = None

    def verify(self) -> tuple[tuple[Finding, ...], SigmaResult | None, tuple[SigmaResult, ...]]:
        """Return the findings, the singular values with the exact beam, and those over the uncertainty.

        Raises
        ------
        ValueError
            If the controller couples the symmetric and antisymmetric subsystems.
        """
        result, exact = [*self.over_the_box(), self.worst_deposit()], None
        if self.sampled:
            result.append(self.on_a_finer_mesh())
        elif self.family is None:
            exact = self.exact_sigma()
            result.append(self.on_the_exact_boom(exact))
        return tuple(result), exact, tuple(self.corner_sigma())

    @property
    def sampled(self) -> bool:
        """True for a controller in discrete time."""
        return self.K is not None and not self.K.isctime()

    def scaled(self, spring: float, mass: float, nozzles: bool = False) -> SecondOrderModel:
        """Return the boom with other springs and another mass, or the machine of the family there."""
        if self.family is not None:
            return self.family.at(self.family.normalize({"spring_factor": spring, "mass_factor": mass}))
        return replace(self, p=scaled_boom(self.p, spring, mass)).model(FAMILY_ELEMENTS, nozzles)

    def over_the_box(self) -> Iterator[Finding]:
        """Yield the findings for jolt and yaw over springs and masses, or for the full boom of a family."""
        if self.family is not None:
            yield from _over_the_box(self.family, self.K, ACTUATORS, TIPS, 0.0)
            return
        model, late = self.model(self.scenario.elements), self.delay if self.sampled else 0.0
        band = None if self.K is None else self.scenario.accelerometer_bandwidth_hz
        controllers = _controllers(model, self.K)
        for (half, side), plant in zip(_SIDES.items(), split_symmetric(model), strict=True):
            family = boom_family(
                self.p, SPRING, MASS, subsystem=half, elements=FAMILY_ELEMENTS, accelerometer_bandwidth_hz=band
            )
            K, ends = controllers[half], ([f"actuator_{side}"], [f"tip_{side}"])
            result = [*_over_the_box(family, K, *ends, late)]
            if self.K is not None:
                with warnings.catch_warnings():  # warnings on margins without sampling do not apply
                    warnings.simplefilter("ignore", MarginLossWarning)
                    result.insert(0, margins_finding(margins(plant, K, delay=late)))
            for item in result:
                yield replace(item, name=f"{half}: {item.name}")
        if self.K is not None and not self.sampled:
            yield self.at_the_measured_yaw(controllers["yaw"])

    def at_the_measured_yaw(self, K: control.StateSpace) -> Finding:
        """Return stability of the yaw over springs that bring its frequency from that of Table 2 to the measured 0.34 Hz.

        Springs as stiff as the boom measured, which had the dampers of Table 2: with strong ones the yaw has no frequency.
        """
        dampers = {name: getattr(BoomParameters(), name) for name in ("cradle_damping", "hinge_damping")}
        stiffest = spring_for_yaw(replace(self.p, **dampers), MEASURED_YAW_HZ, FAMILY_ELEMENTS)
        band, springs = (
            self.scenario.accelerometer_bandwidth_hz,
            {"spring_stiffness": (self.p.spring_stiffness, stiffest)},
        )
        stiffer = family_of(springs, self.p.replace, "yaw", "finite", FAMILY_ELEMENTS, "displacement", band)
        name = f"yaw frequency from Table 2 to the measured {MEASURED_YAW_HZ:g} Hz"
        return stability_finding(name, robust_stability(stiffer, K), K)

    def worst_deposit(self) -> Finding:
        """Return the least even deposit of runs over the field at the corners of the box: not proved between them."""
        corners = list(product(SPRING, MASS))
        runs = [replace(self, p=scaled_boom(self.p, *at)).run(self.scaled(*at, nozzles=True)) for at in corners]
        cv, (spring, mass) = max((spray.cv, at) for (_, (spray, *_)), at in zip(runs, corners, strict=True))
        text = (
            f"CV {100 * cv:.3g} % at spring {spring:g}, mass {mass:g}: the worst of {len(corners)} corners, not proved"
        )
        method = "simulation at the corners"
        return Finding("worst deposit found there", text, cv, key="deposit_cv_found_over_box", method=method)

    def on_a_finer_mesh(self) -> Finding:
        """Return whether the sampled loop is stable with so many elements."""
        largest = float(np.abs(self.to_tips(self.model(_FINE)).poles()).max())
        text = f"{'stable' if largest < 1.0 else 'NOT stable'}: largest pole {largest:.5f}"
        return Finding(f"mesh of {_FINE} elements", text, largest, largest < 1.0, method="poles of the loop")

    def on_the_exact_boom(self, curves: SigmaResult) -> Finding:
        """Return stability with the exact beam, by winding number; without a controller its largest singular value."""
        if self.K is None:
            text = f"largest singular value there {curves.peak:.4g}"
            return Finding("exact boom", text, curves, method="response of the exact beam")
        poles = self.model(_EXACT_ELEMENTS).to_statespace().poles()
        result = nyquist_stability(self.exact_plant, self.K, poles[np.argsort(np.abs(poles))][:_EXACT_POLES])
        verdict = "stable" if result.stable else f"NOT stable, {result.unstable_poles} unstable poles"
        text = (
            f"{verdict}: winding number {result.encirclements} of det(I - G K), followed over {result.nfev}"
            f" frequencies; largest singular value of the loop there {curves.peak:.4g}"
        )
        return Finding("exact boom", text, result, result.stable, method="winding number with the exact beam")

    def exact_plant(self, omega: Array) -> control.FrequencyResponseData:
        """Return the frequency response of the exact boom to platform and suspension; signals as of its model.

        An accelerometer is the second derivative of a tip behind a second-order low pass, ``-w^2 F(i w)``, with the
        damping ratio of the model's, the square root of one half.
        """
        result = exact_frequency_response(self.p, omega, (*ACTUATORS, *CONTROLS), (*TIPS, *STROKES))
        corner, s = 2.0 * np.pi * self.scenario.accelerometer_bandwidth_hz, 1j * np.asarray(omega, dtype=float)
        reads = s**2 * corner**2 / (s**2 + np.sqrt(2.0) * corner * s + corner**2)
        data = np.asarray(result.frdata)
        whole = np.concatenate([data, reads * data[: len(TIPS)]])
        names = {"inputs": [*ACTUATORS, *CONTROLS], "outputs": [*TIPS, *STROKES, *ACCELERATIONS]}
        return control.frd(whole, omega, **names, name="exact boom")

    def exact_sigma(self) -> SigmaResult:
        """Return singular values with the exact boom, also at the peaks of the mesh."""
        peaks = sigma(self.to_tips(self.model(self.scenario.elements)))
        omega = np.union1d(_FREQUENCIES, peaks.omega[peaks.sigma[0] > _HIGH * peaks.peak])
        if self.K is None:
            return sigma(exact_frequency_response(self.p, omega, ACTUATORS, TIPS))
        response = closed_loop_response(self.exact_plant, self.K, omega)
        return sigma(response, inputs=list(ACTUATORS), outputs=list(TIPS))

    def corner_sigma(self) -> Iterator[SigmaResult]:
        """Yield singular values at corners and middles of the edges; without the nominal boom."""
        below = np.pi / self.K.dt if self.K is not None and self.sampled else np.inf
        for spring, mass in product((*SPRING, 1.0), (*MASS, 1.0)):
            if (spring, mass) != (1.0, 1.0):
                yield sigma(self.to_tips(self.scaled(spring, mass)), _FREQUENCIES[below > _FREQUENCIES])


def _controllers(model: SecondOrderModel, K: control.StateSpace | None) -> dict[str, control.StateSpace]:
    """Return the controllers of jolt and yaw; zero controllers if there is none."""
    if K is None:
        ends = [{"inputs": [f"stroke_{side}"], "outputs": [f"suspension_{side}"]} for side in _SIDES.values()]
        return {name: control.ss([], [], [], [[0.0]], **names) for name, names in zip(_SIDES, ends, strict=True)}
    symmetric, antisymmetric, mixed = split_controller(model, K)
    if mixed > LEVEL:
        raise ValueError(f"controller: {100 * mixed:.2g} % of it leads from one half to the other; symmetrize it first")
    return {"jolt": symmetric, "yaw": antisymmetric}


def margins_finding(margins: Margins) -> Finding:
    """Return the margins of the first loop."""
    loop = margins.loops[0]
    low, high = loop.gain_margin
    gains = f"gain from {low:.2g} " + (f"to {high:.3g} times" if high < inf else "times upwards")
    phase = f"phase {loop.phase_margin_deg:.0f} degrees" if loop.phase_margin_deg < inf else "any phase"
    late = f"delay {1e3 * loop.delay_margin:.0f} ms" if loop.delay_margin < inf else "any delay"
    verified = "verified" if loop.disk_margin.verified else "NOT verified"
    text = f"{gains}, {phase}, {late}; disk margin {loop.disk_margin.alpha:.2f} ({verified})"
    method = "crossings in the response of the loop"
    return Finding("margins at the actuator", text, margins, loop.disk_margin.verified or None, method=method)


def _over_the_box(
    family: AffineFamily,
    K: control.StateSpace | None,
    inputs: Sequence[str],
    outputs: Sequence[str],
    delay: float,
) -> Iterator[Finding]:
    """Yield stability and the largest peak over springs and masses; forces of a discrete controller act later [s].

    A proved bound of the peak implies stability, which is proved separately only if there is none.
    """
    worst, box = worst_case(family, K, inputs, outputs, delay=delay), "springs ±30 %, boom mass ±20 %"
    proved, method = worst.upper_bound < inf, box_method("branch and bound", worst, K)
    if proved:
        yield Finding(box, "proved stable over the box: the worst peak is bounded", proved=True, method=method)
    else:
        yield stability_finding(box, robust_stability(family, K, delay=delay), K)
    name = f"worst peak there, {'proved' if proved else 'found'}"
    yield Finding(name, worst.summary, worst, proved or None, method=method)
