"""Performance of a suspension: singular values with a verified peak, a simulation on the field, the spray."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from boomctl.analysis.loops import feedback_loop
from boomctl.analysis.model_norm import hinf_norm
from boomctl.analysis.norm import NormBounds
from boomctl.analysis.sigma import SigmaResult, sigma
from boomctl.boom.model import ACTUATORS, TIPS
from boomctl.boom.parameters import BoomParameters
from boomctl.boom.spray import SprayResult, nozzle_positions, spray_deposit_components
from boomctl.checks import nonnegative
from boomctl.lti.python_control import control
from boomctl.printing import compact
from boomctl.simulation.loop import simulate_loop
from boomctl.simulation.result import LoopResult
from boomctl.structure.model import SecondOrderModel
from boomctl.studies.evaluation import Finding, numbers, peak_finding
from boomctl.studies.suspension.scenario import ACCELERATIONS, CONTROLS, STROKES, FieldScenario, suspension_model
from boomctl.synthesis.plants.generalized import select_channels
from boomctl.threads import one_blas_thread

_FREQUENCIES = np.geomspace(0.15, 130.0, 400)  # [rad/s], in addition to those that resolve the peaks.
_RUN = "simulation"


@dataclass(frozen=True)
class Performance:
    """Performance of a suspension.

    Attributes
    ----------
    title : str
        Name of the suspension.
    sigma : SigmaResult
        Singular values from platform actuators to tips; the peak is verified.  With a discrete controller those at the
        samples, of a platform that is held from one to the next.
    jolt, yaw : NormBounds
        Verified peaks of the symmetric and the antisymmetric part.
    run : LoopResult
        The run over the field, run-in, limits, sampling, delay and quantization included.
    spray, spray_by_jolt, spray_by_yaw : SprayResult
        Spray of the whole motion, of its symmetric and of its antisymmetric part.
    warmup_time : float
        Time of the run before the evaluation of the deposit starts [s].
    """

    title: str
    sigma: SigmaResult = field(repr=False)
    jolt: NormBounds
    yaw: NormBounds
    run: LoopResult = field(repr=False)
    spray: SprayResult = field(repr=False)
    spray_by_jolt: SprayResult = field(repr=False)
    spray_by_yaw: SprayResult = field(repr=False)
    warmup_time: float = 0.0

    __repr__ = compact

    @property
    def findings(self) -> tuple[Finding, ...]:
        """The results for tables: verified peaks, spray, and from the largest stroke on the run."""
        spray, controlled, hits = self.spray, self.run.saturation_fraction, len(self.run.stop_contacts)
        force, rate = (f"{self.force:.1f}", f"{self.force_rate:.0f}") if controlled else ("-", "-")
        return (
            peak_finding("verified peak, platform to tips", self.sigma.certificate, "peak"),
            peak_finding("verified peak of the yaw", self.yaw, "yaw_peak"),
            peak_finding("verified peak of the jolt", self.jolt, "jolt_peak"),
            _percent("deposit CV [%]", spray.cv, "deposit_cv"),
            _percent("share outside ±10 % [%]", spray.share_outside_10, "share_outside_10"),
            _percent("share outside ±20 % [%]", spray.share_outside_20, "share_outside_20"),
            Finding("doses", f"{spray.min_dose:.2f} to {spray.max_dose:.2f}", method=_RUN),
            _percent("RMS tip speed over driving speed [%]", spray.relative_tip_speed),
            _percent("deposit CV by jolt alone [%]", self.spray_by_jolt.cv, "deposit_cv_jolt"),
            _percent("deposit CV by yaw alone [%]", self.spray_by_yaw.cv, "deposit_cv_yaw"),
            Finding("largest stroke [mm]", f"{1e3 * self.stroke:.1f}", self.stroke, key="stroke", method=_RUN),
            Finding("end stops hit", str(hits), hits, key="end_stops_hit", method=_RUN),
            Finding("largest force [N]", force, self.force, key="force", method=_RUN),
            Finding("largest force rate [N/s]", rate, self.force_rate, key="force_rate", method=_RUN),
            _percent("time at the force limit [%]", max(controlled.values(), default=0.0)),
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the numbers, for JSON.

        Returns
        -------
        dict
            Numbers and texts that JSON can hold.
        """
        return {
            "title": self.title,
            "peak_upper_bound": self.sigma.certificate.upper_bound,
            "peak_omega": self.sigma.peak_omega,
            "worst_dose": self.spray.worst_dose,
            "rms_tip_speed": self.spray.rms_tip_speed,
            "saturation_fraction": self.run.saturation_fraction,
            **numbers(self.findings),
        }

    @property
    def stroke(self) -> float:
        """Largest stroke of the run [m]."""
        return max(float(np.abs(values).max()) for values in self.run._strokes.values())

    @property
    def force(self) -> float:
        """Largest force of an actuator in the run [N]; 0 of a passive suspension."""
        return max((float(np.abs(values).max()) for values in self.run.controls.values()), default=0.0)

    @property
    def force_rate(self) -> float:
        """Largest change of an actuator's force from sample to sample after the run-in, which begins with a jump [N/s].

        From one time of the run to the next where these are longer.
        """
        time, forces = self.run.time, self.run.controls.values()
        step, evaluated = max(self.run.sample_time, time[1] - time[0]), time >= time[0] + self.warmup_time
        return max((float(np.abs(np.diff(force[evaluated])).max()) / step for force in forces), default=0.0)


def _percent(name: str, value: float, key: str = "") -> Finding:
    return Finding(name, f"{100 * value:.2f}", value, key=key, method=_RUN)


