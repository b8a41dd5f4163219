"""A suspension under your hands: springs and weights on sliders; what it is worth follows. `marimo run suspension.py`."""

import marimo

app = marimo.App(width="full", app_title="A boom's suspension, live")


@app.cell
def _():
    import time

    import marimo as mo
    import numpy as np
    import plotly.graph_objects as go
    from plotly.subplots import make_subplots

    import boomctl as bc

    return bc, go, make_subplots, mo, np, time


@app.cell
def _(mo):
    mo.md("""
    # A boom's suspension, live

    The yaw of a 12 m spray boom is damped by two actuators beside the springs, which an H-infinity controller drives. Move a
    slider: the controller is designed, verified and driven over a track for 40 s again. More weight is not always better. A
    controller that works hard holds the boom firmly, and a boom that is held firmly follows each yaw of the platform. Which
    weights leave the smallest deposit CV (0 is perfectly even spray), and what do they cost in margin and force?
    """)
    return


@app.cell
def _(bc, np):
    SPEED, SAMPLE_TIME = 3.0, 0.008  # of the tractor [m/s]; of the controller [s]
    SCALES = {
        "actuator_anti": 0.03,
        "suspension_anti": 150.0,
        "tip_anti": 0.2,
        "stroke_anti": 0.05,
        "tip_acceleration_anti": 1.0,
    }
    motion = bc.platform_motion(bc.iso_track("E", 200.0, seed=1), speed=SPEED, duration=40.0, sample_time=SAMPLE_TIME)
    platform = {"actuator_anti": motion.antisymmetric}
    FASTEST = 10.0  # of the frequencies that are drawn [Hz]

    def sprayed(run):
        tips_moved = np.outer([-1.0, 1.0], run["tip_anti"]) / np.sqrt(2.0)
        return bc.spray_deposit(run.time, tips_moved, [-6.0, 6.0], SPEED, nozzles=bc.nozzle_positions())

    return FASTEST, SAMPLE_TIME, SCALES, motion, platform, sprayed


@app.cell
def _(mo):
    def slider(label, start, stop, step, value):
        return mo.ui.slider(start=start, stop=stop, step=step, value=value, label=label, show_value=True)

    springs = slider("springs [N/m]", 600, 2000, 50, 1100)
    tips = slider("weight on the tips", 0.2, 4.0, 0.1, 1.0)
    stroke = slider("weight on the stroke", 0.5, 8.0, 0.5, 2.0)
    effort = slider("weight on the effort", 0.5, 8.0, 0.5, 2.0)
    mo.hstack([springs, tips, stroke, effort], wrap=True)
    return effort, springs, stroke, tips


@app.cell
def _(SAMPLE_TIME, SCALES, bc, motion, platform, springs, sprayed, time):
    _began = time.perf_counter()
    _parameters = bc.BoomParameters(spring_stiffness=float(springs.value))
    yaw = bc.split_symmetric(bc.spray_boom(_parameters, elements=12, accelerometer_bandwidth_hz=20.0))[1]
    small = bc.reduce(bc.scale_signals(yaw, SCALES), order=12, omega_range=(0.0, 80.0))
    passive = bc.sigma(yaw, inputs="actuator_anti", outputs="tip_anti")  # at frequencies that show each resonance
    passive_run = bc.simulate_loop(yaw, None, motion.time, platform, sample_time=SAMPLE_TIME)
    passive_spray = sprayed(passive_run)
    seconds_machine = time.perf_counter() - _began
    return passive, passive_run, passive_spray, seconds_machine, small, yaw


