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
# # 3. From LQR to H-infinity
#
# The boom's yaw has almost no damping: a damping ratio of 0.14 %. An active suspension can add damping: actuators
# beside the springs push between platform and boom. This notebook designs its controller in three ways and compares
# them.
#
# | method | it minimizes | it reads |
# |---|---|---|
# | LQR | the mean square of tip motion and force | all states, which are not measured |
# | LQG | the same, and it estimates the states | sensors |
# | H-infinity | the peak over frequency | sensors |
#
# The machine is symmetric, so that yaw and jolt are decoupled. The plant is the **yaw** subsystem: one disturbance
# (the platform turns), one control (a pair of forces), two sensors (stroke of the suspension, acceleration of the
# tip).

# %%
import matplotlib.pyplot as plt
import numpy as np

import boomctl as bc

plt.style.use("boomctl.plotting.look")  # or a style of your own
machine = bc.spray_boom(elements=12, accelerometer_bandwidth_hz=20.0)
jolt, yaw = bc.split_symmetric(machine)
disturbance, control, tip = "actuator_anti", "suspension_anti", "tip_anti"
sensors = ["stroke_anti", "tip_acceleration_anti"]
yaw

# %% [markdown]
# ## Model reduction
#
# A controller has as many states as the plant it is designed on. The plant is therefore reduced first. Meters and
# newtons have very different magnitudes; `scales` are the values that are scaled to one.
#
# **Question:** how many states are enough up to 80 rad/s (13 Hz)?

# %%
scales = {disturbance: 0.03, control: 150.0, tip: 0.2, "stroke_anti": 0.05, "tip_acceleration_anti": 0.5}
scaled = bc.scale_signals(yaw, scales)
for order in (4, 6, 8, 10, 12):
    small = bc.reduce(scaled, order=order, omega_range=(0.0, 80.0))
    print(f"{order:2d} states: verified error {small.error_norm:.3g}")
peak_scaled = bc.sigma(scaled).peak
print(f"the peak of the model itself: {peak_scaled:.4g}")
small.plot()

assert small.error_norm < 1e-2 * peak_scaled
plt.show()

# %% [markdown]
# **Result:** four states are not sufficient: the error is nearly as large as the peak of the model. With twelve
# states the error is a thousandth of the peak, but between the peaks it is almost as large as the response.
#
# **Conclusion:** use twelve states. A controller designed on the reduced model must be checked on the full one, as is
# done below.
#
# ## LQR
#
# The regulator `u = -F x` minimizes the integral of `tip² + r · force²`. The design parameter is the weight `r`.
#
# **Question:** what is the trade-off between tip motion and force? It is computed for many weights.

# %%
G = small.system
weights = np.geomspace(1e-3, 1e4, 15)
regulators = [bc.lqr(G, None, r, controls=[control], output_weight={tip: 1.0}) for r in weights]
tip_peak = [
    bc.sigma(d.closed_loop, inputs=disturbance, outputs=tip).peak * scales[tip] / scales[disturbance]
    for d in regulators
]
force = [bc.sigma(d.control_loop, inputs=disturbance).peak * scales[control] / scales[disturbance] for d in regulators]
for k in (0, 4, 8, 11, 14):
    print(f"r = {weights[k]:<7.3g} tip {tip_peak[k]:6.2f} m/m, force {force[k]:6.0f} N/m")
print(f"smallest return difference of all: {min(d.certificate.min_return_difference for d in regulators):.4f}")

# %%
fig, ax = plt.subplots(figsize=(6, 3.2), layout="constrained")
ax.semilogy(force, tip_peak, "o-")
for k in (0, 4, 8, 11, 14):
    ax.annotate(f" r = {weights[k]:.3g}", (force[k], tip_peak[k]), va="bottom")
ax.set_xlim(750, 1400)
ax.set(
    xlabel="largest force per platform motion [N/m]",
    ylabel="largest tip motion [m/m]",
    title="LQR: force against tip motion",
    ylim=(0.03, 500),
)
plt.show()

# %% [markdown]
# **Result:** from r = 1e+04 to r = 10 the tip motion falls from 108.51 to 3.46, and the force rises only from 779 to
# 915 N/m. Below r = 0.1 more force has almost no effect. The curve has kinks because LQR minimizes a mean, and the
# plot shows peaks.
#
# The return difference is never below 1. This is Kalman's inequality: such a loop has a phase margin of at least 60
# degrees, for all weights.
#
# **Conclusion:** a small force would be enough if all states were measured, which they are not.
#
# ## LQG and H-infinity
#
# Now the controller reads two sensors. Both methods need a *generalized plant*: disturbances, performance outputs,
# measurements and controls, with a weight for each scaled signal.


