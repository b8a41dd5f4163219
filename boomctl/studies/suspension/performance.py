"""What one suspension does: singular values with a certified peak, a run over the field, the spray it leaves."""

from dataclasses import dataclass, field, replace

import numpy as np

from boomctl.analysis.loops import feedback_loop
from boomctl.analysis.model_norm import hinf_norm
from boomctl.analysis.norm import NormCertificate
from boomctl.analysis.sigma import SigmaResult, sigma
from boomctl.boom.model import ACTUATORS, TIPS
from boomctl.boom.parameters import BoomParameters
from boomctl.boom.spray import SprayResult, nozzle_positions, spray_by_motion
from boomctl.checks import nonnegative
from boomctl.lti.python_control import control
from boomctl.printing import compact
from boomctl.report import number
from boomctl.simulation.contact.friction import CoulombFriction
from boomctl.simulation.loop import simulate_loop
from boomctl.simulation.result import LoopResult
from boomctl.structure.model import SecondOrderModel
from boomctl.studies.findings import Finding, stored
from boomctl.studies.suspension.scene import CONTROLS, STROKES, FieldScene, suspension_model
from boomctl.synthesis.plants.generalized import select_channels

_FREQUENCIES = np.geomspace(0.15, 130.0, 400)  # [rad/s], drawn beside those that resolve the peaks
PEAK_DIGITS = 4  # of peaks in tables: two of them that tables set beside each other differ by more


@dataclass(frozen=True)
class Performance:
    """What a suspension does.

    Attributes
    ----------
    title : str
        What the suspension is called.
    sigma : SigmaResult
        Singular values from platform actuators to tips; the peak is certified.  With a discrete controller those at the
        samples, of a platform that is held from one to the next.
    jolt, yaw : NormCertificate
        Certified peaks of the symmetric and the antisymmetric part.
    run : LoopResult
        The run over the field, run-in, limits, sampling, delay and quantisation included.
    spray, spray_by_jolt, spray_by_yaw : SprayResult
        Spray of the whole motion, of its symmetric and of its antisymmetric part.
    sampled : bool
        Whether the singular values are those at the samples of a discrete controller.
    """

    title: str
    sigma: SigmaResult = field(repr=False)
    jolt: NormCertificate
    yaw: NormCertificate
    run: LoopResult = field(repr=False)
    spray: SprayResult = field(repr=False)
    spray_by_jolt: SprayResult = field(repr=False)
    spray_by_yaw: SprayResult = field(repr=False)
    sampled: bool = False

    __repr__ = compact

    def __figures__(self) -> dict[str, float]:
        """Return what a comparison shows."""
        peaks = {"H-infinity norm": self.sigma.peak, "of jolt": self.jolt.lower, "of yaw": self.yaw.lower}
        return peaks | self.spray.__figures__() | {"stroke: peak [m]": self.stroke} | self.run.__figures__()

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What it comes to: for tables in words, for ``results.json`` as numbers."""
        spray, run = self.spray, self.run
        return (
            *stored(title=self.title, peak_upper_bound=self.sigma.certificate.upper, peak_omega=self.sigma.peak_omega),
            _peak("certified peak, platform to tips", self.sigma.peak, "peak"),
            _peak("certified peak of the yaw", self.yaw.lower, "yaw_peak"),
            _peak("certified peak of the jolt", self.jolt.lower, "jolt_peak"),
            _share("deposit CV", spray.cv, "deposit_cv"),
            _share("share outside ±10 %", spray.share_outside_10, "share_outside_10"),
            _share("share outside ±20 %", spray.share_outside_20, "share_outside_20"),
            Finding("doses", text=f"{spray.lowest_dose:.2f} to {spray.highest_dose:.2f}"),
            _share("RMS tip speed over driving speed", spray.relative_tip_speed),
            _share("deposit CV by jolt alone", self.spray_by_jolt.cv, "deposit_cv_jolt"),
            _share("deposit CV by yaw alone", self.spray_by_yaw.cv, "deposit_cv_yaw"),
            Finding("largest stroke", self.stroke, "mm", text=f"{1e3 * self.stroke:.1f}", key="stroke"),
            Finding("largest force", self.force, "N", text=f"{self.force:.1f}" if run.controls else "-", key="force"),
            *stored(worst_dose=spray.worst_dose, rms_tip_speed=spray.rms_tip_speed, force_rate=self.force_rate),
            *stored(end_stops_hit=len(run.stops), saturation_share=run.saturation_share),
        )

    @property
    def stroke(self) -> float:
        """Largest stroke of the run [m]."""
        return max(float(np.abs(values).max()) for values in self.run.strokes.values())

    @property
    def force(self) -> float:
        """Largest force of an actuator in the run [N]; 0 of a passive suspension."""
        return max((float(np.abs(values).max()) for values in self.run.controls.values()), default=0.0)

    @property
    def force_rate(self) -> float:
        """Largest change of an actuator's force from sample to sample [N/s]."""
        step = self.run.sample_time
        return max((float(np.abs(np.diff(f)).max()) / step for f in self.run.controls.values()), default=0.0)


def _peak(name: str, value: float, key: str) -> Finding:
    return Finding(name, value, proved=True, text=number(value, PEAK_DIGITS), key=key)


def _share(name: str, value: float, key: str = "") -> Finding:
    return Finding(name, value, "%", text=f"{100 * value:.2f}", key=key)


