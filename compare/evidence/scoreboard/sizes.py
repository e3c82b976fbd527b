"""How large a hidden effect is: ways in which it grows from nothing, and its signature in sigmas, alone and beside its
best rival.

A signature is the difference that an effect makes to all readings, each over its noise, by the analytic model.  What is
left of it after the best single rival (any other effect, anywhere, physically possible) has been fitted to it, with the
other true effects free to move, says whether anyone could name it: ``distinct``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from analytic.beyond_paper.drive import Motor
from compare.diagnose.effects.effect import Reciprocal, Rig
from compare.diagnose.effects.joints import OnJoint
from compare.diagnose.effects.sensors import EncoderOffset
from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.diagnose.fit import Data, Fit, Fitter
from compare.diagnose.isolate import candidates, signatures
from compare.diagnose.predict import Model, Term
from compare.evidence.scoreboard.rigs import Bench, Rejected, ideal

SMALLEST, LARGEST = 6.0, 60.0  # sigmas of a signature: a decade, down to just above the noise
RIVALS = 8  # fitted in full, at most
Values = dict[str, float]


@dataclass(frozen=True)
class Growth:
    """An effect at a place as a function of one number: nothing at 0, signature about linear in it, physical up to
    ``most``.
    """

    term: Term
    values: Callable[[float], Values]
    most: float


@dataclass(frozen=True)
class Planted:
    """A true effect.  ``total`` sigmas of signature, and what the best rival leaves of it: ``linear`` projected out
    without regard to what is physical, ``distinct`` fitted in full.
    """

    name: str
    where: str
    values: Values
    total: float = 0.0
    linear: float = 0.0
    distinct: float = 0.0
    rival: str | None = None


def growth(name: str, where: str, bench: Bench, rig: Rig, rng: np.random.Generator) -> Growth:
    """A random way for an effect to grow."""
    m = rig.mechanism
    effect = VOCABULARY[name]
    turn, sign = rng.uniform(0, 2 * math.pi), float(rng.choice([-1, 1]))
    c, s = math.cos(turn), math.sin(turn)
    body = m.moving.get(where)
    joint = next((j for j in m.joints if j.name == where), None)
    size = (body.length if body is not None else 0.0) or rig.length
    shortest = min(b.length for b in m.bodies if b.length > 0)
    torque = rig.force if joint is not None and joint.prismatic else rig.torque
    variant, most = 0.0, math.inf
    values: Callable[[float], Values]
    if name == "gravity":
        values, most = lambda a: {"x": m.gravity[0] + a * c, "y": m.gravity[1] + a * s}, 9.81
    elif name == "payload":
        assert body is not None
        along, normal, mass = rng.uniform(-0.4, 0.4) * size, rng.uniform(-0.2, 0.2) * size, body.mass
        values, most = lambda a: {"mass": a * mass, "along": along, "normal": normal}, 1.0
    elif name == "com_offset":
        values, most = lambda a: {"along": a * c * size, "normal": a * s * size}, 0.2
    elif name == "moment_of_inertia":
        assert body is not None
        own = body.moment_of_inertia or body.mass * size**2
        values, most = lambda a: {"inertia_error": a * sign * own}, (3.0 if sign > 0 else 0.8)
    elif name == "link_length":
        values, most = lambda a: {"length_error": a * sign * size}, 0.02
    elif name == "pivot_position":
        values, most = lambda a: {"x": a * c * rig.length, "y": a * s * rig.length}, 0.02
    elif name == "joint_clearance":
        values, most = lambda a: {"radial_clearance": a * shortest}, 0.01
    elif name == "coulomb_friction":
        values, most = lambda a: {"friction_torque": a * torque}, 0.5
    elif name == "viscous_friction":
        damping = torque / rig.speed / (rig.length if joint is not None and joint.prismatic else 1.0)
        values, most = lambda a: {"damping": a * damping}, 0.5
    elif name == "joint_spring":
        rest = _rest(bench, where, rng)
        stiffness = torque / rig.length if joint is not None and joint.prismatic else torque
        values, most = lambda a: {"stiffness": a * stiffness, "rest_angle": rest}, 0.5
    elif name == "external_force":
        values, most = lambda a: {"x": a * c * rig.force, "y": a * s * rig.force}, 0.5
    elif name == "load_torque":
        values, most = lambda a: {"torque": a * sign * rig.torque}, 0.5
    elif name == "link_flexibility":
        values, most = lambda a: {"youngs_modulus": 2e11 / a}, 100.0
    elif name == "drive_compliance":
        values, most = lambda a: {"stiffness": rig.torque / a}, 0.02
    elif name == "speed_ripple":
        variant = float(rng.integers(1, 7))
        values, most = lambda a: {"amplitude": a, "harmonic": variant, "phase": turn - math.pi}, 0.02
    elif name == "encoder_offset":
        share = rng.uniform(-1, 1, len(rig.driven))
        if len(rig.driven) > 1 and rng.random() < 0.3:
            variant = EncoderOffset.each_run
            values, most = (
                lambda a: {f"offset@{run}": a * float(k) for run, k in zip(rig.driven, share, strict=True)},
                0.05,
            )
        else:
            values, most = lambda a: {"offset": a * sign}, 0.05
    elif name == "sensor_bias":
        values, most = lambda a: {"bias": a * sign * rig.noise[where]}, 30.0
    elif name == "sensor_gain":
        values, most = lambda a: {"gain_error": a * sign}, 0.2
    elif name == "sensor_delay":
        values, most = lambda a: {"delay": a}, 0.1 / rig.speed
    elif name == "sensor_frame":
        variant = float(rng.choice([math.pi / 2, math.pi, -math.pi / 2])) if rng.random() < 0.25 else 0.0
        values, most = lambda a: {"rotation": variant + a * sign}, 0.3
    elif name == "clock_offset":
        speed = next(abs(p.speed) for p in bench.plans if p.name == where)
        values, most = lambda a: {"offset": a * sign}, 0.1 / speed
    else:
        raise KeyError(f"{name}: no way to draw this effect is known")
    return Growth(Term(effect, where, variant), values, most)


def _rest(bench: Bench, where: str, rng: np.random.Generator) -> float:
    """Where a spring might rest: about the middle of its joint's travel (rad, or m)."""
    m, plan = bench.nominal, bench.plans[0]
    signals, joint = ideal(m, plan), m.joint(where)
    first, second = joint.bodies
    if joint.prismatic:
        travel = signals[f"{second}_x"]
        return float(rng.uniform(travel.min(), travel.max()))
    angle = signals[f"{second}_angle"] - (signals[f"{first}_angle"] if first in m.moving else 0.0)
    return float(angle.mean() + rng.uniform(-1.0, 1.0))


