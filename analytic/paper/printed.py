"""The paper's equations exactly as printed, errata included, beside their corrected twins; and the numbers it prints.

**Eq. 2**, element matrix.  Printed: [[k_b, -k_b], [-k_b, k_b]].  Right: the 12 x 12 beam, whose blocks differ in the
signs of 6EI/L^2 and have 2EI/L beside 4EI/L (``frame.beam_stiffness``).  As printed, a rigid rotation makes force and a
uniform turn of both ends none; with k_rz = 0 the four-bar is singular.  The matrix's rank (6) and the tip deflection of
a cantilever do not show it.

**Eq. 3**, text.  Printed: moments of area I_y, "I_yz".  Right: I_y, I_z.  Notation only.

**Eq. 4**, text.  Printed: k_ix, k_iy, k_iz, and k_r in N/rad.  Right: k_tx, k_ty, k_tz, and k_r in N.m/rad.  Notation
and unit.

**Eq. 11**.  Printed: F_O3x + F_y in the coupler's x row.  Right: F_y in its y row.  As printed, reactions turn by tens
of degrees and lose their size; F_34 keeps its line where the follower is a two-force member, as in the paper's case, so
that gamma = 30 deg there does not show it.

**Eq. 13**.  Printed: m (h^2 + e^2)/12, h and e the section's sides.  Right: m (L^2 + h^2)/12, h the height in the
plane.  As printed, 200 times too small for L = 0.2 m; the paper's case, where no link has alpha, does not show it.

**Section 4**.  Printed: m_2 = m_4 = 0157 kg, m_3 = 0314 kg.  Right: 0.157 kg, 0.314 kg.  The decimal point is lost.

Eqs. 8-10, 12 and 14, and every sign of Eq. 11, are right as printed; :func:`kinetostatic_matrix` derives them.

No equation here uses the general code: positions and rates are the textbook's closed form for a four-bar, so that this
and :mod:`analytic.paper.kinetostatics` can be tested against each other.  Only :func:`printed_figures` sets what the
paper prints beside what the general code gives.  Links are 2 (crank, D to A), 3 (coupler, A to B)
and 4 (follower, E to B); arrays of links are in that order.  SI units, radians, ground frame, vectors x + iy.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analytic.kinematics.assembly import Assembly
from analytic.mechanism import Mechanism
from analytic.mechanism.file import load
from analytic.mechanism.one_line import angles, one_line
from analytic.mechanism.signals import Component, Signal, wrapped
from analytic.paper.clearance import MODELS, displaced
from analytic.paper.frame import ElasticBar

EQ_8_AT_30_DEG: dict[Component, float] = {"x": 0.0087, "y": 0.005}  # m, as section 4 prints them for joint B
REACTION_UNKNOWNS = ("F_12x", "F_12y", "F_23x", "F_23y", "F_34x", "F_34y", "F_14x", "F_14y", "T_s")  # F_B of Eq. 12


# ---------------------------------------------------------------- Eqs. 2 and 3


def printed_beam_block(bar: ElasticBar) -> np.ndarray:
    """k_b (6, 6) of Eq. 3; as printed, and right as the stiffness of the first end of a bar whose second is clamped."""
    e, length = bar.youngs_modulus, bar.length
    k = np.diag([
        e * bar.area / length,
        12 * e * bar.i_z / length**3,
        12 * e * bar.i_y / length**3,
        bar.shear_modulus * bar.torsion_constant / length,
        4 * e * bar.i_y / length,
        4 * e * bar.i_z / length,
    ])  # fmt: skip
    k[2, 4] = k[4, 2] = -6 * e * bar.i_y / length**2
    k[1, 5] = k[5, 1] = 6 * e * bar.i_z / length**2
    return k


def printed_beam_stiffness(bar: ElasticBar) -> np.ndarray:
    """Element matrix (12, 12) of Eq. 2 as printed: wrong, see the module's table; right is ``frame.beam_stiffness``."""
    return np.kron([[1.0, -1.0], [-1.0, 1.0]], printed_beam_block(bar))


# ---------------------------------------------------------------- Eq. 8 and Eq. 13


def clearance_displacement(clearance: float, gamma: np.ndarray | float) -> np.ndarray:
    """Eq. 8 (right as printed): displacement (m, complex) of a pin with radial clearance (m), reaction at angle
    gamma.
    """
    return clearance * np.cos(gamma) + 1j * clearance * np.sin(gamma)


def printed_moment_of_inertia(mass: float, height: float, depth: float) -> float:
    """Eq. 13 as printed (kg.m^2): both sides of the section, which is the inertia about the bar's own long axis."""
    return mass * (height**2 + depth**2) / 12


