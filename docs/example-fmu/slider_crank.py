"""A slider-crank in closed form, as an FMU: pythonfmu packs this file, and nothing of this project is in it.

The crank is turned by its angle, speed and acceleration, or by its speed alone from an angle on; reactions and the
motor's torque come out.  Forces are those of the shaft's side on the load's, but for one: the y component in the crank
pin is that of the rod on the crank.
"""

from __future__ import annotations

import cmath
import math

from pythonfmu import Boolean, DefaultExperiment, Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

CRANK, ROD = 0.05, 0.12  # m
PARAMETERS = {"m_crank": 0.30, "J_crank": 1.0e-4, "m_rod": 0.21, "J_rod": 2.5e-4, "m_slider": 0.14}
OUTPUTS = (
    "O_x O_y crank_on_rod_x rod_on_crank_y B_x B_y S_y torque crank_deg crank_speed crank_com_x crank_com_y rod_angle"
    " rod_speed rod_com_x rod_com_y slider_x S_x S_moment slider_y slider_angle slider_speed"
).split()


def cross(one: complex, other: complex) -> float:
    """The moment of a force about the point from which an arm counts."""
    return (one.conjugate() * other).imag


class SliderCrank(Fmi2Slave):
    """The slider-crank; with ``by_speed`` its speed alone turns it, from ``phi_0`` (rad) on."""

    default_experiment = DefaultExperiment(start_time=0.0, step_size=1e-4)

    def __init__(self, **given: object) -> None:
        super().__init__(**given)
        self.phi = self.omega = self.alpha = 0.0
        self.by_speed, self.phi_0 = False, 0.0
        for name in ("phi", "omega", "alpha"):
            self.register_variable(Real(name, causality=Fmi2Causality.input))
        for name, value in PARAMETERS.items():
            setattr(self, name, value)
            self.register_variable(Real(name, causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable))
        for name in OUTPUTS:
            setattr(self, name, 0.0)
            self.register_variable(Real(name, causality=Fmi2Causality.output))
        self.register_variable(Real("phi_0", causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable))
        self.register_variable(
            Boolean("by_speed", causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable)
        )

    def exit_initialization_mode(self) -> None:
        """The outputs at time 0."""
        if self.by_speed:
            self.phi = self.phi_0
        self.solve()

    def do_step(self, now: float, step: float) -> bool:
        """The outputs at the end of a step, where the inputs already are."""
        if self.by_speed:
            self.phi += self.omega * step
        self.solve()
        return True

    def solve(self) -> None:
        """Everything at the angle, speed and acceleration that are set."""
        phi, omega, alpha = self.phi, self.omega, self.alpha
        beta = -math.asin(CRANK / ROD * math.sin(phi))
        along, lies = cmath.exp(1j * phi), cmath.exp(1j * beta)
        beta_1 = -CRANK * math.cos(phi) * omega / (ROD * math.cos(beta))
        beta_2 = CRANK * (math.sin(phi) * omega**2 - math.cos(phi) * alpha) + ROD * math.sin(beta) * beta_1**2
        beta_2 /= ROD * math.cos(beta)
        turned, swung = (1j * alpha - omega**2) * along, (1j * beta_2 - beta_1**2) * lies
        slider_force = self.m_slider * (CRANK * turned + ROD * swung).real
        rod_inertia = self.m_rod * (CRANK * turned + ROD / 2 * swung)
        arm = -ROD * lies  # of A from B
        moment = self.J_rod * beta_2 + ROD / 2 * cross(lies, rod_inertia)
        b = complex(slider_force, (moment + arm.imag * slider_force) / arm.real)
        a = rod_inertia + b
        o = self.m_crank * CRANK / 2 * turned + a
        self.torque = 1e3 * (self.J_crank * alpha + CRANK / 2 * (cross(along, o) + cross(along, a)))
        self.O_x, self.O_y, self.B_x, self.B_y = o.real, o.imag, b.real, b.imag
        self.crank_on_rod_x, self.rod_on_crank_y, self.S_y = a.real, -a.imag, -b.imag
        self.crank_deg, self.crank_speed = math.degrees(phi), omega
        self.rod_angle, self.rod_speed = beta, beta_1
        crank, rod = CRANK / 2 * along, CRANK * along + ROD / 2 * lies
        self.crank_com_x, self.crank_com_y, self.rod_com_x, self.rod_com_y = crank.real, crank.imag, rod.real, rod.imag
        self.slider_x = (CRANK * along + ROD * lies).real
