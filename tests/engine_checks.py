"""Questions that the tests of several engines ask alike."""

from __future__ import annotations

import numpy as np

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import kinematics
from analytic.mechanism import Mechanism
from analytic.mechanism.file import load
from analytic.paper.clearance import displaced
from analytic.paper.kinetostatics import kinetostatics
from asked import request_of
from linkages import inverted_slider, scotch_yoke, six_bar_driven_from_the_rocker
from ode import ClearanceMotion, clearance_four_bar_ode
from sim_models.common.journal import free_share
from sim_models.engine import Engine, JointModel, Motion, Trace
from sim_models.run.path import CrankPath

PAPER_RANGE = np.arange(20.0, 161.0, 5.0)
SEVERAL = {"D": 1e-4, "F": 2e-4, "B": 1e-4, "G": 5e-5}
LINKAGES = {
    "crank-rocker": (load("crank-rocker"), np.linspace(0.0, 360.0, 19)),
    "slider-crank": (load("slider-crank"), np.linspace(0.0, 360.0, 19)),
    "six-bar": (load("six-bar"), np.linspace(0.0, 360.0, 19)),
    "six-bar from its rocker": (six_bar_driven_from_the_rocker(), np.linspace(105.0, 125.0, 9)),
    "inverted slider in reverse": (inverted_slider(), np.linspace(0.0, 360.0, 19)),
    "scotch yoke": (scotch_yoke(), np.linspace(20.0, 160.0, 9)),
}


def run(
    engine: Engine, mechanism: Mechanism, joint_model: JointModel, motion: Motion, degrees: object, **options: object
) -> Trace:
    return engine.simulate(request_of(mechanism, joint_model, motion, np.radians(degrees), **options))


def vector(trace: Trace, name: str) -> np.ndarray:
    return trace.signals[f"{name}_x"] + 1j * trace.signals[f"{name}_y"]


def reaction_errors(trace: Trace, mechanism: Mechanism, joint: str = "B") -> tuple[float, float]:
    """Largest error of a reaction's direction (deg) and magnitude (%) against the analytic equilibrium."""
    found = displaced(
        Assembly(mechanism),
        trace.crank_angle,
        mechanism.speed or 1.0,
        inertia=trace.motion == "driven",
        clearances=dict(trace.clearance),
    )
    assert not found.flags
    signals = found.signals()
    ratio = vector(trace, f"reaction_{joint}") / (signals[f"reaction_{joint}_x"] + 1j * signals[f"reaction_{joint}_y"])
    return float(np.degrees(np.abs(np.angle(ratio))).max()), float(100 * np.abs(np.abs(ratio) - 1).max())


def assert_kinetostatics(trace: Trace, mechanism: Mechanism, relative: float) -> None:
    """Every signal of an ideal run, to ``relative`` of its kind's largest value."""
    motion = kinematics(Assembly(mechanism), trace.crank_angle, mechanism.speed or 1.0)
    expected = kinetostatics(motion, inertia=trace.motion == "driven").signals()
    force = max(
        np.abs(values).max()
        for name, values in expected.items()
        if name.startswith("reaction") and name[-2:] in ("_x", "_y")
    )
    for name, values in expected.items():
        if trace.motion == "static" and name.endswith("velocity"):
            np.testing.assert_allclose(trace.signals[name], 0.0, atol=1e-7)
            continue
        scale = force if name.startswith("reaction") and name[-2:] in ("_x", "_y") else max(np.abs(values).max(), 0.1)
        np.testing.assert_allclose(trace.signals[name], values, rtol=0, atol=relative * scale, err_msg=name)


def assert_spring_law(trace: Trace, stiffness: float) -> None:
    """At rest the force is the stiffness times the penetration, along the gap."""
    gap, force = vector(trace, "clearance_B"), vector(trace, "reaction_B")
    np.testing.assert_allclose(stiffness * (np.abs(gap) - trace.clearance["B"]), np.abs(force), rtol=1e-6)
    np.testing.assert_allclose(np.angle(force / gap), 0.0, atol=1e-8)


def fast_crank_rocker(clearance: float, damping: float) -> Mechanism:
    """600 rpm, K = 1e6 N/m."""
    m = load("crank-rocker").with_joint("B", clearance=clearance, contact_stiffness=1e6, contact_damping=damping)
    return m.replace(drive=m.drive.model_copy(update={"speed": 20 * np.pi}))


def exact_motion(m: Mechanism, theta: np.ndarray, tolerance: float) -> ClearanceMotion:
    """The differential equation's motion at crank angles (rad) from a centred pin at angle 0."""
    b, start = m.joint("B"), CrankPath(Assembly(m)).poses(0.0)
    assert b.contact_stiffness is not None
    assert b.contact_damping is not None
    assert m.speed is not None
    angles = start["coupler"].angle, start["follower"].angle
    return clearance_four_bar_ode(
        m,
        b.clearance,
        b.contact_stiffness,
        b.contact_damping,
        theta / m.speed,
        0.0,
        *angles,
        max_step=1e-4,
        tolerance=tolerance,
    )


def one_revolution_against_the_ode(engine: Engine) -> tuple[float, Trace]:
    """Largest error (rad) of coupler and follower angle over a revolution from a centred pin, 0.2 mm, C = 300 N.s/m."""
    m = fast_crank_rocker(2e-4, 300.0)
    theta = np.linspace(0.0, 2 * np.pi, 361)
    exact = exact_motion(m, theta, 1e-10)
    trace = engine.simulate(request_of(m, "spring-damper", "driven", theta, start="centred", step=1e-5))
    errors = (trace.signals["coupler_angle"] - exact.coupler, trace.signals["follower_angle"] - exact.follower)
    assert 0.005 < trace.free_share["B"] < 0.05
    return float(max(np.abs(e).max() for e in errors)), trace


STARTS = range(3)  # of a chaotic motion: paths whose clearances differ by a millionth


def many_impacts_against_the_ode(
    engine: Engine, joint_model: JointModel = "spring-damper", step: float | None = None
) -> dict[str, tuple[float, float]]:
    """Simulated and exact rms force (N) and free share over revolutions 3 to 22: 0.5 mm, C = 30 N.s/m.

    The motion is chaotic, and the free share of one path scatters by 2 % from start to start: means over several.
    """
    theta = np.linspace(4 * np.pi, 44 * np.pi, 7201)
    rms: list[list[float]] = []
    free: list[list[float]] = []
    for clearance in (5e-4 * (1 + 1e-6 * k) for k in STARTS):
        m = fast_crank_rocker(clearance, 30.0)
        exact = exact_motion(m, np.linspace(0.0, 44 * np.pi, 22 * 3600 + 1), 1e-8)
        later = exact.crank >= theta[0] - 1e-9
        trace = engine.simulate(
            request_of(m, joint_model, "driven", theta, start="centred", lead_in=4 * np.pi, step=step)
        )
        forces = vector(trace, "reaction_B"), exact.force[later]
        rms.append([float(np.sqrt(np.mean(np.abs(f) ** 2))) for f in forces])
        free.append([trace.free_share["B"], free_share(exact.gap[later], clearance)])
    means = {"rms force": np.mean(rms, axis=0).tolist(), "free share": np.mean(free, axis=0).tolist()}
    return {name: (simulated, exact) for name, (simulated, exact) in means.items()}
