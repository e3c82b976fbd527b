"""Linkages of several drives for tests, how they are moved, and what the referee in maximal coordinates says."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.interpolate import CubicSpline

from analytic.kinematics.assembly import Assembly
from analytic.mechanism import Mechanism
from analytic.mechanism.file import load, loads
from maximal import Maximal, Posed

SHIPPED = ("five-bar", "3-rrr", "3-rpr", "2r-arm")
END = 0.6  # s
KNOTS = np.linspace(0.0, END, 61)
TIMES = np.linspace(0.03, 0.57, 10)
Knots = dict[str, tuple[np.ndarray, np.ndarray]]


def waved(m: Mechanism) -> Knots:
    """Courses of a mechanism's drives that are no straight lines, from the assembly on."""
    at = Assembly(m).positions
    return {
        d.joint: (KNOTS, at[d.joint] + float(d.speed) * (KNOTS + 0.05 * (np.sin(8 * KNOTS + i) - np.sin(i))))
        for i, d in enumerate(m.drives)
    }


def sprung(m: Mechanism) -> Mechanism:
    """The mechanism with dampers and springs in its joints, and a spring between the ground and its last body."""
    last = m.bodies[-1]
    for joint in m.joints:
        law = {"damping": 3.0, "stiffness": 20.0} if joint.prismatic else {"damping": 0.02, "stiffness": 0.3}
        m = m.with_joint(joint.name, **law)
    spring = {
        "bodies": ("ground", last.name), "points": (next(iter(m.ground.points)), list(last.points)[-1]),
        "stiffness": 200.0, "length": 0.05, "damping": 3.0,
    }  # fmt: skip
    return m.replace(name=f"{m.name} with springs", springs=[spring])


def arm(speeds: tuple[float, float], angles: tuple[float, float]) -> Mechanism:
    """Two bars of 0.1 and 0.16 m, driven in shoulder D and elbow A (rad/s) from these angles (rad) on."""
    return loads(f"""
name = "arm"
gravity = [0.0, -9.81]
[ground]
points = {{ D = [0.0, 0.0] }}
[[body]]
name = "upper"
points = {{ D = [0.0, 0.0], A = [0.1, 0.0] }}
mass = 0.1
[[body]]
name = "fore"
points = {{ A = [0.0, 0.0], P = [0.16, 0.0] }}
mass = 0.2
[[joint]]
name = "D"
type = "revolute"
bodies = ["ground", "upper"]
[[joint]]
name = "A"
type = "revolute"
bodies = ["upper", "fore"]
[[drive]]
joint = "D"
speed = {speeds[0]}
[[drive]]
joint = "A"
speed = {speeds[1]}
[assembly]
upper = {angles[0]}
fore = {angles[1]}
""")


def third_bar(beside: float = 0.0) -> Mechanism:
    """The paper's parallelogram with a third bar beside the coupler, ``beside`` (m) too long: one drive, mobility 0 by
    count.
    """
    m = load("paper").with_clearances({})
    sides = {
        name: m.moving[name].model_copy(update={"points": {**m.moving[name].points, f"{name[0]}2": (0.1, 0.0)}})
        for name in ("crank", "follower")
    }
    bar = m.moving["coupler"].model_copy(
        update={"name": "bar", "points": {"c2": (0.0, 0.0), "f2": (0.4 + beside, 0.0)}}
    )
    pins = [
        m.joint("A").model_copy(update={"name": name, "bodies": bodies, "elasticity": None})
        for name, bodies in (("c2", ("crank", "bar")), ("f2", ("bar", "follower")))
    ]
    return m.replace(
        name="parallelogram with a third bar",
        bodies=(sides["crank"], m.moving["coupler"], sides["follower"], bar),
        joints=(*m.joints, *pins),
        assembly={**m.assembly, "bar": 0.0},
    )


