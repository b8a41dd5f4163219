"""From data to a verified controller: a motor that turns a flexible beam, identified from one minute of measurement.

The rig is simulated, so that its true parameters are known: amplifier gain, friction, stiffness and damping differ from the
drawing, the encoder is quantized, and the strain gauge has noise. Identification and design use only the record and the
drawing: estimation of the frequency response, parameter fit, a joint confidence box of the four parameters, an additive
uncertainty weight for the remaining model error, a PD controller with notch tuned over the box, and an H-infinity controller
for the fitted model. Stability of both sampled loops is proved with delay, and both are simulated on the true rig.
"""

from functools import cache
from typing import Any

import control
import numpy as np

import boomctl as bc
from boomctl import tunable
from boomctl.identification import FitResult, FrequencyResponseEstimate, uncertainty_weight
from boomctl.structure import SecondOrderModel
from boomctl.structure.families import Family
from boomctl.studies.machine import MachineDesign, MachineResult
from boomctl.synthesis import HInfinityResult
from boomctl.tuning import TuneResult

# steel ruler of 400 x 20 x 1 mm on a motor, nominal data of the drawing
DRAWN = bc.HubBeamParameters(
    length=0.4,
    density=7800.0,
    area=2e-5,
    youngs_modulus=2.0e11,
    second_moment=1.667e-12,
    hub_inertia=2e-3,
    hub_radius=0.02,
)
NOMINAL = {"gain": 1.0, "friction": 5e-3, "youngs_modulus": 2.0e11, "damping_ratio": 0.01}
TRUTH = {"gain": 0.91, "friction": 8e-3, "youngs_modulus": 1.86e11, "damping_ratio": 0.014}
STEP, SAMPLES, SEED = 0.004, 15_000, 0  # s; one minute
TORQUE, TOP_HZ = 0.05, 60.0  # N m (RMS) of the excitation, and its bandwidth
COUNT, GAUGE = 2.0 * np.pi / 8192, 2e-5  # rad, encoder resolution; m, noise of the tip displacement (strain gauge)
BAND_HZ = (0.5, 40.0)
MARGIN, DELAY = 0.05, 0.001  # relative enlargement of each parameter range, for drift; s, from sample to torque
FASTEST = 400.0  # rad/s, largest magnitude of controller poles, for sampling at 250 Hz


def rig(p: dict[str, float]) -> SecondOrderModel:
    """Return the model of motor and beam, with commanded torque and tip force to hub angle and tip displacement."""
    beam = bc.hub_beam(
        DRAWN.replace(youngs_modulus=p["youngs_modulus"], damping_ratio=p["damping_ratio"]), model="sfoam", modes=2
    )
    model = beam.to_second_order().select(["torque", "tip_force"], ["hub_angle", "tip_displacement"])
    C = np.array(model.C)
    C[0, 0] += p["friction"]
    columns = model.ports.B.copy()
    columns[:, :, 0] *= p["gain"]
    forces = dict(zip(model.input_labels, columns[0].T, strict=True))
    return SecondOrderModel(model.M, C, model.K, forces, dict(zip(model.output_labels, model.ports.L[0], strict=True)))


