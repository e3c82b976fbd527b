"""Run by the system's Python, which has Siconos: the slider-crank with play in its guide, from many starts.

    python3 siconos_run.py direct|combined < six numbers a line (angles, rates)

Where it is run it writes ``siconos_guide.c``, compiles it, and prints a row a start: angles and rates after FIRST
steps, angles and rates at the end (rad, rad/s), and the share of samples with every gap above 1e-6 m.
"""

import subprocess
import sys

import siconos.kernel as sk
import siconos.numerics as sn

STEP, END = 1e-4, 0.2  # s
FIRST = 26  # steps, in which nothing is touched
NUMBERS = """
#include <math.h>
#define L1 0.153
#define L2 0.306
#define A 0.05
#define B 0.025
#define C 0.001
static const double m1 = 0.038, m2 = 0.038, m3 = 0.076, g = 9.81;
#define JOINT ((m2 / 2 + m3) * L1 * L2)
#define QV unsigned n, double *q, double *v, double *out, unsigned k, double *z
#define TQV double t, QV

void mass(unsigned n, double *q, double *out, unsigned k, double *z) {
  for (int i = 0; i < 9; ++i) out[i] = 0;
  out[0] = 7.4e-5 + (m1 / 4 + m2 + m3) * L1 * L1;
  out[1] = out[3] = JOINT * cos(q[0] - q[1]);
  out[4] = 5.9e-4 + (m2 / 4 + m3) * L2 * L2;
  out[8] = 2.7e-6;
}
void turning(QV) {
  out[0] = JOINT * sin(q[0] - q[1]) * v[1] * v[1];
  out[1] = -JOINT * sin(q[0] - q[1]) * v[0] * v[0];
  out[2] = 0;
}
void turning_q(QV) {
  for (int i = 0; i < 9; ++i) out[i] = 0;
  double c = JOINT * cos(q[0] - q[1]);
  out[0] = c * v[1] * v[1]; out[3] = -out[0];
  out[4] = c * v[0] * v[0]; out[1] = -out[4];
}
void turning_v(QV) {
  for (int i = 0; i < 9; ++i) out[i] = 0;
  double s = 2 * JOINT * sin(q[0] - q[1]);
  out[1] = -s * v[0]; out[3] = s * v[1];
}
void weight(TQV) {
  out[0] = (m1 / 2 + m2 + m3) * g * L1 * cos(q[0]);
  out[1] = (m2 / 2 + m3) * g * L2 * cos(q[1]);
  out[2] = 0;
}
void weight_q(TQV) {
  for (int i = 0; i < 9; ++i) out[i] = 0;
  out[0] = -(m1 / 2 + m2 + m3) * g * L1 * sin(q[0]);
  out[4] = -(m2 / 2 + m3) * g * L2 * sin(q[1]);
}
void weight_v(TQV) { for (int i = 0; i < 9; ++i) out[i] = 0; }
/* a corner: its distance from the wall and its place along it; the rows of their rates, column by column */
#define CORNER(name, a, side) \\
  void gap_##name(unsigned n, double *q, unsigned rows, double *y, unsigned k, double *z) { \\
    y[0] = B + C - side * (L1 * sin(q[0]) + L2 * sin(q[1]) + a * sin(q[2])) - B * cos(q[2]); \\
    y[1] = L1 * cos(q[0]) + L2 * cos(q[1]) + a * cos(q[2]) - side * B * sin(q[2]); \\
  } \\
  void rows_##name(unsigned n, double *q, unsigned rows, double *w, unsigned k, double *z) { \\
    w[0] = -side * L1 * cos(q[0]); w[1] = -L1 * sin(q[0]); \\
    w[2] = -side * L2 * cos(q[1]); w[3] = -L2 * sin(q[1]); \\
    w[4] = -side * a * cos(q[2]) + B * sin(q[2]); w[5] = -a * sin(q[2]) - side * B * cos(q[2]); \\
  }
CORNER(1, -A, 1) CORNER(2, A, 1) CORNER(3, -A, -1) CORNER(4, A, -1)
"""


def one_run(kind: str, start: list[float]) -> list[float]:
    """Angles and rates after FIRST steps and at the end, and share of free samples."""
    ds = sk.LagrangianDS(start[:3], start[3:], "siconos_guide:mass")
    ds.setComputeFGyrFunction("siconos_guide", "turning")
    ds.setComputeJacobianFGyrqFunction("siconos_guide", "turning_q")
    ds.setComputeJacobianFGyrqDotFunction("siconos_guide", "turning_v")
    ds.setComputeFIntFunction("siconos_guide", "weight")
    ds.setComputeJacobianFIntqFunction("siconos_guide", "weight_q")
    ds.setComputeJacobianFIntqDotFunction("siconos_guide", "weight_v")
    world = sk.NonSmoothDynamicalSystem(0.0, END)
    world.insertDynamicalSystem(ds)
    corners = []
    for name in "1234":
        law = sk.NewtonImpactFrictionNSL(0.4, 0.0, 0.01, 2)
        rows = sk.LagrangianScleronomousR("siconos_guide:gap_" + name, "siconos_guide:rows_" + name)
        corners.append(sk.Interaction(law, rows))
        world.link(corners[-1], ds)
    impact = sk.FrictionContact(2, sn.SICONOS_FRICTION_2D_ENUM)
    options = impact.numericsSolverOptions()
    options.dparam[0], options.iparam[0] = 1e-8, 100
    position, clock = sk.MLCPProjectOnConstraints(), sk.TimeDiscretisation(0.0, STEP)
    if kind == "direct":
        osi = sk.MoreauJeanDirectProjectionOSI(0.5, 0.0)
        osi.setDeactivateYPosThreshold(1e-7)
        osi.setDeactivateYVelThreshold(0.0)
        osi.setActivateYPosThreshold(1e-6)
        osi.setActivateYVelThreshold(100.0)
        steps = sk.TimeSteppingDirectProjection(world, clock, osi, impact, position, 0)
        steps.setProjectionMaxIteration(10)
    else:
        osi = sk.MoreauJeanCombinedProjectionOSI(0.5)
        steps = sk.TimeSteppingCombinedProjection(world, clock, osi, impact, position, 2)
        steps.setProjectionMaxIteration(500)
    steps.setConstraintTolUnilateral(1e-10)
    steps.setConstraintTol(1e-10)
    free, early = [], []
    while steps.hasNextEvent():
        steps.advanceToEvent()
        free.append(min(corner.y(0)[0] for corner in corners) > 1e-6)
        steps.processEvents()
        if len(free) == FIRST:
            early = [*ds.q(), *ds.velocity()]
    return [*early, *ds.q(), *ds.velocity(), sum(free) / len(free)]


def main() -> None:
    """Print a row a start."""
    with open("siconos_guide.c", "w") as file:
        file.write(NUMBERS)
    subprocess.run(["cc", "-O2", "-shared", "-fPIC", "-o", "siconos_guide.so", "siconos_guide.c", "-lm"], check=True)
    for line in sys.stdin:
        row = one_run(sys.argv[1], [float(x) for x in line.split()])
        print("row", *(repr(float(x)) for x in row), flush=True)


if __name__ == "__main__":
    main()