@app.cell
def _(SAMPLE_TIME, SCALES, bc, effort, motion, np, platform, small, sprayed, stroke, time, tips, yaw):
    _began = time.perf_counter()
    _plant = bc.generalized_plant(
        small.system,
        disturbances={"actuator_anti": bc.low_pass(1.0, 2.0), "suspension_anti": 0.05},
        performance={"tip_anti": tips.value, "stroke_anti": stroke.value},
        effort={"suspension_anti": bc.shelf(effort.value, 3600.0 * effort.value, 39.0, order=2)},
        noise={"stroke_anti": 0.02, "tip_acceleration_anti": 1.5},
        measurements=["stroke_anti", "tip_acceleration_anti"],
        controls=["suspension_anti"],
    )
    design = bc.h_infinity(_plant, nmeas=2, ncon=1)
    margins = bc.margins(small.system, design)
    _controller = design.controller
    _loop = bc.feedback_loop(yaw, _controller)
    active = bc.sigma(_loop, inputs="actuator_anti", outputs="tip_anti")
    step = bc.forced_response(_loop, np.linspace(0.0, 10.0, 500), {"actuator_anti": np.full(500, 0.05 * np.sqrt(2.0))})
    run = bc.simulate_loop(yaw, _controller, motion.time, platform, sample_time=SAMPLE_TIME, control_limit=212.0)
    spray = sprayed(run)
    seconds_design = time.perf_counter() - _began
    return active, design, margins, run, seconds_design, spray, step


@app.cell
def _(active, design, margins, mo, np, passive, passive_spray, run, seconds_design, seconds_machine, spray):
    _worth = {
        "verified norm of the loop": f"{design.gamma:.4g}",
        "verified peak, passive": f"{passive.peak:.4g} m/m",
        "verified peak, controlled": f"{active.peak:.4g} m/m",
        "disk margin, alpha": f"{margins.multiloop_input.alpha:.3g}",
        "deposit CV, passive": f"{100.0 * passive_spray.cv:.3g} %",
        "deposit CV, controlled": f"{100.0 * spray.cv:.3g} %",
        "largest force": f"{np.abs(run.controls['suspension_anti']).max() / np.sqrt(2.0):.3g} N",
        "computed in": f"{seconds_machine:.2f} + {seconds_design:.2f} s",
    }
    mo.hstack(
        [mo.stat(value, label=label, bordered=True) for label, value in _worth.items()], wrap=True, justify="start"
    )
    return


@app.cell
def _(FASTEST, active, go, make_subplots, np, passive, passive_run, run, spray, step):
    figure = make_subplots(
        rows=2,
        cols=2,
        vertical_spacing=0.16,
        subplot_titles=(
            "a tip over an actuator (yaw)",
            "platform yawed by 5 cm an actuator: a tip",
            "a tip on the track",
            "dose on the field, controlled",
        ),
    )
    for name, color, curve, motion_of in (
        ("passive", "#999999", passive, passive_run),
        ("controlled", "#0072b2", active, run),
    ):
        line = {"color": color}
        seen = curve.frequency_hz <= FASTEST
        x, y = curve.frequency_hz[seen], curve.sigma[0, seen]
        figure.add_trace(go.Scatter(x=x, y=y, name=name, mode="lines", line=line), 1, 1)
        tip = motion_of["tip_anti"][::5] / np.sqrt(2.0)
        figure.add_trace(go.Scatter(x=motion_of.time[::5], y=tip, mode="lines", line=line, showlegend=False), 2, 1)
    tip = step["tip_anti"] / np.sqrt(2.0)
    figure.add_trace(go.Scatter(x=step.time, y=tip, mode="lines", line={"color": "#0072b2"}, showlegend=False), 1, 2)
    dose = spray.evaluated_deposit.T[::2]
    along = spray.y_edges[spray.y_slice][::2]
    across = spray.x_edges[spray.x_slice]
    bar = {"len": 0.42, "y": 0.2, "title": "dose over nominal"}
    figure.add_trace(go.Heatmap(z=dose, x=across, y=along, zmin=0.9, zmax=1.1, colorscale="RdBu", colorbar=bar), 2, 2)
    for row, col, x, y in (
        (1, 1, "frequency [Hz]", "singular value [m/m]"),
        (1, 2, "time [s]", "tip [m]"),
        (2, 1, "time [s]", "tip [m]"),
        (2, 2, "across the track [m]", "along the track [m]"),
    ):
        figure.update_xaxes(title=x, row=row, col=col)
        figure.update_yaxes(title=y, row=row, col=col)
    figure.update_xaxes(type="log", row=1, col=1)
    figure.update_yaxes(type="log", row=1, col=1)
    figure.update_layout(
        height=640, margin={"t": 60, "b": 40}, template="simple_white", legend={"orientation": "h", "y": 1.12}
    )
    figure
    return


if __name__ == "__main__":
    app.run()