def moment_of_inertia(mass: float, length: float, height: float) -> float:
    """Eq. 13 corrected (kg.m^2): a uniform bar about the normal to its plane through its com."""
    return mass * (length**2 + height**2) / 12


@dataclass(frozen=True)
class PrintedFigure:
    """A number that the paper prints for its own case, and what this project has for it; in the signal's SI unit."""

    signal: Signal
    crank_angle: float  # rad
    printed: float
    first_order: float  # by the paper's own procedure
    equilibrium: float  # of the displaced linkage
    source: str


def printed_figures(mechanism: Mechanism) -> tuple[PrintedFigure, ...]:
    """The displacement of joint B at a crank angle of 30 deg (section 4, by Eq. 8): its x and its y.

    Empty for every mechanism but the paper's own: one whose every field, the clearance of 0.01 m in B and the speed
    included, equals that of the shipped case ``paper``, wherever it was read from.
    """
    if mechanism != load("paper"):
        return ()
    assembly, theta, speed = Assembly(mechanism), np.radians([30.0]), mechanism.speed or 0.0
    by_model = {model: displaced(assembly, theta, speed, model=model).signals() for model in MODELS}
    figures = []
    for component, printed in EQ_8_AT_30_DEG.items():
        signal = Signal("clearance", "B", component)
        first_order, equilibrium = (float(by_model[model][signal.name][0]) for model in ("first_order", "equilibrium"))
        figures.append(PrintedFigure(signal, float(theta[0]), printed, first_order, equilibrium, "Eq. 8"))
    return tuple(figures)


# ---------------------------------------------------------------- the four-bar's motion


@dataclass(frozen=True)
class FourBar:
    """Four-bar linkage with its ground pivots on the x axis; ``com`` is the distance r_g from D, A, E along each link
    (m).
    """

    ground: float  # r1, m
    length: tuple[float, float, float]  # r2, r3, r4, m
    com: tuple[float, float, float]  # r_g2, r_g3, r_g4, m
    mass: tuple[float, float, float]  # kg
    inertia: tuple[float, float, float]  # kg.m^2 about the com
    crossed: bool = False


@dataclass(frozen=True)
class FourBarMotion:
    """Angles (rad), their accelerations (rad/s^2) and the coms' accelerations A_g (m/s^2, complex) of links 2, 3, 4;
    (3, N).
    """

    angle: np.ndarray
    angular_acceleration: np.ndarray
    acceleration: np.ndarray

    def __repr__(self) -> str:
        return one_line(self, angles(self.angle[0]))


def four_bar_motion(bar: FourBar, theta_2: np.ndarray, omega_2: float) -> FourBarMotion:
    """Motion at crank angles theta_2 (N,) rad and constant crank speed omega_2 (rad/s).

    Position by Freudenstein's equation in tan(theta_4 / 2), rates by differentiating the loop r2 + r3 = r1 + r4 (Erdman
    and Sandor; Norton, Design of Machinery, sections 4.5, 6.7, 7.3).  Raises ValueError where the loop does not close
    or the coupler and the follower are in line.
    """
    r1, (r2, r3, r4) = bar.ground, bar.length
    k1, k2, k3 = r1 / r2, r1 / r4, (r1**2 + r2**2 - r3**2 + r4**2) / (2 * r2 * r4)
    cosine = np.cos(theta_2)
    a, b, c = cosine - k1 - k2 * cosine + k3, -2 * np.sin(theta_2), k1 - (k2 + 1) * cosine + k3
    square = b**2 - 4 * a * c
    if np.any(square < 0):
        raise ValueError(
            f"crank angle {np.degrees(theta_2[square < 0][0]):.6g} deg cannot be reached by links {bar.length} m on"
            f" ground {r1} m"
        )
    theta_4 = wrapped(2 * np.arctan2(-b + (1 if bar.crossed else -1) * np.sqrt(square), 2 * a))
    e_2, e_4 = np.exp(1j * theta_2), np.exp(1j * theta_4)
    theta_3 = np.angle(r1 + r4 * e_4 - r2 * e_2)
    e_3 = np.exp(1j * theta_3)
    transmission = np.sin(theta_3 - theta_4)
    if np.any(np.abs(transmission) < 1e-7):
        at = theta_2[np.argmin(np.abs(transmission))]
        raise ValueError(
            f"crank angle {np.degrees(at):.6g} deg is a change point: coupler and follower are in line; keep clear"
            " of it"
        )
    omega_3 = r2 * omega_2 * np.sin(theta_4 - theta_2) / (r3 * transmission)
    omega_4 = r2 * omega_2 * np.sin(theta_3 - theta_2) / (r4 * transmission)
    centripetal = -r2 * omega_2**2 * e_2 - r3 * omega_3**2 * e_3 + r4 * omega_4**2 * e_4
    alpha_3 = (centripetal * e_4.conj()).real / (r3 * transmission)
    alpha_4 = (centripetal * e_3.conj()).real / (r4 * transmission)
    g_2, g_3, g_4 = bar.com
    acceleration = np.array([
        -g_2 * omega_2**2 * e_2,
        -r2 * omega_2**2 * e_2 + g_3 * (1j * alpha_3 - omega_3**2) * e_3,
        g_4 * (1j * alpha_4 - omega_4**2) * e_4,
    ])  # fmt: skip
    return FourBarMotion(np.array([theta_2, theta_3, theta_4]), np.array([0 * theta_2, alpha_3, alpha_4]), acceleration)