def performance(
    title: str,
    scene: FieldScene,
    parameters: BoomParameters,
    controller: control.StateSpace | None = None,
    plant: control.StateSpace | None = None,
    friction: CoulombFriction | None = None,
    *,
    delay: float | None = None,
) -> Performance:
    """Return what a suspension does in a scene: singular values, a run over the field, the spray it leaves.

    Parameters
    ----------
    title : str
        What the suspension is called.
    scene : FieldScene
        The field, the sensors and the limits.
    parameters : BoomParameters
        The machine, passive parts of the suspension included.
    controller : control.StateSpace, optional
        ``u = K y``; without one the suspension is passive.  A discrete one runs at its own sampling time, and its
        singular values are those of the sampled loop.
    plant : control.StateSpace, optional
        The machine, where the controller reads more than the boom with its sensors offers; by default that boom.
    friction : CoulombFriction, optional
        In the cradle, during the run.
    delay : float, optional
        Time between a sample and the moment its forces act [s]; by default that of the scene.

    Returns
    -------
    Performance
        Certified peaks of the whole and of jolt and yaw alone, the run, and the spray.

    Raises
    ------
    TypeError, ValueError
        As for :func:`boomctl.simulate_loop`.

    Examples
    --------
    >>> import boomctl as bc
    >>> field = bc.studies.FieldScene(run_in=5.0, duration=10.0)
    >>> passive = bc.studies.performance("as published", field, bc.BoomParameters())
    >>> round(float(passive.sigma.peak)), bool(passive.stroke < 0.05)  # certified peak; largest stroke [m]
    (2458, True)
    """
    model: SecondOrderModel | control.StateSpace
    model = (
        suspension_model(parameters, scene.elements, scene.accelerometer_hz, nozzles=True) if plant is None else plant
    )
    late = scene.delay if delay is None else nonnegative("delay", delay)
    loop = platform_to_tips(model, controller, late)
    run, sprays = field_run(scene, parameters, controller, plant=model, friction=friction, delay=late)
    return Performance(
        title,
        _loop_sigma(loop),
        _half_norm(loop, 1.0),
        _half_norm(loop, -1.0),
        run,
        *sprays,
        sampled=loop.isdtime(strict=True),
    )


def field_run(
    scene: FieldScene,
    parameters: BoomParameters,
    controller: control.StateSpace | None,
    *,
    plant: SecondOrderModel | control.StateSpace,
    friction: CoulombFriction | None = None,
    delay: float,
) -> tuple[LoopResult, tuple[SprayResult, SprayResult, SprayResult]]:
    """Return a run over the field, and the spray of the whole motion, of its symmetric and of its antisymmetric part."""
    motion = scene.motion()
    run = simulate_loop(
        plant,
        controller,
        {"actuator_left": motion.left, "actuator_right": motion.right},
        motion.time,
        sample_time=scene.sample_time if controller is None or controller.isctime() else controller.dt,
        delay=0.0 if controller is None else delay,
        force_limit=None if controller is None else dict.fromkeys(CONTROLS, scene.force_limit),
        stroke_limit=dict(zip(STROKES, [(scene.stroke_limit, name) for name in CONTROLS], strict=True)),
        quantization=None if controller is None else scene.quantization(tuple(controller.input_labels)),
        friction=friction,
    )
    names = sorted(name for name in run.outputs if name.startswith("nozzle_"))  # of a plant that reads them
    nozzles = nozzle_positions(parameters.length)
    points = np.concatenate([[-parameters.length / 2], nozzles if names else [], [parameters.length / 2]])
    moved = np.array([run[name] for name in (TIPS[0], *names, TIPS[1])])
    record = run.time >= run.time[0] + scene.run_in
    return run, spray_by_motion(run.time[record], moved[:, record], points, scene.speed, nozzles=nozzles)


def platform_to_tips(
    model: SecondOrderModel | control.StateSpace,
    controller: control.StateSpace | None,
    delay: float = 0.0,
) -> control.StateSpace:
    """Return the closed loop from the platform to the tips, or the plant alone without a controller.

    A delay [s] is that of a discrete controller; a continuous one has none.
    """
    if controller is not None:
        whole = feedback_loop(model, controller, delay=0.0 if controller.isctime() else delay)
    else:
        whole = model.to_statespace() if isinstance(model, SecondOrderModel) else model
    return select_channels(whole, list(ACTUATORS), list(TIPS))


def _loop_sigma(loop: control.StateSpace) -> SigmaResult:
    """Return the loop's singular values where its peaks are, and from slow yaw to where the boom no longer follows."""
    peaks = sigma(loop)
    there = _FREQUENCIES if loop.isctime() else _FREQUENCIES[np.pi / loop.dt > _FREQUENCIES]
    others = sigma(loop, np.setdiff1d(there, peaks.omega))
    omega = np.concatenate([peaks.omega, others.omega])
    order = np.argsort(omega)
    return replace(peaks, omega=omega[order], sigma=np.hstack([peaks.sigma, others.sigma])[:, order])


def _half_norm(loop: control.StateSpace, parity: float) -> NormCertificate:
    """Return the certified peak of the jolt, whose left side moves as the right one, or of the yaw, against it: -1."""
    half = np.sqrt(0.5) * np.array([parity, 1.0])
    return hinf_norm(control.ss(loop.A, loop.B @ half[:, None], half @ loop.C, half @ loop.D @ half[:, None], loop.dt))
