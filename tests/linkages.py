"""Linkages that the tests need besides the shipped cases."""

from __future__ import annotations

from analytic.mechanism import Mechanism, PeriodicTorque
from analytic.mechanism.file import load, loads

INVERTED_SLIDER = """
name = "inverted slider"
gravity = [0.0, -9.81]
ground = { points = { O = [0.0, 0.0], C = [0.2, 0.05] } }
body = [
  { name = "crank", points = { O = [0.0, 0.0], A = [0.06, 0.0] }, mass = 0.2 },
  { name = "block", points = { A = [0.0, 0.01], S = [0.0, 0.0] }, mass = 0.1, inertia = 2e-5 },
  { name = "arm", points = { C = [0.0, 0.0], S = [0.02, 0.01], tip = [0.3, 0.0] }, mass = 0.4 },
]
drive = { joint = "O", speed = -20.0 }
load = [
  { body = "arm", point = "tip", force = [3.0, -2.0], torque = 0.1 },
]
assembly = { crank = 0.3, block = -2.8, arm = 3.1 }
[[joint]]
name = "O"
type = "revolute"
bodies = ["crank", "ground"]
[[joint]]
name = "A"
type = "revolute"
bodies = ["block", "crank"]
[[joint]]
name = "S"
type = "prismatic"
bodies = ["arm", "block"]
axis = [3.0, 1.0]
angle = 0.4
friction_torque = 0.3
damping = 2.0
stiffness = 15.0
rest_angle = 0.1
[[joint]]
name = "C"
type = "revolute"
bodies = ["ground", "arm"]
friction_torque = 0.02
damping = 0.003
stiffness = 0.4
rest_angle = 0.2
"""


def inverted_slider() -> Mechanism:
    """A crank, a block that slides on a swinging arm (prismatic joint between moving bodies), every joint law
    at once.
    """
    return loads(INVERTED_SLIDER)


def curved_slider() -> Mechanism:
    """The same with what is not linear: Stribeck's friction, drag, cubic springs, a torque over the crank angle."""
    m = inverted_slider()
    wave = PeriodicTorque(amplitude=0.05, harmonic=5, phase=0.3)
    m = m.replace(drive=m.drive.model_copy(update={"periodic_torque": wave}))  # type: ignore[union-attr]
    for joint in m.joints:
        unit, rate = (1.0, 0.05) if joint.prismatic else (0.01, 1.0)
        dry = {"static_torque": joint.coulomb + unit, "stribeck_speed": rate}
        m = m.with_joint(joint.name, drag=0.1 * unit / rate**2, cubic=unit / rate**2, **dry)
    return m


def six_bar_driven_from_the_rocker() -> Mechanism:
    """The shipped Stephenson six-bar with its drive at G: the rest is one Assur group of four bodies, no dyad in it."""
    m = load("six-bar")
    return m.replace(drive=m.drive.model_copy(update={"joint": "G", "speed": 3.0}))


SCOTCH_YOKE = """
name = "scotch yoke"
ground = { points = { O = [0.0, 0.0], Y = [0.0, 0.0] } }
body = [
  { name = "crank", points = { O = [0.0, 0.0], A = [0.05, 0.0] }, mass = 0.2 },
  { name = "block", points = { A = [0.0, 0.0], X = [0.0, 0.0] }, mass = 0.1 },
  { name = "yoke", points = { X = [0.0, 0.0], Y = [0.0, 0.0] }, mass = 0.5 },
]
joint = [
  { name = "O", type = "revolute", bodies = ["ground", "crank"] },
  { name = "A", type = "revolute", bodies = ["crank", "block"] },
  { name = "X", type = "prismatic", bodies = ["yoke", "block"], axis = [0.0, 1.0] },
  { name = "Y", type = "prismatic", bodies = ["ground", "yoke"], axis = [1.0, 0.0] },
]
drive = { joint = "O", speed = 10.0 }
assembly = { crank = 0.3 }
"""