def shaken() -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Simulate the record: samples of the commanded torque, and of encoder and strain gauge."""
    rng = np.random.default_rng(SEED)
    omega = 2.0 * np.pi * np.fft.rfftfreq(2 * SAMPLES, STEP)
    noise = np.fft.rfft(rng.standard_normal(2 * SAMPLES)) * (omega < 2.0 * np.pi * TOP_HZ) * (omega > 0.0)
    torque = np.fft.irfft(noise)
    torque *= TORQUE / torque.std()
    spectrum, G = np.fft.rfft(torque), np.zeros((2, len(omega)), complex)
    G[:, 1:] = rig(TRUTH).frequency_response(omega[1:], ["torque"]).frdata[:, 0]
    angle, tip = np.fft.irfft(G * spectrum, axis=1)[:, SAMPLES:]
    seen = {
        "hub_angle": COUNT * np.round(angle / COUNT),
        "tip_displacement": tip + GAUGE * rng.standard_normal(SAMPLES),
    }
    return {"torque": torque[SAMPLES:]}, seen


@cache
def response() -> FrequencyResponseEstimate:
    """Estimate the frequency response from the record."""
    return bc.estimate_frequency_response(*shaken(), STEP, frequency_range_hz=BAND_HZ)


@cache
def measured() -> FitResult:
    """Fit the four parameters to the record; the initial values are those of the drawing."""
    return bc.fit(rig, response(), list(NOMINAL), NOMINAL, n_starts=1)


@cache
def family() -> Family:
    """Return the family of models within the joint confidence box, enlarged for drift."""
    return measured().family(probability=0.95, range_margin=MARGIN)


def unexplained() -> control.StateSpace:
    """Return the additive uncertainty weight for the error of the fitted response: here noise and quantization."""
    return uncertainty_weight(response(), rig(measured().parameters), "torque", "hub_angle")


def weighed(model: SecondOrderModel) -> control.StateSpace:
    """Return the generalized plant: rejection of torque and tip-force disturbances at hub and tip, with encoder noise."""
    return bc.generalized_plant(
        model,
        disturbances={"torque": 0.02, "tip_force": 0.05},
        performance={"hub_angle": 20.0, "tip_displacement": 50.0},
        effort={"torque": 5.0},
        noise={"hub_angle": 10.0 * COUNT},
        measurements="hub_angle",
        controls="torque",
    )


@cache
def tuned() -> TuneResult:
    """Tune a PD controller with notch for the worst case over the box."""
    parts = tunable.pid(integral=False, omega_max=FASTEST) * tunable.notch(20.0, FASTEST)
    return bc.tune(weighed, structure=parts, family=family(), n_starts=1, fastest_pole=FASTEST)


@cache
def optimal() -> HInfinityResult:
    """Design a full-order H-infinity controller for the fitted model, with the same weights, without the box."""
    return bc.h_infinity(weighed(rig(measured().parameters)), fastest_pole=FASTEST)


def sampled(design: TuneResult | HInfinityResult) -> control.StateSpace:
    """Discretize a controller at 250 Hz."""
    return bc.discretize(design.controller, STEP)


def proofs(K: control.StateSpace) -> tuple[bc.analysis.RobustStability, bc.analysis.WorstCase]:
    """Return robust stability and worst-case gain of a sampled loop over the box, with a delay of 1 ms.

    Robust stability also covers the additive uncertainty.
    """
    return (
        bc.robust_stability(family(), K, delay=DELAY, additive_uncertainty=unexplained()),
        bc.worst_case(family(), K, "tip_force", "hub_angle", delay=DELAY, rtol=0.05),
    )


def on_the_rig(K: control.StateSpace, seconds: float = 2.0) -> Any:
    """Simulate the loop on the true rig: a tip force of 0.05 N for 0.2 s, with the quantized encoder."""
    t = STEP * np.arange(round(seconds / STEP) + 1)
    push = {"tip_force": np.where((t >= 0.2) & (t < 0.4), 0.05, 0.0)}
    plant = rig(TRUTH).to_statespace()
    return bc.simulate_loop(plant, K, t, push, sample_time=STEP, delay=DELAY, quantization=COUNT)


def design() -> MachineDesign:
    """Return the PD controller with notch, with proofs for it and for the H-infinity controller."""
    fitted = measured()
    facts = {f"{name}": f"{fitted.values[name]:.5g}, {fitted.interval_text(name)}" for name in fitted.names}
    facts["intervals from"] = fitted.uncertainty_source
    for name, found in (("PD with notch", tuned()), ("H-infinity", optimal())):
        K = sampled(found)
        stable, worst = proofs(K)
        facts |= {
            f"{name}, states": str(K.nstates),
            f"{name}, sampled loop over the box": stable.summary,
            f"{name}, tip force to hub angle [rad/N]": worst.summary,
            f"{name}, largest angle on the true rig [rad]": f"{np.abs(on_the_rig(K)['hub_angle']).max():.3g}",
        }
    return MachineDesign(
        "measured_hub",
        "PD controller with notch for an identified beam",
        rig(fitted.parameters).to_statespace(),
        tuned().controller,
        inputs="tip_force",
        outputs=["hub_angle", "tip_displacement"],
        synthesis_info=facts,
        notes=(
            f"The model is identified from one minute of data. The box is a joint 95 % confidence region of gain, friction,"
            f" stiffness and damping, enlarged by {100.0 * MARGIN:g} % of each value on either side. The sampling rate is"
            f" {1.0 / STEP:g} Hz, the delay {1e3 * DELAY:g} ms.",
            "The H-infinity controller is designed for the fitted model with the same weights; only the proof uses the box.",
        ),
    )


def main() -> MachineResult:
    """Evaluate the controller on the fitted model."""
    return design().evaluate()


if __name__ == "__main__":
    print(main())
