# ---
# jupyter:
#   jupytext:
#     formats: ipynb,py:percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # 8. From data to a controller
#
# A motor turns a steel ruler. The data are a drawing and one minute of measurement: the motor was excited by noise,
# and an encoder and a strain gauge were sampled at 250 Hz. Amplifier gain, friction, stiffness and damping of the
# ruler are unknown.
#
# Here the rig is simulated, so that the true parameters are known. It is used twice: to simulate the record, and at
# the end to test the controller on the true rig. `boomctl design measured_hub` writes a report of the same design.

# %%
import tempfile
from functools import partial
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import boomctl as bc
from boomctl import tunable
from boomctl.structure import SecondOrderModel

plt.style.use("boomctl.plotting.look")  # or a style of your own

# %% [markdown]
# ## A model with unknown parameters
#
# Hub and ruler are as drawn. Friction acts at the hub, and the commanded torque is multiplied by the gain of the
# amplifier. Any function of parameters that returns a structure can be used here.

# %%
drawn = bc.HubBeamParameters(
    length=0.4,
    density=7800.0,
    area=2e-5,
    youngs_modulus=2e11,
    second_moment=1.667e-12,
    hub_inertia=2e-3,
    hub_radius=0.02,
)


def rig(p):
    beam = drawn.replace(youngs_modulus=p["youngs_modulus"], damping_ratio=p["damping_ratio"])
    model = bc.hub_beam(beam, model="sfoam", modes=2).to_second_order()
    friction = np.zeros_like(model.C)
    friction[0, 0] = p["friction"]
    inputs = dict(zip(model.input_labels, model.ports.B[0].T, strict=True))
    outputs = dict(zip(model.output_labels, model.ports.L[0], strict=True))
    return SecondOrderModel(
        model.M,
        model.C + friction,
        model.K,
        {"torque": p["gain"] * inputs["torque"], "tip_force": inputs["tip_force"]},
        {name: outputs[name] for name in ("hub_angle", "tip_displacement")},
    )


nominal = {"gain": 1.0, "friction": 5e-3, "youngs_modulus": 2.0e11, "damping_ratio": 0.01}
truth = {"gain": 0.91, "friction": 8e-3, "youngs_modulus": 1.86e11, "damping_ratio": 0.014}

# %% [markdown]
# ## The record
#
# The motor is excited by noise up to 60 Hz. The encoder is quantized, and the gauge has noise.

# %%
step, samples, count = 0.004, 15_000, 2.0 * np.pi / 8192
rng = np.random.default_rng(0)
omega = 2.0 * np.pi * np.fft.rfftfreq(2 * samples, step)
spectrum = np.fft.rfft(rng.standard_normal(2 * samples)) * (omega < 2.0 * np.pi * 60.0) * (omega > 0.0)
spectrum *= 0.05 / np.fft.irfft(spectrum).std()
G = rig(truth).frequency_response(omega[1:], ["torque"]).frdata[:, 0]
angle, tip = np.fft.irfft(np.c_[[0.0, 0.0], G] * spectrum, axis=1)[:, samples:]
torque = {"torque": np.fft.irfft(spectrum)[samples:]}
seen = {"hub_angle": count * np.round(angle / count), "tip_displacement": tip + 2e-5 * rng.standard_normal(samples)}

# %% [markdown]
# ## Frequency response
#
# The estimate has a standard deviation and a coherence at each frequency.

# %%
response = bc.estimate_frequency_response(torque, seen, step, frequency_range_hz=(0.5, 40.0))
print(response)
axes = response.plot()
plt.show()

# %% [markdown]
# ## Parameters and confidence intervals
#
# `bc.fit` starts from the values of the drawing. Its intervals take the correlation of the residuals over frequency
# into account.

# %%
fitted = bc.fit(rig, response, list(nominal), nominal, n_starts=1)
print(fitted)
print("truth:", ", ".join(f"{name} {value:g}" for name, value in truth.items()))
axes = fitted.plot()
plt.show()