# %%
def generalized(effort):
    return bc.generalized_plant(
        G,
        disturbances={
            disturbance: bc.low_pass(1.0, 2.0),
            control: 0.05,
        },  # platform, mostly below 2 rad/s; unknown forces
        performance={tip: 1.0, "stroke_anti": 2.0},
        effort={
            control: bc.shelf(effort, 3600 * effort, 39.0, order=2)
        },  # rises above 5 rad/s: leave bending modes alone
        noise={"stroke_anti": 0.02, "tip_acceleration_anti": 1.5},
        measurements=sensors,
        controls=[control],
    )


P = generalized(effort=2.0)
lqg, hinf = bc.h2(P, nmeas=2, ncon=1), bc.h_infinity(P, nmeas=2, ncon=1)  # bc.h2: LQG with all weights in P
print(hinf.certificate.summary)

# %% [markdown]
# The H-infinity result has a certificate: a norm verified independently of the solver, and a lower bound for all
# controllers. They differ by less than one percent.
#
# **Question:** what is the performance on the *full* model?

# %%
controllers = {"LQG": lqg.controller, "H-infinity": hinf.controller}
loops = {name: bc.feedback_loop(yaw, K) for name, K in controllers.items()}
compared = bc.compare_sigma({"passive": yaw, **loops}, inputs=disturbance, outputs=tip)
ax = compared.plot()
curves = compared.curves
for name, curve in curves.items():
    print(f"{name:10} verified peak {curve.peak:7.2f}")
ax.set(xlim=(0.03, 10), ylim=(1e-2, 4e3), title="Yaw: platform to tip")

assert curves["H-infinity"].certified
assert curves["H-infinity"].peak < curves["LQG"].peak < curves["passive"].peak / 100
plt.show()

# %% [markdown]
# **Result:** both remove the peak of the yaw. The peak with LQG is 11.27, at the bending mode near 2.8 Hz. H-infinity
# minimizes the peak, so that its curve is flat: 9.39. The passive boom has 2459.94. At very low frequency no
# reduction is possible, because the boom must follow the rotation of the platform.
#
# **Conclusion:** use H-infinity to reduce a peak, LQG to reduce a mean square. Just above the peak, up to 1 Hz, both
# are worse than the passive boom (waterbed effect).
#
# ## Margins
#
# **Question:** how far may the machine differ from the model? The *disk margin* alpha permits simultaneous changes of
# gain and phase; it is between 0 and 2. The column `delay` is the delay margin.

# %%
margins = {name: bc.margins(yaw, K) for name, K in controllers.items()}
print(margins["H-infinity"])
side_by_side = bc.compare(margins)
print(side_by_side)
side_by_side.plot(signals=[control, "stroke_anti"])
plt.show()

# %% [markdown]
# **Result:** at the actuator (`suspension_anti`) H-infinity allows 1.545 times the gain, 39.55 degrees and a delay of
# 0.08849 s; its disk margin is 0.428, that of LQG 0.371. In the picture the Nyquist curves stay outside the disks.
# For simultaneous changes at all sensors and the actuator (`multiloop_io`), only 5 % remain.
#
# **Conclusion:** both margins are acceptable, none is large. LQG has no guaranteed margins; here they result from the
# weights.
#
# ## Trade-off
#
# **Question:** how does the weight of the effort change the result? Three quantities are compared: the peak, the disk
# margin at the actuator, and the worst peak when the springs are uncertain by 30 % and the beam's mass by 20 %.

# %%
family = bc.boom_family(subsystem="yaw", accelerometer_bandwidth_hz=20.0)
print("effort  gamma   peak  alpha  worst peak")
trade = {}
for effort in (0.2, 1.0, 2.0, 5.0, 20.0):
    d = bc.h_infinity(generalized(effort), nmeas=2, ncon=1)
    K = d.controller
    peak = bc.sigma(bc.feedback_loop(yaw, K), inputs=disturbance, outputs=tip).peak
    alpha = next(loop.disk_margin.alpha for loop in bc.margins(yaw, K).loops if loop.signal == control)
    trade[effort] = (d.gamma, peak, alpha, bc.worst_case(family, K, [disturbance], [tip]).worst_norm.lower_bound)
    print(f"{effort:6.1f} {d.gamma:6.2f} {peak:6.1f} {alpha:6.2f} {trade[effort][3]:8.1f}")

assert np.isinf(trade[0.2][3])
assert np.isfinite(trade[2.0][3])

