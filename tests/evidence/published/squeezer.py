"""IFToMM multibody benchmark A03, Andrews' squeezer: Schiehlen, Multibody Systems Handbook (1990); geometry,
parameters and the solution at 0.03 s in Hairer and Wanner, Solving ODEs II, p. 530 ff., and in the public test set for
IVP solvers.

Seven bodies, one freedom, one spring between two points, a constant torque on the crank.  The published angles are
relative ones: beta, theta (on beta), gamma, phi (on delta), delta, omega (on epsilon), epsilon.  Its multipliers are
the forces in the three pins where four bodies meet.
"""

from __future__ import annotations

from collections.abc import Callable

from analytic.mechanism import Mechanism

MASS = [0.04325, 0.00365, 0.02373, 0.00706, 0.07050, 0.00706, 0.05498]  # kg
INERTIA = [2.194e-6, 4.410e-7, 5.255e-6, 5.667e-7, 1.169e-5, 5.667e-7, 1.912e-5]  # kg.m2
A, B, C = (-0.06934, -0.00227), (-0.03635, 0.03273), (0.014, 0.072)  # m
D, DA, E, EA, RR, RA, SS = 0.028, 0.0115, 0.02, 0.01421, 0.007, 0.00092, 0.035
SA, SB, SC, SD, TA, TB, U, UA, UB = 0.01874, 0.01043, 0.018, 0.02, 0.02308, 0.00916, 0.04, 0.01228, 0.00449
ZF, ZT, FA = 0.02, 0.04, 0.01421
START = {
    "beta": -0.0617138900142764, "theta": 0.0, "gamma": 0.4552798191630704, "phi": 0.2226683901658859,
    "delta": 0.4873649795438426, "omega": -0.2226683901658859, "epsilon": 1.2305474445498212,
}  # fmt: skip
ANGLES = {
    "beta": 15.81077119629904, "theta": -15.75637105984298, "gamma": 0.04082224013073101, "phi": -0.5347301163226948,
    "delta": 0.5244099658805304, "omega": 0.5347301163226948, "epsilon": 1.048080741042263,
}  # fmt: skip
RATES = {
    "beta": 1139.920302151208, "theta": -1424.379294994111, "gamma": 11.03291221937134, "phi": 19.29337464421385,
    "delta": 0.5735699284790808, "omega": -19.29337464421385, "epsilon": 0.3231791658026955,
}  # fmt: skip
MULTIPLIERS = [
    199.1753333731910, -29.75531228015052, 23.06654119098399, 31.45271365475927, 22.64249232082739, 11.61740700019673,
]  # fmt: skip
PINS = ("P3", "P4", "P6")  # whose forces those are
END = 0.03  # s
STEP = 2.5e-6  # s, of engines; with their own, DART's and PyBullet's pins part by 2 um
# of the crank's angle, at that step: an error of its start grows as it turns faster and faster; the last two are of
# first order
STATED = {"mujoco": 1e-6, "exudyn": 1e-6, "pybullet": 5e-5, "dart": 2e-4}


def squeezer() -> Mechanism:
    """The mechanism as a file would say it; P is one point of K2, with a pin for each of the bodies on it."""

    def body(k: int, points: dict[str, tuple[float, float]], com: tuple[float, float]) -> dict[str, object]:
        return {"name": f"K{k}", "points": points, "com": com, "mass": MASS[k - 1], "inertia": INERTIA[k - 1]}

    def pin(name: str, *bodies: str) -> dict[str, object]:
        return {"name": name, "type": "revolute", "bodies": bodies}

    at = START
    return Mechanism.model_validate(
        {
            "name": "Andrews' squeezer",
            "ground": {"points": {"O": (0.0, 0.0), "B": B, "A5": A, "A7": A, "C": C}},
            "body": [
                body(1, {"O": (0.0, 0.0), "R": (RR, 0.0)}, (RA, 0.0)),
                body(2, {"R": (0.0, 0.0), "P3": (-D, 0.0), "P4": (-D, 0.0), "P6": (-D, 0.0)}, (-DA, 0.0)),
                body(3, {"B": (0.0, 0.0), "P3": (0.0, -SS), "S": (SD, -SC)}, (SB, -SA)),
                body(4, {"H": (0.0, 0.0), "P4": (0.0, -E)}, (0.0, EA - E)),
                body(5, {"A5": (0.0, 0.0), "H": (ZT, 0.0)}, (TA, TB)),
                body(6, {"G": (0.0, 0.0), "P6": (ZF, 0.0)}, (ZF - FA, 0.0)),
                body(7, {"A7": (0.0, 0.0), "G": (0.0, -U)}, (UB, -UA)),
            ],
            "joint": [
                pin("O", "ground", "K1"), pin("R", "K1", "K2"), pin("B", "ground", "K3"), pin("A5", "ground", "K5"),
                pin("A7", "ground", "K7"), pin("H", "K5", "K4"), pin("G", "K7", "K6"), pin("P3", "K2", "K3"),
                pin("P4", "K2", "K4"), pin("P6", "K2", "K6"),
            ],
            "drive": {"joint": "O", "speed": "free"},
            "spring": [{"bodies": ("ground", "K3"), "points": ("C", "S"), "stiffness": 4530.0, "length": 0.07785}],
            "load": [{"body": "K1", "torque": 0.033}],
            "assembly": {
                "K1": at["beta"], "K2": at["beta"] + at["theta"], "K3": at["gamma"], "K4": at["phi"] + at["delta"],
                "K5": at["delta"], "K6": at["omega"] + at["epsilon"], "K7": at["epsilon"],
            },
        }
    )  # fmt: skip


def relative(of: Callable[[str], float]) -> dict[str, float]:
    """The benchmark's coordinates, or their rates, of those of the bodies."""
    b = [of(f"K{k}") for k in range(1, 8)]
    return {
        "beta": b[0], "theta": b[1] - b[0], "gamma": b[2], "phi": b[3] - b[4], "delta": b[4], "omega": b[5] - b[6],
        "epsilon": b[6],
    }  # fmt: skip
