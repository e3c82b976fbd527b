"""An Exudyn linkage at work: static equilibria, steps in time, and readings.

How Exudyn's outputs become this project's reactions (force of the first body on the second) is written here only.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypedDict, cast

import numpy as np
from numpy.typing import NDArray

from analytic.mechanism import GROUND, MASS_CENTRE, Joint
from analytic.mechanism.signals import driving
from sim_models.common.start import Pose
from sim_models.exudyn.model import ExudynModel, gap_at, point_at
from sim_models.exudyn.settings import quiet_settings, static_settings
from sim_models.run.judge import FLIPPED
from sim_models.run.record import Record, located

if TYPE_CHECKING:
    from exudyn import SimulationSettings

HALVED = 256  # a step that Newton's method only manages when shorter than this part of it has failed

# Of a coordinate: steps by which Exudyn differentiates a contact.  One that is as large as the contact's depth misses
# how its force turns.
DIFFERENCES = (1e-7, 1e-8, 1e-9, 1e-10)


class Item(TypedDict, total=False):
    """Exudyn's own parameters of a node or an object, as far as they are read; each kind has some of them."""

    objectType: str
    nodeNumber: int
    markerNumbers: list[int]
    initialCoordinates: NDArray[np.float64]
    initialVelocities: NDArray[np.float64]
    offset: float
    force: float
    stiffness: float


@dataclass(frozen=True)
class Inertia:
    """Accelerations that a quasi-static linkage is loaded with: of each com (m/s^2) and angle (rad/s^2)."""

    linear: Mapping[str, complex]
    angular: Mapping[str, float]

    @classmethod
    def of(
        cls, linear: Mapping[str, np.ndarray], angular: Mapping[str, np.ndarray], k: int, factor: float = 1.0
    ) -> Inertia:
        """That at number k of N instants, (N,) by body, times a factor."""
        return cls(
            {body: complex(a[k]) * factor for body, a in linear.items()},
            {body: float(w[k]) * factor for body, w in angular.items()},
        )