# %% [markdown]
# **Result:** a small effort weight (0.2) has the smallest gamma, 0.76, and the worst result: on the full model its
# peak is 247, its margin 0.01, and within the uncertainty it is unstable (`inf`). A large effort weight (20) is
# robust and has little effect.
#
# **Conclusion:** gamma alone is no measure of performance, because it depends on the weights. Effort 2 has the lowest
# peak, 9.4, and stays stable over the whole uncertainty, where its peak can grow to 26.4.
#
# ## Robust stability
#
# The worst peak above is the largest one that was found. `worst_case` also proves that no machine in the box is worse by
# more than a thousandth. Stability, too, can be *proved* for the whole box of springs and masses:

# %%
proof = bc.robust_stability(family, controllers["H-infinity"])
print(proof.summary)
assert proof.proved

# %% [markdown]
# ## Sampling and delay
#
# A computer reads the sensors every few milliseconds, and the force acts after a delay. The delay margin at the
# actuator is 0.0885 s.
#
# **Question:** does the simulation confirm this margin? The sprayer drives over a rough track (class E, 3 m/s), with
# increasing delay of the force.

# %%
track = bc.iso_track("E", 130.0, seed=1)
motion = bc.platform_motion(track, speed=3.0, duration=40.0, sample_time=0.002)
turning = {disturbance: motion.antisymmetric}
K, runs = controllers["H-infinity"], {}
runs["passive"] = bc.simulate_loop(yaw, None, motion.time, turning, sample_time=0.002)
for delay in (0.002, 0.040, 0.080, 0.140):
    name = f"{1e3 * delay:.0f} ms late"
    runs[name] = bc.simulate_loop(yaw, K, motion.time, turning, sample_time=0.002, delay=delay)
rms = {name: float(np.std(run[tip])) for name, run in runs.items()}
for name, value in rms.items():
    print(f"{name:12} RMS of the tip {1e3 * value:8.1f} mm")

shown = bc.compare({name: runs[name] for name in ("passive", "140 ms late", "80 ms late", "2 ms late")})
axes = shown.plot(signals=[tip])
axes[0].set(ylim=(-0.15, 0.15), ylabel="tip, yaw part [m]")

assert rms["80 ms late"] < 0.5 * rms["passive"] < rms["140 ms late"]
plt.show()

# %% [markdown]
# **Result:** with 2 ms and with 80 ms the loop is stable: the tip moves 13.4 and 13.8 mm RMS, passive 48.9 mm. With
# 140 ms it is unstable at 2.8 Hz, the bending mode, not the yaw.
#
# **Conclusion:** the simulation confirms the delay margin. The delay destabilizes a mode at high frequency, here the
# first mode that is not controlled.
#
# **Question:** how large may the sampling time be? boomctl raises an error if it is too large for the poles of the
# controller:

# %%
try:
    bc.simulate_loop(yaw, K, motion.time, turning, sample_time=0.02)
except ValueError as error:
    print(error)

# %% [markdown]
# The fast poles are caused by the weight of the effort. `bc.reduce_controller` removes them and verifies the
# resulting loop.

# %%
slow = bc.reduce_controller(P, hinf, fastest_pole=60.0)
print(f"{hinf.controller.nstates} states become {slow.order}, verified norm {hinf.gamma:.3f} becomes {slow.gamma:.3f}")
K_slow = slow.controller
at_20_ms = bc.simulate_loop(yaw, K_slow, motion.time, turning, sample_time=0.02, delay=0.02)
print(f"sampled every 20 ms, 20 ms late: RMS of the tip {1e3 * np.std(at_20_ms[tip]):.1f} mm")
sampled = bc.margins(yaw, bc.discretize(K_slow, 0.02), delay=0.02)  # exact at the samples
for name, found in {"continuous": bc.margins(yaw, K_slow), "sampled": sampled}.items():
    print(
        f"{name:10} delay margin {found[control].delay_margin:.4f} s, disk margin {found[control].disk_margin.alpha:.3f}"
    )

# %% [markdown]
# **Conclusion:** after the fast poles are gone, a computer that samples every 20 ms does nearly the same: 13.5 mm.
# The verified norm rose from 1.355 to 1.393. `bc.margins` of the sampled loop explains this: the disk margin is
# 0.356, and the delay margin of 0.1045 s is reduced by the 20 ms and half a sample.
#
# What remains is to join the controllers of yaw and jolt (`bc.join_symmetric`), and to write the result to a file
# (`bc.write_controller`). The command `boomctl design h_infinity_split --out DIR` does all of it and writes a report.