def scotch_yoke() -> Mechanism:
    """Two prismatic joints in one dyad: the yoke moves as the cosine of the crank angle."""
    return loads(SCOTCH_YOKE)


DYAD_ON_A_TRIAD = """
name = "dyad on a triad"
gravity = [0.0, -9.81]
ground = { points = { D = [0.0, 0.0], E = [0.12, 0.0], G = [0.2, 0.06], H = [0.3, 0.15] } }
body = [
  { name = "crank", points = { D = [0.0, 0.0], A = [0.02, 0.0] }, mass = 0.04 },
  { name = "link", points = { A = [0.0, 0.0], C = [0.1, 0.0] }, mass = 0.05 },
  { name = "plate", points = { C = [0.0, 0.0], B = [0.05, 0.03], F = [0.06, -0.02] }, mass = 0.14 },
  { name = "left", points = { E = [0.0, 0.0], B = [0.1, 0.0] }, mass = 0.08 },
  { name = "right", points = { G = [0.0, 0.0], F = [0.05, 0.0], T = [0.05, 0.03] }, mass = 0.08 },
  { name = "connector", points = { T = [0.0, 0.0], U = [0.0974, 0.0] }, mass = 0.05 },
  { name = "output", points = { H = [0.0, 0.0], U = [0.0974, 0.0] }, mass = 0.05 },
]
""" + "".join(
    f'[[joint]]\nname = "{name}"\ntype = "revolute"\nbodies = ["{first}", "{second}"]\n'
    for name, first, second in (
        ("D", "ground", "crank"), ("A", "crank", "link"), ("C", "plate", "link"), ("B", "plate", "left"),
        ("E", "left", "ground"), ("F", "right", "plate"), ("G", "ground", "right"), ("T", "right", "connector"),
        ("U", "connector", "output"), ("H", "ground", "output"),
    )
) + """
[drive]
joint = "D"
speed = -6.0
[assembly]
crank = 0.3
link = 0.7156
plate = -0.1039
left = 1.293
right = -2.8453
connector = 0.9134
output = -2.5266
"""  # fmt: skip


def dyad_on_a_triad() -> Mechanism:
    """A group of four bodies that Newton's method solves, and on it a dyad whose bodies come within 17 deg of being in
    line.
    """
    return loads(DYAD_ON_A_TRIAD)


def chain(links: int, closed: bool) -> str:
    """A mechanism file: so many links in a row, the first on the ground and driven, the last on the ground as well if
    ``closed``.
    """
    names = [f"b{i}" for i in range(links)]
    bodies = "".join(
        f'[[body]]\nname = "{b}"\npoints = {{ J{i} = [0.0, 0.0], J{i + 1} = [0.1, 0.0] }}\nmass = 0.1\n'
        for i, b in enumerate(names)
    )
    ends = zip(["ground", *names], [*names, "ground"] if closed else names, strict=False)
    joints = "".join(
        f'[[joint]]\nname = "J{i}"\ntype = "revolute"\nbodies = ["{a}", "{b}"]\n' for i, (a, b) in enumerate(ends)
    )
    ground = "[ground]\npoints = { J0 = [0.0, 0.0]" + (f", J{links} = [0.5, 0.0]" if closed else "") + " }\n"
    return f'name = "chain"\n{ground}{bodies}{joints}[drive]\njoint = "J0"\nspeed = 1.0\n[assembly]\n' + "".join(
        f"{b} = 0.1\n" for b in names
    )


