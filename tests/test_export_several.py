"""What is exported of linkages with several drives runs in each bare engine, and gives the same numbers."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from analytic.mechanism import Drive
from analytic.mechanism.file import load
from asked import request_of
from several_linkages import CASES, waved
from sim_models.common.units import Units
from sim_models.engine import ENGINES, JOINT_MODELS, Unsupported, check_exported, declared, engine
from test_export import bare, columns, command, difference, table

# of the largest value of a signal's kind; at rest contact makes forces of positions, and PyBullet's loops and free
# motions amplify a rounding (a nudge of 2e-16 in its own forces does the same)
TOLERANCE = {"driven": 3e-11, "static": 3e-9}
IN_PYBULLET = 2e-8
FEW = np.array([0.1, 0.02, 0.06])  # s
REQUESTS = {
    **{f"{name}, along courses": request_of(m, time=FEW, courses=waved(m)) for name, m in CASES.items()},
    **{
        f"five-bar, {model}": request_of(
            CASES["five-bar"].with_clearances({"A": 2e-4, "P": 1e-4}), model, time=FEW, courses=waved(CASES["five-bar"])
        )
        for model in JOINT_MODELS
    },
    "a gap in a driven joint between moving bodies": request_of(
        CASES["2r-arm"].with_clearances({"K": 1e-4}), "contact", time=FEW, courses=waved(CASES["2r-arm"])
    ),
    "slides driven, with gaps": request_of(
        CASES["3-rpr"].with_clearances({"C2": 1e-4}), "contact", time=FEW, courses=waved(CASES["3-rpr"])
    ),
    "one drive free": request_of(
        CASES["five-bar"].replace(drives=(Drive(joint="D", speed=2.0), Drive(joint="E", speed="free"))),
        time=FEW,
        courses={"D": waved(CASES["five-bar"])["D"]},
    ),
    "all drives free": request_of(CASES["2r-arm with springs"].replace(drives=()), time=FEW, courses={}),
    "all drives held": request_of(
        CASES["3-rpr with springs"], "ideal", "static", time=FEW, courses=waved(CASES["3-rpr"])
    ),
    "all drives held, with gaps": request_of(
        CASES["five-bar"].with_clearances({"A": 2e-4}), "contact", "static", time=FEW, courses=waved(CASES["five-bar"])
    ),
    "a thousandth of the size": Units(1e3, 1e6, 30.0).request(
        request_of(
            CASES["five-bar"].with_clearances({"A": 2e-4}), "spring-damper", time=FEW, courses=waved(CASES["five-bar"])
        )
    ),
    "a fast crank": request_of(load("slider-crank"), crank_angle=np.radians([30.0, 40.0])),
    "a crank along a course": request_of(
        load("crank-rocker").with_clearances({}),
        time=FEW,
        course=(np.linspace(0, 0.2, 6), np.linspace(0.4, 1.0, 6) ** 2),
    ),
}


def exportable() -> list[object]:
    """Every request with each engine whose exports have it."""
    rows = []
    for name in ENGINES:
        for title, request in REQUESTS.items():
            try:
                check_exported(declared(name), request)
            except Unsupported:
                continue
            quick = title == "slides driven, with gaps" and name == "mujoco"
            marks = [getattr(pytest.mark, name), *([] if quick else [pytest.mark.slow])]
            rows.append(pytest.param(name, title, marks=marks))
    return rows


@pytest.mark.parametrize(("name", "title"), exportable())
def test_bare_engine_gives_the_same_numbers(name: str, title: str, tmp_path: Path) -> None:
    request = REQUESTS[title]
    tolerance = IN_PYBULLET if name == "pybullet" else TOLERANCE[request.motion]
    engine(name).export(request, tmp_path)
    bare(tmp_path)
    found, expected = (table(tmp_path / file) for file in ("signals.csv", "expected.csv"))
    truth = columns(engine(name).simulate(request), crank=request.schedule.crank is not None)
    assert list(expected) == list(truth)
    assert difference(expected, truth) <= tolerance
    assert found.keys() == truth.keys()
    assert difference(found, truth) < tolerance


@pytest.mark.mujoco
@pytest.mark.filterwarnings("default:course.csv")
def test_command_exports_along_a_course(tmp_path: Path) -> None:
    course = tmp_path / "course.csv"
    rows = "".join(f"{t},{2.1 + t},{1.0 - t},9\n" for t in np.linspace(0.0, 0.2, 9))
    course.write_text(f"time [s],position_D [rad],position_E [rad],foo\n{rows}")
    asked = ["--case", "five-bar", "--simulator", "mujoco", "--course", str(course), "--times", "0:0.2:0.1"]
    status, said, why = command(*asked, "--out", str(tmp_path / "out"), "--json")
    assert status == 0, why
    ignored = "course.csv: 'foo' is no signal of the linkage, and ignored"
    assert ignored in why
    assert ignored in json.loads(said)["warnings"]
    assert ignored in (tmp_path / "out" / "run.py").read_text(encoding="utf-8")
    assert "ideal joints, driven: 3 samples" in bare(tmp_path / "out")
    found = table(tmp_path / "out" / "signals.csv")
    assert "crank_angle" not in found
    np.testing.assert_allclose(found["position_D"] - found["position_D"][0], [0.0, 0.1, 0.2], atol=1e-9)


@pytest.mark.mujoco
def test_command_refuses_angles_where_there_is_no_crank(tmp_path: Path) -> None:
    status, said, why = command(
        "--case", "five-bar", "--simulator", "mujoco", "--angles", "0:10:5", "--out", str(tmp_path / "out")
    )
    assert (status, said) == (2, "")
    assert "--angles 0:10:5" in why
    assert "times" in why
    assert not (tmp_path / "out").exists()