class ExudynLinkage:
    """A model at work: it can be placed, loaded, solved, advanced and read."""

    def __init__(self, model: ExudynModel) -> None:
        self.model, self.m, self.exu, self.mbs = model, model.m, model.exu, model.mbs

    # ---------------------------------------------------------------- statics

    def place(self, start: Mapping[str, Pose]) -> None:
        """Put the bodies in these poses, the held ones included, as the guess of the next static solution."""
        coordinates = []
        for body in self.m.bodies:
            com = point_at(self.m, start, body.name, MASS_CENTRE)
            coordinates += [com.real, com.imag, start[body.name].angle]
        self.mbs.systemData.SetODE2Coordinates(coordinates, self.exu.ConfigurationType.Initial)
        self.model.hold(start)
        data = []
        for name in self.model.touching:
            data += [self.model.clearance[name] - gap_at(self.m, start, name), 0.0, 0.0, 0.0]
        if data:
            self.mbs.systemData.SetDataCoordinates(data, self.exu.ConfigurationType.Initial)

    def load_bodies(
        self, force: Mapping[str, complex], torque: Mapping[str, float], slide: Mapping[str, float]
    ) -> None:
        """Force (N) at each body's com and torque (N.m) on it, besides the mechanism's loads; force (N) along each
        slide.
        """
        for body in self.m.bodies:
            total = force[body.name]
            self.mbs.SetLoadParameter(self.model.com_force[body.name], "loadVector", [total.real, total.imag, 0.0])
            self.mbs.SetLoadParameter(self.model.com_torque[body.name], "loadVector", [0.0, 0.0, torque[body.name]])
        for name, number in self.model.slide_laws.items():
            self.mbs.SetObjectParameter(number, "force", -slide[name])
        for name, block in self.model.blocks.items():
            block.steady.SetValue(slide[name])

    def body_loads(self) -> dict[str, list[float]]:
        """What :meth:`load_bodies` put on each body: force x, y (N) at its com, and torque (N.m)."""
        acting = {
            b.name: [
                self.mbs.GetLoad(load[b.name])["loadVector"] for load in (self.model.com_force, self.model.com_torque)
            ]
            for b in self.m.bodies
        }
        return {name: [*map(float, force[:2]), float(torque[2])] for name, (force, torque) in acting.items()}

    @property
    def residual(self) -> float:
        """Force (N) that a static solution may leave unbalanced: what rounding of a position leaves on a stiff
        spring.  With courses, a massless link is none.
        """
        model = self.model
        rigid = model.drives is not None and model.motion == "driven" and model.joint_model == "massless-link"
        springs = [*model.bearings, *(() if rigid else model.clearance)]
        return 1e-9 + 1e-15 * max(map(model.stiffness, springs), default=0.0)

    def solve_static(self) -> bool:
        """Static equilibrium near where the bodies were placed; False if Newton's method does not find one."""
        return any(self._solve_static(difference) and not self._strayed() for difference in DIFFERENCES)

    def _strayed(self) -> bool:
        """Whether a body has turned over on the way to the solution: stiff contact may throw Newton's method far."""
        kinds = self.exu.ConfigurationType
        begin, end = (np.array(self.mbs.systemData.GetODE2Coordinates(kind)) for kind in (kinds.Initial, kinds.Current))
        return bool(np.abs(end - begin)[2 : 3 * len(self.m.bodies) : 3].max() > FLIPPED)

    def _solve_static(self, difference: float) -> bool:
        try:
            return bool(
                self.mbs.SolveStatic(
                    static_settings(self.residual, difference, self.model.redundant), storeSolver=False
                )
            )
        except self.exu.exudynCPP.SolverError:
            return False

    # ---------------------------------------------------------------- motion

    def advance(self, begin: float, end: float, steps: int, onward: bool = False) -> bool:
        """Integrate from time ``begin`` to ``end`` (s) and go on from there; False if a step fails.

        Trapezoidal rule with constraints on velocity (index 2): no numerical damping, and a constraint on speed is
        exact. Steps are equal but for those that Newton's method, stumbling over a contact's kink, only manages when
        halved. ``onward`` starts with the accelerations of the step before; otherwise Exudyn computes them, for a motor
        at constant speed. A course's reactions are then off by what Newton's method leaves of the jerk, unless it is
        told to leave less.
        """
        settings = quiet_settings(self.model.redundant)
        time = settings.timeIntegration
        time.generalizedAlpha.computeInitialAccelerations = not onward
        if onward:
            time.newton.relativeTolerance, time.newton.absoluteTolerance = 1e-12, self.residual
        time.adaptiveStep, time.minimumStepSize = True, (end - begin) / steps / HALVED
        return self._integrate(settings, begin, end, steps)

    def settle(self, begin: float, end: float) -> bool:
        """One short step to the accelerations that a motor's course asks for, whatever they were; False if it fails.

        With Newmark's gamma of 1 they are the step's change of velocity, and owe nothing to the ones before.
        """
        settings = quiet_settings(self.model.redundant)
        newmark = settings.timeIntegration.generalizedAlpha
        newmark.newmarkBeta, newmark.newmarkGamma, newmark.computeInitialAccelerations = 0.5, 1.0, False
        return self._integrate(settings, begin, end, 1)

    def _integrate(self, settings: SimulationSettings, begin: float, end: float, steps: int) -> bool:
        time = settings.timeIntegration
        time.startTime, time.endTime, time.numberOfSteps = begin, end, steps
        time.generalizedAlpha.useIndex2Constraints = time.generalizedAlpha.useNewmark = True
        time.discontinuous.useRecommendedStepSize = False
        try:
            return bool(self.mbs.SolveDynamic(settings, updateInitialValues=True, storeSolver=False))
        except self.exu.exudynCPP.SolverError:
            return False

    # ---------------------------------------------------------------- reading

    def item(self, sensed: str) -> Item:
        """Exudyn's own parameters of what a sensor looks at: ``Coordinates <body>``, ``force <joint>``, ``law
        <joint>``, ``drive``, ``drive <joint>``.
        """
        sensor = self.mbs.GetSensor(self.model.sensors[sensed])
        if sensor["sensorType"] == "Node":
            return cast(Item, self.mbs.GetNode(sensor["nodeNumber"]))
        return cast(Item, self.mbs.GetObject(sensor["objectNumber"]))

    def now(self) -> Record:
        """The present state, as a record of one instant."""
        return self._record(
            {
                key: np.atleast_2d(np.asarray(self.mbs.GetSensorValues(number)))
                for key, number in self.model.sensors.items()
            },
            np.zeros(1),
        )

    def history(self) -> Record:
        """Every step of the last :meth:`advance`, its first instant included."""
        stored = {key: np.asarray(self.mbs.GetSensorStoredData(number)) for key, number in self.model.sensors.items()}
        return self._record({key: values[:, 1:] for key, values in stored.items()}, next(iter(stored.values()))[:, 0])

    def inertia(self) -> Inertia:
        """Every body's accelerations, now."""
        values = {
            body: self.mbs.GetNodeOutput(node, self.exu.OutputVariableType.Coordinates_tt)
            for body, node in self.model.nodes.items()
        }
        linear = {body: complex(a[0], a[1]) for body, a in values.items()}
        return Inertia(linear, {body: float(a[2]) for body, a in values.items()})

    def _record(self, raw: Mapping[str, np.ndarray], time: np.ndarray) -> Record:
        kinds = "Coordinates", "Coordinates_t", "Coordinates_tt"
        each = [{body: raw[f"{kind} {body}"] for body in self.model.nodes} for kind in kinds]
        com, velocity, acceleration = ({body: _plane(x) for body, x in values.items()} for values in each)
        angle, spin, spin_up = ({body: x[:, 2] for body, x in values.items()} for values in each)
        # Exudyn's static and dynamic solvers differ in a multiplier's sign
        multiplier = 1.0 if self.model.motion == "static" else -1.0
        drives = self._drives(raw, multiplier, time.size)
        gap, height, tilt, force, moment = (dict[str, np.ndarray]() for _ in range(5))
        turned = {GROUND: np.zeros(time.size), **angle}
        for joint in self.m.joints:
            name, (first, second) = joint.name, joint.bodies
            near, far = (located(self.m, com, angle, body, name) for body in joint.bodies)
            if not joint.prismatic:
                gap[name] = near - far
                force[name] = self._of_pin(joint, raw, multiplier, gap[name])
                continue
            along, pushed = joint.direction * np.exp(1j * turned[first]), drives.get(name, 0.0)
            if name in self.model.blocks:
                height[name] = np.imag((far - near) * np.conj(along))
                tilt[name] = turned[second] - turned[first] - joint.angle
                gap[name] = -1j * height[name] * along
                arms = [far - com.get(body, 0.0) for body in joint.bodies]
                walls, moment[name] = self.model.blocks[name].on_second(raw[f"walls {name}"], arms)
                force[name] = walls + pushed * along
                continue
            laws = [raw[law][:, 0] for law in (f"law {name}", f"nonlinear {name}") if law in raw]
            force[name] = (pushed - sum(laws) + 1j * multiplier * raw[f"force {name}"][:, 1]) * along
            moment[name] = -multiplier * raw[f"moment {name}"][:, 2]
        moved = [self.m.joint(name) for name in self.model.drives or ()]
        loads = {signal.name: load for signal, load in zip(driving(moved), drives.values(), strict=False)}
        return Record(time, com, angle, velocity, spin, acceleration, spin_up, gap, height, tilt, force, moment, loads)

    def _of_pin(self, joint: Joint, raw: Mapping[str, np.ndarray], multiplier: float, gap: np.ndarray) -> np.ndarray:
        """Force (M,) N of a revolute joint's first body on its second."""
        name, sensed = joint.name, raw[f"force {joint.name}"]
        if name not in self.model.clearance:
            return (-1.0 if name in self.model.bearings else multiplier) * _plane(sensed)
        if self.model.joint_model == "massless-link" and self.model.motion == "driven":
            return np.asarray(sensed[:, 0] * gap / np.abs(gap))  # the multiplier is the tension
        rub = self.model.rubs.get(name)
        return -_plane(sensed) + (0.0 if rub is None else rub.on_second(raw[f"rub {name}"]))

    def _drives(self, raw: Mapping[str, np.ndarray], multiplier: float, size: int) -> dict[str, np.ndarray]:
        """What each motor, or what holds a joint, gives (N.m, N), by joint; a crank's, by no joint."""
        if self.model.drives is not None:
            return {name: multiplier * raw[f"drive {name}"][:, 0] for name in self.model.drives}
        if self.model.drive is None:
            return {"": np.zeros(size)}
        return {"": raw["drive"][:, 0] * (1.0 if self.model.compliant else multiplier)}


def _plane(xy: np.ndarray) -> np.ndarray:
    """Vectors (M,), complex, of columns whose first are x and y."""
    return np.asarray(xy[:, 0] + 1j * xy[:, 1])