# %% [markdown]
# ## A family of models
#
# The box contains all four parameters at once with a probability of 95 %, and is enlarged by five percent on either
# side for drift.

# %%
family = fitted.family(probability=0.95, range_margin=0.05)
print("\n".join(f"{name}: {low:.4g} to {high:.4g}" for name, (low, high) in family.ranges.items()))

# %% [markdown]
# The remaining error of the response, with its noise, is bounded by an additive uncertainty weight.

# %%
model = rig(fitted.parameters)
band = bc.identification.uncertainty_weight(response, model, "torque", "hub_angle")
w = response.omega
left = response.frdata[0, 0] - model.frequency_response(w, ["torque"], ["hub_angle"]).frdata[0, 0]
fig, ax = plt.subplots()
ax.loglog(w / (2 * np.pi), abs(response.frdata[0, 0]), label="measured")
ax.loglog(w / (2 * np.pi), abs(left), label="left by the fit")
ax.loglog(w / (2 * np.pi), abs(band(1j * w)), label="band")
ax.set(xlabel="frequency [Hz]", ylabel="torque to hub angle [rad/(N m)]")
ax.legend()
plt.show()

# %% [markdown]
# ## Tuned PD controller with notch
#
# It reads the encoder alone, and is tuned for the worst point of the box.

# %%
weighed = partial(
    bc.generalized_plant,
    disturbances={"torque": 0.02, "tip_force": 0.05},
    performance={"hub_angle": 20.0, "tip_displacement": 50.0},
    effort={"torque": 5.0},
    noise={"hub_angle": 10.0 * count},
    measurements="hub_angle",
    controls="torque",
)
structure = tunable.pid(integral=False, omega_max=400.0) * tunable.notch(20.0, 400.0)
design = bc.tune(weighed, structure=structure, family=family, n_starts=1, fastest_pole=400.0)
print(repr(design))

# %% [markdown]
# For comparison, an H-infinity controller for the same weights. It has as many states as the rig, and is designed for
# the fitted parameters alone; the proof covers the box.

# %%
optimal = bc.h_infinity(weighed(model), fastest_pole=400.0)
print(optimal)

# %% [markdown]
# ## Robust stability of the sampled loops
#
# The controllers run at 250 Hz, with a delay of one millisecond. Both loops are proved stable at every point of the
# box, with any additive uncertainty within the weight, and the gain from a force at the tip to the hub angle is
# bounded.

# %%
drives = {
    "PD with notch": bc.discretize(design.controller, step),
    "H-infinity": bc.discretize(optimal.controller, step),
}
for name, K in drives.items():
    print(name)
    print(bc.robust_stability(family, K, delay=0.001, additive_uncertainty=band))
    print(bc.worst_case(family, K, "tip_force", "hub_angle", delay=0.001, rtol=0.05))

# %% [markdown]
# Twice the number of states improves the bound by a few percent only. The simple controller is preferable.

# %% [markdown]
# ## C code
#
# The PD controller with notch as C99, with test vectors for the target.

# %%
with tempfile.TemporaryDirectory() as folder:
    drive = drives["PD with notch"]
    bc.write_controller(drive, Path(folder) / "drive.c")
    print([path.name for path in sorted(Path(folder).iterdir())])

# %% [markdown]
# ## Simulation of the true rig
#
# After a force at the tip for 0.2 s the hub returns to zero, with the quantized encoder.

# %%
t = step * np.arange(501)
push = {"tip_force": np.where((t >= 0.2) & (t < 0.4), 0.05, 0.0)}
loop = bc.simulate_loop(rig(truth), drive, t, push, sample_time=step, delay=0.001, quantization=count)
print(
    f"largest angle {np.abs(loop['hub_angle']).max():.4f} rad, at last {np.abs(loop['hub_angle'][-50:]).max():.5f} rad"
)
axes = loop.plot()
plt.show()
