"""What MuJoCo does silently, shown on MuJoCo itself, and that our engine is not caught by it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from analytic.kinematics.assembly import Assembly
from analytic.mechanism.file import load
from asked import request_of
from sim_models.engine import SimulationError
from sim_models.mujoco.engine import ENGINE
from sim_models.run.path import CrankPath

mujoco = pytest.importorskip("mujoco", exc_type=ImportError)
from sim_models.mujoco.mjcf import Setting  # noqa: E402
from sim_models.mujoco.model import MujocoLinkage  # noqa: E402 - it imports MuJoCo

pytestmark = pytest.mark.mujoco
PAPER = load("paper")
FOUR_BAR = """
<mujoco>
  <option gravity="0 0 -9.81" integrator="{integrator}" timestep="1e-3"/>
  <worldbody>
    <body name="crank"><joint type="hinge" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 .1 0 .1" size=".01" contype="0" conaffinity="0"/>
      <body name="coupler" pos=".1 0 .1"><joint type="hinge" axis="0 1 0"/>
        <geom type="capsule" fromto="0 0 0 .3 0 0" size=".01" contype="0" conaffinity="0"/></body></body>
    <body name="follower" pos=".3 0 0"><joint type="hinge" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 .1 0 .1" size=".01" contype="0" conaffinity="0"/></body>
  </worldbody>
  <equality><connect body1="coupler" body2="follower" anchor=".3 0 0"/></equality>
</mujoco>
"""


def closing_force(link: MujocoLinkage) -> complex:
    """Force (N) in the rows of the four-bar's closing pin, with the crank held."""
    m, d = link.model, link.data
    mujoco.mj_forward(m, d)
    rows = d.efc_type[: d.nefc] == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    return complex(*d.efc_force[: d.nefc][rows][:2])


def test_the_default_impedance_bends_an_ideal_joint() -> None:
    link = MujocoLinkage(PAPER, {}, CrankPath(Assembly(PAPER)).poses(np.radians(30.0)), Setting("ideal", 2.5e-5))
    ours = closing_force(link)
    link.model.eq_solimp[:], link.model.eq_solref[:] = (0.9, 0.95, 1e-3, 0.5, 2.0), (0.02, 1.0)
    default = closing_force(link)
    assert abs(abs(ours) / 50.0 - 1) < 3e-4  # 25 N upward on a pin at 30 deg: F_34 of the statics
    assert abs(default - ours) > 5e-3 * abs(ours)


def test_after_a_runge_kutta_step_forces_are_the_last_stages() -> None:
    off = {}
    for integrator in ("RK4", "implicitfast"):
        model = mujoco.MjModel.from_xml_string(FOUR_BAR.format(integrator=integrator))
        data = mujoco.MjData(model)
        mujoco.mj_step(model, data, nstep=300)
        left_behind = data.efc_force[:2].copy()
        mujoco.mj_forward(model, data)
        off[integrator] = np.abs(left_behind - data.efc_force[:2]).max() / np.abs(data.efc_force[:2]).max()
    assert off["RK4"] > 1e-7  # neither is of the state that the step ends in; ours are read after mj_forward
    m = load("crank-rocker")
    theta = np.radians([40.0, 41.0])
    fine, coarse = (
        ENGINE.simulate(request_of(m, "ideal", "driven", theta, step=h)).signals["reaction_B_x"] for h in (2e-6, 2e-5)
    )
    np.testing.assert_allclose(fine, coarse, rtol=1e-3)


def test_the_default_tolerance_stops_the_solver_early_and_ours_does_not() -> None:
    link = MujocoLinkage(PAPER, {}, CrankPath(Assembly(PAPER)).poses(np.radians(30.0)), Setting("ideal", 1e-4))
    assert mujoco.MjModel.from_xml_string("<mujoco/>").opt.tolerance > 0
    assert link.model.opt.tolerance <= 1e-14


def test_a_diverging_run_is_an_error_and_leaves_no_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    stiff = PAPER.with_joint("B", contact_stiffness=1e9, contact_damping=0.0)
    with pytest.raises(SimulationError, match=r"mujoco.*use a smaller step"):
        ENGINE.simulate(request_of(stiff, "spring-damper", "driven", np.radians([20.0, 60.0]), step=3e-3))
    assert list(tmp_path.iterdir()) == []  # MuJoCo writes MUJOCO_LOG.TXT into the current folder when left alone


@pytest.mark.parametrize("case", ["crank-rocker", "slider-crank", "six-bar"])
def test_the_writer_of_a_specification_prints_six_digits(case: str) -> None:
    """A specification of the same text compiles to the same bits; written out, its closed pins come apart."""
    m = load(case)
    link = MujocoLinkage(m, {}, CrankPath(Assembly(m)).poses(Assembly(m).start + 0.1), Setting("ideal", 1e-4))
    ours = mujoco.MjModel.from_xml_string(link.description.mjcf())
    specified = mujoco.MjSpec.from_string(link.description.mjcf())
    compiled, written = specified.compile(), mujoco.MjModel.from_xml_string(specified.to_xml())
    arrays = [name for name in dir(ours) if isinstance(getattr(ours, name), np.ndarray)]
    assert [name for name in arrays if not np.array_equal(getattr(ours, name), getattr(compiled, name))] == []

    def open_by(model: mujoco.MjModel) -> float:
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        ends = [[data.site(f"{j.name}:{body}").xpos for body in j.bodies] for j in link.description.closing]
        return max(float(np.abs(first - second).max()) for first, second in ends)

    assert open_by(ours) < 1e-15
    assert 1e-8 < open_by(written) < 1e-6  # m