def natural(term: Term, rig: Rig, values: Mapping[str, float]) -> np.ndarray:
    """Natural coordinates of reported values: the inverse of ``Effect.values``."""
    v, effect = np.array(list(values.values())), term.effect
    if effect.name == "gravity":
        return np.asarray(v - rig.mechanism.gravity)
    if isinstance(effect, OnJoint):
        return np.asarray(v - effect.nominal(rig, term.where))
    if effect.name == "joint_spring":
        return np.array([v[0], v[0] * v[1]])
    if isinstance(effect, Reciprocal):
        return np.asarray(1 / v)
    if effect.name == "speed_ripple":
        return np.asarray(v[0] * np.array([math.cos(v[2]), math.sin(v[2])]))
    return np.asarray(v - term.variant) if effect.name == "sensor_frame" else v


# ---------------------------------------------------------------- in sigmas


class Sizer:
    """Signatures on a bench."""

    def __init__(self, bench: Bench) -> None:
        self.bench, self.rig = bench, bench.rig

    def model(self, truth: Sequence[tuple[Term, Values]]) -> Model:
        """The analytic model of the bench; what a run follows is the encoder's column, offset and all."""
        courses = {}
        for plan in self.bench.plans:
            offset = sum(EncoderOffset.offset(plan.name, v) for t, v in truth if t.effect.name == EncoderOffset.name)
            courses[plan.name] = Motor(course=CubicSpline(plan.time, plan.command(plan.time) + offset))
        return Model(self.bench.measured(), self.rig, self.bench.nominal, courses)

    def data(self, truth: Sequence[tuple[Term, Values]]) -> tuple[Model, Data]:
        """The model, and what noiseless sensors would read.  Raises Rejected where the truth is not possible."""
        model = self.model(truth)
        readings = model([truth])[0]
        if readings is None or not all(np.isfinite(v).all() for run in readings for v in run.values()):
            raise Rejected("the truth is not possible everywhere")
        measured = self.bench.measured(readings)
        noise = {(run.name, s): c.noise for run in measured.runs for s, c in run.channels.items()}
        return model, Data(measured, noise, self.rig.encoder)

    def total(self, truth: Sequence[tuple[Term, Values]], i: int) -> float:
        """Sigmas that the readings change by when the i-th effect goes."""
        model, data = self.data(truth)
        found = model([[t for k, t in enumerate(truth) if k != i]])[0]
        if found is None:
            raise Rejected("the mechanism is not possible without one of its effects")
        return float(np.linalg.norm(data.residual(found)))

    def grown(self, way: Growth, target: float) -> Values:
        """Values whose signature, alone, is about the target, or as large as is physical.  Raises Rejected where it
        hardly shows.
        """
        if way.term.effect.name == "sensor_frame" and way.term.variant:
            return way.values(0.0)  # a quarter turn is what it is
        amount = min(1e-3 * way.most, 1.0)
        seen = 0.0
        for _ in range(4):
            seen = self.total([(way.term, way.values(amount))], 0)
            if abs(seen / target - 1) < 0.02 or (seen < target and amount == way.most):
                break
            if seen < 1e-9:
                raise Rejected(f"{way.term.label} does not show")
            amount = min(amount * target / seen, way.most)
        if seen < SMALLEST * 0.9:
            raise Rejected(f"{way.term.label} hardly shows: {seen:.2g} sigma at most")
        return way.values(amount)

    def judged(self, truth: Sequence[tuple[Term, Values]]) -> list[Planted]:
        """The true effects with their sizes.  Raises Rejected where one hides behind the others."""
        model, data = self.data(truth)
        fitter = Fitter(model, data, self.rig, self.bounds)
        terms = candidates(self.rig, VOCABULARY)
        out = []
        for i, (term, values) in enumerate(truth):
            others = [pair for k, pair in enumerate(truth) if k != i]
            base = self.without(fitter, others)
            linear, rival, distinct = self.rivalled(
                fitter, base, [t for t in terms if t.key not in [x.key for x, _ in truth]]
            )
            out.append(
                Planted(
                    term.effect.name,
                    term.where,
                    dict(values),
                    float(np.linalg.norm(base.residual)),
                    linear,
                    distinct,
                    rival,
                )
            )
        return out

    def bounds(self, term: Term) -> tuple[np.ndarray, np.ndarray]:
        """Physical bounds of natural coordinates."""
        low = term.effect.lowest(self.rig, term.where, term.variant)
        return low, np.full(low.size, math.inf)

    def without(self, fitter: Fitter, others: Sequence[tuple[Term, Values]]) -> Fit:
        """The other true effects at their true values as a fit; its residual is the signature of the missing one."""
        terms = tuple(t for t, _ in others)
        x = [natural(t, self.rig, v) for t, v in others]
        points = [x]
        scales = [np.asarray(t.effect.scales(self.rig, t.where, t.variant), float) for t in terms]
        for k, scale in enumerate(scales):
            points += [[xi + step if j == k else xi for j, xi in enumerate(x)] for step in np.diag(scale)]
        found = fitter.residuals(terms, points)
        base = found[0]
        if base is None:
            raise Rejected("the mechanism is not possible without one of its effects")
        steps = np.concatenate(scales) if scales else np.zeros(0)
        columns = [np.zeros(base.size) if r is None else (r - base) / h for r, h in zip(found[1:], steps, strict=True)]
        jacobian = np.column_stack(columns) if columns else np.zeros((base.size, 0))
        if columns and left(base, jacobian) < SMALLEST * 0.9:
            raise Rejected("an effect hides behind the others")
        return Fit(terms, tuple(x), base, jacobian, np.zeros(steps.size, bool))

    def rivalled(self, fitter: Fitter, base: Fit, rivals: Sequence[Term]) -> tuple[float, str | None, float]:
        """Sigmas of the base's residual that the best rival leaves, projected; that rival, and what it leaves when
        fitted.
        """
        found = signatures(fitter, base, rivals)
        order = []
        for term, sign in found.items():
            columns = np.column_stack([base.jacobian, sign.columns])
            coefficients = solve(columns, base.residual + sign.offset)
            rest = base.residual + sign.offset + columns @ coefficients
            order.append((float(np.linalg.norm(rest)), term.label, term.variant, term, coefficients))
        order.sort(key=lambda o: o[:3])
        best, rival = float(np.linalg.norm(base.residual)), None
        for lowest, label, _, term, coefficients in order[:RIVALS]:
            if lowest >= best:
                break
            k = base.jacobian.shape[1]
            start = dict(zip(base.terms, base.x, strict=True))
            start[term] = found[term].start(self.rig, coefficients[k:])
            fit = fitter.fit([*base.terms, term], start)
            if fit is not None and math.sqrt(fit.chi2) < best:
                best, rival = math.sqrt(fit.chi2), label
        return (order[0][0] if order else best), rival, best


def solve(columns: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """Coefficients (k,) of columns (N, k) that take most of the residual away: residual + columns @ coefficients is
    least.
    """
    norm = np.linalg.norm(columns, axis=0)
    norm[norm == 0] = 1.0
    scaled = columns / norm
    return np.asarray(-np.linalg.solve(scaled.T @ scaled + 1e-10 * np.eye(norm.size), scaled.T @ residual) / norm)


def left(residual: np.ndarray, columns: np.ndarray) -> float:
    """Norm of what columns cannot take away."""
    return float(np.linalg.norm(residual + columns @ solve(columns, residual)))