GANTRY = """
name = "gantry"
gravity = [0.0, -9.81]
ground = { points = { X = [0.0, 0.0] } }
body = [
    { name = "car", points = { X = [0.0, 0.0], Y = [0.0, 0.0] }, mass = 2.0, com = [0.0, 0.0], inertia = 0.01 },
    { name = "tool", points = { Y = [0.0, 0.0], tip = [0.2, 0.0] }, mass = 0.5, com = [0.0, 0.0], inertia = 1e-3 }
]
joint = [
    { name = "X", type = "prismatic", bodies = ["ground", "car"], axis = [1.0, 0.0] },
    { name = "Y", type = "prismatic", bodies = ["car", "tool"], axis = [0.0, 1.0] }
]
drive = [{ joint = "X", speed = 0.1 }, { joint = "Y", speed = 0.05 }]
assembly = { car = 0.0, tool = 0.0 }
"""  # slides alone

SLIDES = """
name = "gantry"
gravity = [0.0, -9.81]
ground = { points = { X = [0.1, 0.2] } }
body = [
    { name = "bridge", points = { X = [0.0, 0.0], Y = [0.05, 0.1] }, mass = 2.0, inertia = 0.02 },
    { name = "head", points = { Y = [0.0, 0.02], R = [0.03, 0.0] }, mass = 0.7, com = [0.04, 0.01], inertia = 3e-3 },
    { name = "tool", points = { R = [0.0, 0.0], T = [0.1, 0.0] }, mass = 0.3, com = [0.04, 0.01], inertia = 1e-3 },
]
joint = [
    { name = "X", type = "prismatic", bodies = ["ground", "bridge"], axis = [1.0, 0.2] },
    { name = "Y", type = "prismatic", bodies = ["head", "bridge"], axis = [0.3, 1.0], angle = 0.3 },
    { name = "R", type = "revolute", bodies = ["tool", "head"] },
]
drive = [{ joint = "X", speed = 0.2 }, { joint = "Y", speed = -0.1 }, { joint = "R", speed = 1.0 }]
assembly = { bridge = 0.0, head = -0.3, tool = 0.5 }
"""  # slides that slope, with mass beside them, and a hinge

PISTON_PIN = """
name = "press driven at its piston's pin"
gravity = [0.0, -9.81]
ground = { points = { O = [0.0, 0.0], G = [0.0, 0.0] } }
body = [
    { name = "arm", points = { O = [0.0, 0.0], K = [0.1, 0.0] }, mass = 1.0 },
    { name = "rod", points = { K = [0.0, 0.0], P = [0.3, 0.0] }, mass = 2.0 },
    { name = "piston", points = { P = [0.0, 0.0], G = [0.0, 0.0] }, mass = 3.0, inertia = 0.01 }
]
joint = [
    { name = "O", type = "revolute", bodies = ["ground", "arm"] },
    { name = "K", type = "revolute", bodies = ["arm", "rod"] },
    { name = "P", type = "revolute", bodies = ["piston", "rod"] },
    { name = "G", type = "prismatic", bodies = ["ground", "piston"], axis = [1.0, 0.0] }
]
drive = { joint = "P", speed = 0.1 }
assembly = { arm = 0.3, rod = -0.098666, piston = 0.0 }
"""  # the driven pin is on a block that slides by itself

CASES: dict[str, Mechanism] = {name: load(name) for name in SHIPPED}
CASES |= {m.name: m for m in (sprung(load(name)) for name in SHIPPED)}
CASES["parallelogram"] = third_bar()


def splines(courses: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> dict[str, CubicSpline]:
    """The courses as functions of time and order of derivative."""
    return {name: CubicSpline(*course) for name, course in courses.items()}


def referee(m: Mechanism, courses: Knots, times: np.ndarray) -> tuple[Maximal, list[Posed]]:
    """What the referee says at times (N,) s."""
    found, judge = [], Maximal(m, tuple(courses))
    motors = splines(courses)
    q = judge.home(Assembly(m).positions)
    for t in np.concatenate([np.linspace(0.0, times[0], 8)[:-1], times]):
        posed = judge.driven_at(q, {n: (float(f(t)), float(f(t, 1)), float(f(t, 2))) for n, f in motors.items()})
        q = posed.q
        found.append(posed)
    return judge, found[-times.size :]