JANSEN = """
name = "Jansen's leg"
gravity = [0.0, -9.81]
ground = { points = { O = [0.0, 0.0], B = [-0.038, -0.0078], E = [-0.038, -0.0078] } }
body = [
  { name = "crank", points = { O = [0.0, 0.0], Z = [0.015, 0.0], Y = [0.015, 0.0] }, mass = 0.075 },
  { name = "upper", points = { Z = [0.0, 0.0], U = [0.05, 0.0] }, mass = 0.25 },
  { name = "lower", points = { Y = [0.0, 0.0], L = [0.0619, 0.0] }, mass = 0.31 },
  { name = "rocker", points = { B = [0.0, 0.0], U = [0.0415, 0.0], V = [0.0026098795, 0.0400149788] }, mass = 0.69 },
  { name = "swing", points = { E = [0.0, 0.0], L = [0.0393, 0.0], K = [0.0393, 0.0] }, mass = 0.2 },
  { name = "strut", points = { V = [0.0, 0.0], W = [0.0394, 0.0] }, mass = 0.2 },
  { name = "foot", points = { K = [0.0, 0.0], W = [0.0367, 0.0], X = [-0.007746594, 0.0483837812] }, mass = 0.76 },
]
""" + "".join(
    f'[[joint]]\nname = "{name}"\ntype = "revolute"\nbodies = ["{first}", "{second}"]\n'
    for name, first, second in (
        ("O", "ground", "crank"), ("Z", "crank", "upper"), ("Y", "crank", "lower"), ("U", "upper", "rocker"),
        ("B", "ground", "rocker"), ("E", "ground", "swing"), ("L", "lower", "swing"), ("V", "rocker", "strut"),
        ("W", "strut", "foot"), ("K", "swing", "foot"),
    )
) + """
[drive]
joint = "O"
speed = 3.0
[assembly]
crank = 0.3
upper = 2.5511
lower = -2.2324
rocker = 1.3076
swing = -1.1984
strut = -1.0763
foot = 2.7248
"""  # fmt: skip


def jansen_leg(push: float = 0.0) -> Mechanism:
    """Theo Jansen's leg with his eleven numbers in mm, and a push (N) upwards on the foot; its transmission is poor at
    190 deg.
    """
    m = loads(JANSEN)
    return m.replace(loads=[{"body": "foot", "point": "X", "force": (0.0, push)}]) if push else m


SHAPER = """
name = "shaper"
gravity = [0.0, -9.81]
ground = { points = { O = [0.0, 0.0], P = [0.0, -0.25], S = [0.0, 0.2] } }
body = [
  { name = "crank", points = { O = [0.0, 0.0], A = [0.08, 0.0] }, mass = 2.0 },
  { name = "block", points = { A = [0.0, 0.0], Q = [0.0, 0.0] }, mass = 0.5, inertia = 1e-4 },
  { name = "lever", points = { P = [0.0, 0.0], Q = [0.0, 0.0], C = [0.4, 0.0] }, mass = 4.0 },
  { name = "link", points = { C = [0.0, 0.0], B = [0.15, 0.0] }, mass = 1.0 },
  { name = "ram", points = { B = [0.0, 0.0], S = [0.0, 0.0] }, mass = 10.0, inertia = 0.05 },
]
joint = [
  { name = "O", type = "revolute", bodies = ["ground", "crank"] },
  { name = "A", type = "revolute", bodies = ["crank", "block"] },
  { name = "Q", type = "prismatic", bodies = ["lever", "block"], axis = [1.0, 0.0] },
  { name = "P", type = "revolute", bodies = ["ground", "lever"] },
  { name = "C", type = "revolute", bodies = ["lever", "link"] },
  { name = "B", type = "revolute", bodies = ["link", "ram"] },
  { name = "S", type = "prismatic", bodies = ["ground", "ram"], axis = [1.0, 0.0] },
]
drive = { joint = "O", speed = 6.283185307179586 }
load = [
  { body = "ram", force = [-3300.0, 0.0] },
]
assembly = { crank = 0.0, block = 1.26, lever = 1.26, link = 0.3, ram = 0.0 }
"""


def shaper() -> Mechanism:
    """Whitworth's quick return at 60 rpm: a crank's block turns a slotted lever, which pushes a ram against 3.3 kN.

    The slot has its point where the lever turns on the ground.
    """
    return loads(SHAPER)
