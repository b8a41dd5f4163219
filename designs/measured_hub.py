"""From a record to a controller that is proved: a motor that turns a flexible beam, known from one minute of measurement.

The rig is simulated, so that the truth is known: its amplifier, friction, stiffness and damping are none of the drawing's,
its encoder has counts, its strain gauge has noise. What follows knows the record and the drawing alone: frequency response,
fit, a box that holds the four parameters at once and a band for what they do not explain, PD with notch tuned over the box
and an H-infinity controller of the rig as fitted, and proofs of both sampled loops with their delay. At the end
the loop runs on the true rig.
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

# a steel ruler of 400 x 20 x 1 mm on a motor, as drawn
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
TORQUE, TOP_HZ = 0.05, 60.0  # N m (RMS) of the shaking, and its highest frequency
COUNT, GAUGE = 2.0 * np.pi / 8192, 2e-5  # rad, of the encoder; m, noise of the gauge that reads the tip
BAND_HZ = (0.5, 40.0)
MARGIN, DELAY = 0.05, 0.001  # of each parameter for what changes later; s, from sample to torque
FASTEST = 400.0  # rad/s, of the controller's poles: what 250 samples a second follow


def rig(p: dict[str, float]) -> SecondOrderModel:
    """Return motor and beam as a structure: torque asked for in, angle of the hub and place of the tip out."""
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
    """Return the record: torque asked for, and what encoder and gauge say, a sample each."""
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
    """Return the frequency response that the record tells."""
    return bc.estimate_frequency_response(*shaken(), STEP, frequency_range_hz=BAND_HZ)


@cache
def measured() -> FitResult:
    """Return the four parameters that the record tells, begun from the drawing."""
    return bc.fit(rig, response(), list(NOMINAL), NOMINAL, n_starts=1)


@cache
def family() -> Family:
    """Return the rigs that the record leaves open, and what may change later."""
    return measured().family(probability=0.95, range_margin=MARGIN)


def unexplained() -> control.StateSpace:
    """Return the bound of what the parameters do not explain of the loop's response: here noise and counts."""
    return uncertainty_weight(response(), rig(measured().parameters), "torque", "hub_angle")


def weighed(model: SecondOrderModel) -> control.StateSpace:
    """Return a generalized plant: the tip, hub's turn included, is to stand still; torque and encoder are not perfect."""
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
    """Return PD with a notch, the worst of the box as good as can be."""
    parts = tunable.pid(integral=False, omega_max=FASTEST) * tunable.notch(20.0, FASTEST)
    return bc.tune(weighed, structure=parts, family=family(), n_starts=1, fastest_pole=FASTEST)


@cache
def optimal() -> HInfinityResult:
    """Return the H-infinity controller of the rig as fitted, of full order: the same weights, the box is not asked."""
    return bc.h_infinity(weighed(rig(measured().parameters)), fastest_pole=FASTEST)


def sampled(design: TuneResult | HInfinityResult) -> control.StateSpace:
    """Return a controller as it runs, 250 times a second."""
    return bc.discretize(design.controller, STEP)


def proofs(K: control.StateSpace) -> tuple[bc.analysis.RobustStability, bc.analysis.WorstCase]:
    """Return what is proved of a sampled loop, its torque a millisecond late, over the whole box.

    Stability is proved with whatever is within the band of what the parameters do not explain.
    """
    return (
        bc.robust_stability(family(), K, delay=DELAY, additive_uncertainty=unexplained()),
        bc.worst_case(family(), K, "tip_force", "hub_angle", delay=DELAY, rtol=0.05),
    )


def on_the_rig(K: control.StateSpace, seconds: float = 2.0) -> Any:
    """Return the loop on the true rig: a push at the tip of 0.05 N for 0.2 s, the encoder with its counts."""
    t = STEP * np.arange(round(seconds / STEP) + 1)
    push = {"tip_force": np.where((t >= 0.2) & (t < 0.4), 0.05, 0.0)}
    plant = rig(TRUTH).to_statespace()
    return bc.simulate_loop(plant, K, t, push, sample_time=STEP, delay=DELAY, quantization=COUNT)


def design() -> MachineDesign:
    """Return the PD with notch, and what is proved of it and of the H-infinity controller beside it."""
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
            f"Known from one minute of record. The box holds gain, friction, stiffness and damping at once with 95 %, and"
            f" {100.0 * MARGIN:g} % more to either side. The sampled loop has {1.0 / STEP:g} samples a second, its torque"
            f" {1e3 * DELAY:g} ms late.",
            "The H-infinity controller is of the rig as fitted, for the same weights; the box enters by the proof alone.",
        ),
    )


def main() -> MachineResult:
    """Return what the controller is worth on the rig as fitted."""
    return design().evaluate()


if __name__ == "__main__":
    print(main())