# ---------------------------------------------------------------- Eqs. 9-12 and 14


def inertia_forces(bar: FourBar, motion: FourBarMotion) -> tuple[np.ndarray, np.ndarray]:
    """F_O (N, complex) and T_O (N.m) of links 2, 3, 4, (3, N) each: Eqs. 9, 10 and 14, right as printed."""
    mass, inertia = np.array(bar.mass)[:, None], np.array(bar.inertia)[:, None]
    beta = np.angle(motion.acceleration)
    return mass * np.abs(motion.acceleration) * np.exp(1j * (beta + np.pi)), -inertia * motion.angular_acceleration


def kinetostatic_matrix(bar: FourBar, angle: np.ndarray) -> np.ndarray:
    """[L] (N, 9, 9) of Eq. 12 for link angles (3, N): rows F_Ox, F_Oy, T_O of links 2, 3, 4 as in Eq. 11, columns
    REACTION_UNKNOWNS.

    Each row is the link's balance (forces on it, inertia included, sum to zero) with the inertia term taken to the
    left. F_jk acts on link k, and on link j with the opposite sign:

    * link 2: F_12 at D and -F_23 at A, so F_O2 = -F_12 + F_23.  Link 3: F_23 at A and -F_34 at B, alike;
    * link 4: F_34 at B *and* F_14 at E both act on it, so F_O4 = -F_34 - F_14, and its moment row has the signs of F_34
      turned against those of F_23 in link 2's although the geometry is the same;
    * a force F at distance s along a link from its com has the moment s (F_y cos theta - F_x sin theta), with s = -r_g
      at the first end and r - r_g at the second.  T_s, on link 2, is the motor's; T_L, on link 4, is known and moves to
      the left.
    """
    cosine, sine = np.cos(angle), np.sin(angle)
    matrix = np.zeros((angle.shape[1], 9, 9))
    ends = (
        (0, 1, 2, -1),
        (2, 1, 4, -1),
        (6, 1, 4, 1),
    )  # column and sign on the link of the first end's force, then the second's
    for link, (first, first_sign, second, second_sign) in enumerate(ends):
        for column, sign, s in (
            (first, first_sign, -bar.com[link]),
            (second, second_sign, bar.length[link] - bar.com[link]),
        ):
            matrix[:, 3 * link, column] = matrix[:, 3 * link + 1, column + 1] = -sign
            matrix[:, 3 * link + 2, column] = sign * s * sine[link]
            matrix[:, 3 * link + 2, column + 1] = -sign * s * cosine[link]
    matrix[:, 2, 8] = -1.0
    return matrix


def printed_reactions(bar: FourBar, motion: FourBarMotion, force_y: float) -> dict[str, np.ndarray]:
    """Eq. 11 as printed, with the load F_y (N) of the coupler's com in the x row: wrong, see the module's table."""
    return _reactions(bar, motion, 3, force_y, 0.0)


def reactions(bar: FourBar, motion: FourBarMotion, force_y: float, load_torque: float = 0.0) -> dict[str, np.ndarray]:
    """Eq. 11 corrected: F_12, F_23, F_34, F_14 (N, complex (N,), F_jk of link j on link k) and T_s (N.m), by name.

    ``force_y`` (N) acts at the coupler's com, ``load_torque`` T_L (N.m, counterclockwise) on the follower.
    """
    return _reactions(bar, motion, 4, force_y, load_torque)


def _reactions(
    bar: FourBar, motion: FourBarMotion, load_row: int, force_y: float, load_torque: float
) -> dict[str, np.ndarray]:
    force, torque = inertia_forces(bar, motion)
    known = np.stack([force.real, force.imag, torque], axis=1).reshape(9, -1)  # F_D: x, y, torque of each link in turn
    known[load_row] += force_y
    known[8] += load_torque
    solved = np.linalg.solve(kinetostatic_matrix(bar, motion.angle), known.T[..., None])[..., 0].T
    return {name: solved[2 * i] + 1j * solved[2 * i + 1] for i, name in enumerate(("F_12", "F_23", "F_34", "F_14"))} | {
        "T_s": solved[8]
    }