@one_blas_thread
def evaluate_suspension(
    title: str,
    scenario: FieldScenario,
    parameters: BoomParameters,
    controller: control.StateSpace | None = None,
    plant: control.StateSpace | None = None,
    *,
    delay: float | None = None,
) -> Performance:
    """Evaluate a suspension in a scenario: singular values, a run over the field, and the spray deposit.

    Parameters
    ----------
    title : str
        Name of the suspension.
    scenario : FieldScenario
        The field, the sensors and the limits.
    parameters : BoomParameters
        The machine, passive parts of the suspension included.
    controller : control.StateSpace, optional
        ``u = K y``; without one the suspension is passive.  A discrete one runs at its own sampling time, and its
        singular values are those of the sampled loop.
    plant : control.StateSpace, optional
        The machine, where the controller reads more than the boom with its sensors offers; by default that boom.
    delay : float, optional
        Computation delay [s]; by default that of the scenario.

    Returns
    -------
    Performance
        Verified peaks of the whole and of jolt and yaw alone, the run, and the spray.

    Raises
    ------
    TypeError, ValueError
        See :func:`boomctl.simulate_loop`.

    Examples
    --------
    >>> import boomctl as bc
    >>> field = bc.studies.FieldScenario(warmup_time=5.0, duration=10.0)
    >>> passive = bc.studies.evaluate_suspension("as published", field, bc.BoomParameters())
    >>> round(float(passive.sigma.peak)), bool(passive.stroke < 0.05)  # verified peak; largest stroke [m]
    (2458, True)
    """
    late = scenario.delay if delay is None else nonnegative("delay", delay)
    boom = InField(parameters, controller, scenario, late)
    machine = boom.model(scenario.elements, nozzles=True) if plant is None else plant
    loop = boom.to_tips(machine)
    run, sprays = boom.run(machine)
    peaks = _half_norm(loop, 1.0), _half_norm(loop, -1.0)
    return Performance(title, _loop_sigma(loop), *peaks, run, *sprays, warmup_time=scenario.warmup_time)


@dataclass(frozen=True)
class InField:
    """A boom with its suspension in a field.

    Attributes
    ----------
    p : BoomParameters
        Of the machine, passive parts of the suspension included.
    K : control.StateSpace or None
        ``u = K y``; None of springs and dampers alone.
    scenario : FieldScenario
    delay : float
        Time between a sample and the moment its forces act [s].
    """

    p: BoomParameters
    K: control.StateSpace | None
    scenario: FieldScenario
    delay: float = 0.0

    def model(self, elements: int, nozzles: bool = False) -> SecondOrderModel:
        """Return the boom with its sensors."""
        return suspension_model(self.p, elements, self.scenario.accelerometer_bandwidth_hz, nozzles)

    def to_tips(self, machine: SecondOrderModel | control.StateSpace) -> control.StateSpace:
        """Return the loop from the platform to the tips: with the controller, if there is one, its forces late if sampled."""
        if self.K is not None:
            whole = feedback_loop(machine, self.K, delay=0.0 if self.K.isctime() else self.delay)
        else:
            whole = machine.to_statespace() if isinstance(machine, SecondOrderModel) else machine
        return select_channels(whole, list(ACTUATORS), list(TIPS))

    def run(
        self, machine: SecondOrderModel | control.StateSpace
    ) -> tuple[LoopResult, tuple[SprayResult, SprayResult, SprayResult]]:
        """Return a run over the field, and the spray of all motion, of its symmetric and of its antisymmetric part."""
        K, scenario, motion = self.K, self.scenario, self.scenario.motion()
        active: dict[str, Any] = {}
        if K is not None:
            steps = dict.fromkeys(STROKES, scenario.stroke_resolution) | dict.fromkeys(
                ACCELERATIONS, scenario.acceleration_resolution
            )
            active = {
                "delay": self.delay,
                "control_limit": dict.fromkeys(CONTROLS, scenario.control_limit),
                "quantization": {name: steps[name] for name in K.input_labels if steps.get(name)},
            }
        run = simulate_loop(
            machine,
            K,
            motion.time,
            {"actuator_left": motion.left, "actuator_right": motion.right},
            sample_time=scenario.sample_time if K is None or K.isctime() else K.dt,
            end_stop=dict(zip(STROKES, [(scenario.end_stop, name) for name in CONTROLS], strict=True)),
            **active,
        )
        names = sorted(name for name in run.outputs if name.startswith("nozzle_"))  # of a machine that reads them
        nozzles, half = nozzle_positions(self.p), self.p.length / 2
        points = np.concatenate([[-half], nozzles if names else [], [half]])
        moved = np.array([run[name] for name in (TIPS[0], *names, TIPS[1])])
        record = run.time >= run.time[0] + scenario.warmup_time
        return run, spray_deposit_components(
            run.time[record], moved[:, record], points, scenario.speed, nozzles=nozzles
        )


def _loop_sigma(loop: control.StateSpace) -> SigmaResult:
    """Return the loop's singular values where its peaks are, and from slow yaw to where the boom no longer follows."""
    peaks = sigma(loop)
    there = _FREQUENCIES if loop.isctime() else _FREQUENCIES[np.pi / loop.dt > _FREQUENCIES]
    others = sigma(loop, np.setdiff1d(there, peaks.omega))
    omega = np.concatenate([peaks.omega, others.omega])
    order = np.argsort(omega)
    return replace(peaks, omega=omega[order], sigma=np.hstack([peaks.sigma, others.sigma])[:, order])


def _half_norm(loop: control.StateSpace, parity: float) -> NormBounds:
    """Return the verified peak of the jolt, whose left side moves as the right one, or of the yaw, against it: -1."""
    half = np.sqrt(0.5) * np.array([parity, 1.0])
    return hinf_norm(control.ss(loop.A, loop.B @ half[:, None], half @ loop.C, half @ loop.D @ half[:, None], loop.dt))
