"""Linkages of several freedoms, some of which no motor moves: their own motion beside the courses of those that one
does.

The inputs' accelerations a are what makes all forces along free inputs vanish.  Kinetostatics gives those forces for
any a, and they are linear in it: for f free inputs 1 + f samples tell the whole equation, exactly.  The motion is then
an ordinary differential equation in the free inputs, and the linkage is followed from where it was last.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from analytic.beyond_paper.drive import TimeFunction
from analytic.kinematics.assembly import Assembly, AssemblyError, Walk
from analytic.kinematics.motion import kinematics
from analytic.mechanism import Mechanism
from analytic.paper.kinetostatics import Reactions, kinetostatics

INTEGRATION_ACCURACY = 1e-10  # relative, of the integration
OF_TABLES = 1e-8  # the same under a load by a table over time: a finer one would halt at every corner of it
NO_RATES: Mapping[str, float] = MappingProxyType({})


def free_motion(
    assembly: Assembly,
    time: np.ndarray,
    courses: Mapping[str, TimeFunction],
    rates: Mapping[str, float] = NO_RATES,
    start: np.ndarray | None = None,
) -> Reactions:
    """Motion and reactions at times (N,) s, ascending, from 0 on.

    Driven joints follow ``courses`` (position, rad or m, second body relative to first, as a function of time and order
    of derivative); free ones start where the assembly has them, or among inputs ``start`` (n_inputs,) rad, m, with
    ``rates`` (rad/s, m/s), at rest where none is given.  Raises AssemblyError where the motion meets a change point, or
    has dry friction.
    """
    _check(assembly)
    return _FreeMotion(assembly, courses).at(
        np.asarray(time, float), rates, assembly.inputs if start is None else start
    )


def integration_accuracy(mechanism: Mechanism) -> float:
    """Relative accuracy with which a free motion is integrated."""
    timed = mechanism.timed_load
    return OF_TABLES if timed is not None and timed.table else INTEGRATION_ACCURACY


def _check(assembly: Assembly) -> None:
    """Raise AssemblyError for friction whose direction a free motion of several freedoms would have to find."""
    m = assembly.mechanism
    laws = [
        joint.load_law if joint.load_coefficient else f"friction_torque of joint {joint.name!r}"
        for joint in m.joints
        if joint.rubs
    ]
    laws += [f"opposes of the load on {load.body!r}" for load in m.loads if load.opposes]
    if laws:
        raise AssemblyError(
            f"{m.name}: the analytic model knows no free motion of several freedoms with dry friction ({laws[0]})",
            remedy="leave it out, or give each freedom a drive",
        )


class _FreeMotion:
    """A linkage whose inputs in ``free`` move freely; its state is their values and rates (2 free,)."""

    def __init__(self, assembly: Assembly, courses: Mapping[str, TimeFunction]) -> None:
        s = assembly.structure
        self.assembly, self.free = assembly, list(s.free)
        joints = [s.coordinates[i].joint for i in s.inputs]
        self.driven = {k: (float(s.signs[s.inputs[k]]), courses[joints[k]]) for k in s.driven}
        self.joints, self.signs = joints, [float(s.signs[i]) for i in s.inputs]
        self.last: np.ndarray = np.zeros((0, 0))  # coordinates (n, 1) where the linkage was last

    def at(self, time: np.ndarray, rates: Mapping[str, float], home: np.ndarray) -> Reactions:
        """The motion at times (N,) s, from inputs ``home`` (n_inputs,) of which the free ones count."""
        start = np.concatenate([home[self.free], [self.signs[k] * rates.get(self.joints[k], 0.0) for k in self.free]])
        begin, _, _ = self.inputs(0.0, start)
        self.last = self.assembly.follow(begin[:, None]).coordinates
        states = self.integrated(time, start)
        self.last = self.assembly.follow(begin[:, None]).coordinates
        samples = [self.sample(t, state) for t, state in zip(time.tolist(), states.T, strict=True)]
        inputs, speeds, pushes, near = (np.stack(part, axis=1) for part in zip(*samples, strict=True))
        return kinetostatics(kinematics(self.assembly, inputs, speeds, pushes, path=Walk(near), time=time))

    def integrated(self, time: np.ndarray, start: np.ndarray) -> np.ndarray:
        """States (2 free, N) at times (N,) s.  Raises AssemblyError."""
        from scipy.integrate import solve_ivp

        if time[-1] == 0:
            return np.tile(start[:, None], time.size)

        def rate(t: float, state: np.ndarray) -> np.ndarray:
            return np.concatenate([state[len(self.free) :], self.accelerations(t, state)])

        m = self.assembly.mechanism
        accuracy, span = integration_accuracy(m), (0.0, float(time[-1]))
        solution: Any = solve_ivp(
            rate, span, start, "DOP853", time, rtol=accuracy, atol=accuracy, max_step=m.shortest_stretch
        )
        if not solution.success:
            raise AssemblyError(
                f"{m.name}: the free motion cannot be followed beyond {solution.t[-1]:g} s ({solution.message})"
            )
        return np.asarray(solution.y)

    def inputs(self, t: float, state: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Inputs (n_inputs,), their rates and, where a course says them, accelerations; free ones' are zero."""
        out = np.zeros((3, len(self.joints)))
        out[0, self.free], out[1, self.free] = np.split(state, 2)
        for k, (sign, course) in self.driven.items():
            out[:, k] = [sign * float(course(np.array(t), order)) for order in range(3)]
        return out[0], out[1], out[2]

    def accelerations(self, t: float, state: np.ndarray) -> np.ndarray:
        """Accelerations (free,) of the free inputs."""
        inputs, speeds, pushes = self.inputs(t, state)
        tries = np.zeros((len(self.joints), 1 + len(self.free)))
        tries[self.free, 1 + np.arange(len(self.free))] = 1.0
        here, fast, near = (np.tile(x, tries.shape[1]) for x in (inputs[:, None], speeds[:, None], self.last))
        try:
            times = np.full(tries.shape[1], t)
            motion = kinematics(self.assembly, here, fast, pushes[:, None] + tries, path=Walk(near), time=times)
        except AssemblyError:  # a walk from the assembly on looks for the change point that a step went past
            self.assembly.follow(np.column_stack([self.last[list(self.assembly.structure.inputs), 0], inputs]))
            raise
        self.last = motion.coordinates[:, :1].copy()
        efforts = kinetostatics(motion).efforts[self.free]
        return np.asarray(-np.linalg.solve(efforts[:, 1:] - efforts[:, :1], efforts[:, 0]))

    def sample(self, t: float, state: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Inputs, rates and accelerations (n_inputs,) at a time (s), and the coordinates (n,) there."""
        inputs, speeds, pushes = self.inputs(t, state)
        pushes[self.free] = self.accelerations(t, state)
        return inputs, speeds, pushes, self.last[:, 0]
