"""A pick-and-place robot with two motors, held more often than it needs, by MSC Adams; its data are not kept here.

Its torques are given to seven digits, the angle of M1 to seven decimals: a second difference at 5 ms knows the
acceleration to 0.01 rad/s2, and so a torque to some 2 N.m.  Near the start the motion is smooth, and a polynomial
through many samples knows it a hundred times better; later it has jitter of its own from sample to sample, which the
cubic spline through them follows.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.polynomial import Polynomial

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import along, kinematics
from analytic.kinematics.schedule import Schedule
from analytic.mechanism import Mechanism
from analytic.mechanism.file import load
from analytic.paper.kinetostatics import Reactions, kinetostatics
from sim_models.engine import Request

FOLDER = "adams-parallel-robot"
SMOOTH = 0.2  # s, from the start, that one polynomial follows
END_OF_SPLINE = 0.05  # s: at its end a spline's second derivative is off by 1.1 % of the peak; beyond, by less than 1 %
CORNERS = (2.5, 4.2)  # s, where the prescribed angles have corners in their second derivative
BESIDE = 0.1  # s
KNOTS = 201  # of the spline by which an engine follows that polynomial
EVERY = 8  # samples, of which an engine is asked for one
AT_REST = 131.237  # N.m, of both motors


@dataclass(frozen=True)
class Recorded:
    """The robot, times (N,) s, positions of its motors' joints (N,) rad and their torques (N,) N.m."""

    mechanism: Mechanism
    time: np.ndarray
    position: Mapping[str, np.ndarray]
    torque: Mapping[str, np.ndarray]

    @property
    def peak(self) -> float:
        """The largest torque (N.m)."""
        return max(float(np.abs(torque).max()) for torque in self.torque.values())

    @property
    def early(self) -> np.ndarray:
        """Which times (N,) one polynomial follows."""
        return self.time <= SMOOTH

    @property
    def clear(self) -> np.ndarray:
        """Which times (N,) are beyond the spline's beginning, and not beside a corner."""
        return (self.time >= END_OF_SPLINE) & np.all([np.abs(self.time - c) > BESIDE for c in CORNERS], axis=0)

    @property
    def beginning(self) -> Mapping[str, Polynomial]:
        """The polynomial through each motor's early positions."""
        return {name: Polynomial.fit(self.time[self.early], at[self.early], 4) for name, at in self.position.items()}

    def at_the_start(self) -> Reactions:
        """The analytic side while one polynomial follows the motion."""
        assembly, time, fits = Assembly(self.mechanism), self.time[self.early], self.beginning
        theta, omega, alpha = (
            assembly.inputs_at({name: fit.deriv(order)(time) for name, fit in fits.items()}) for order in range(3)
        )
        return kinetostatics(kinematics(assembly, theta, omega, alpha))

    def request_at_the_start(self) -> Request:
        """What an engine is asked for while one polynomial follows the motion."""
        knots = np.linspace(0.0, SMOOTH, KNOTS)
        courses = {name: (knots, fit(knots)) for name, fit in self.beginning.items()}
        return Request(self.mechanism, "ideal", Schedule.along(courses, self.time[self.early]))

    def in_motion(self) -> Reactions:
        """The analytic side along the splines through all samples."""
        courses = {name: (self.time, at) for name, at in self.position.items()}
        return kinetostatics(along(Assembly(self.mechanism), Schedule.along(courses, self.time)))

    def request(self) -> Request:
        """What an engine is asked for."""
        courses = {name: (self.time, at) for name, at in self.position.items()}
        return Request(self.mechanism, "ideal", Schedule.along(courses, self.time[self.clear][::EVERY]))


def recorded(data: Path) -> Recorded:
    """The robot as a folder of data has it.

    The file counts the angle of M2 along the crank, from its pivot; the mechanism file's crank has its x axis the
    other way.
    """
    table = np.genfromtxt(data / FOLDER / "run.csv", delimiter=",", skip_header=1)
    position = {"M1": table[:, 1], "M2": table[:, 2] + np.pi}
    return Recorded(load(data / FOLDER / "nominal.toml"), table[:, 0], position, {"M1": table[:, 3], "M2": table[:, 4]})
