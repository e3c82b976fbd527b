"""Pins in their bearings as frames and as orbits, and the plots of a cross-check by several engines."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest

import linkage_crosscheck as lc
from compare.results.crosscheck import CrossCheck, Run
from sample_result import as_document, sample_result

CLEARANCE = {"B": 1e-4, "E": 2e-4}


@cache
def checked() -> CrossCheck:
    """A turn of the crank-rocker whose pins strike in two joints."""
    asked = {"joint_model": "contact", "clearance": CLEARANCE, "revolutions": 1, "workers": 1}
    return lc.crosscheck("crank-rocker", simulator="mujoco", **asked)


def struck() -> Run:
    """Its run."""
    return checked().run()


@pytest.mark.mujoco
def test_a_frame_of_contact_is_the_run_s_statistics() -> None:
    """Share of the time off the wall, largest force and how deep, each by another road."""
    run = struck()
    frame = run.contact_frame()
    assert list(frame.joint.unique()) == list(CLEARANCE)
    assert {*frame.columns} - {*frame.attrs["units"]} == {"joint", "in_contact"}
    for joint, clearance in CLEARANCE.items():
        assert run.contact is not None
        figures = run.contact.joints[joint].statistics
        own = frame[frame.joint == joint]
        np.testing.assert_allclose(np.diff(own.crank_angle), math.tau / 0.2 * np.diff(own.time), rtol=1e-3, atol=1e-9)
        on = own.in_contact.to_numpy(float)
        lasts = np.diff(own.time)
        free = 1.0 - float(np.sum(lasts * (on[1:] + on[:-1])) / (2 * lasts.sum()))
        assert free == pytest.approx(figures["free_share"].by_revolution[-1], abs=2e-3)  # between the kept instants
        assert own.contact_force.max() == pytest.approx(figures["peak_force"].by_revolution[-1])
        reach = np.hypot(own.journal_x, own.journal_y)
        assert float(reach.max()) - clearance <= figures["penetration"].by_revolution[-1] + 1e-12
        assert own.in_contact[own.contact_force > 1e-3].all()
        assert not own.in_contact[reach < 0.8 * clearance].any()  # in flight, further from the wall than any margin
        assert own.in_contact.any()
        assert not own.in_contact.all()
        np.testing.assert_allclose(reach * np.cos(own.journal_angle), own.journal_x, atol=1e-15)
    table = checked().statistics_frame().set_index(["joint", "statistic"])
    assert table.loc[("B", "peak_force"), "value"] == run.contact.joints["B"].statistics["peak_force"].value
    assert table.loc[("B", "peak_force"), "unit"] == "N"


@pytest.mark.mujoco
def test_a_pin_at_rest_lies_along_its_reaction() -> None:
    """As the paper has it; the wall gives by the force over its stiffness."""
    run = lc.simulate("paper", joint_model="contact", motion="static", clearance={"B": 0.01})
    frame = run.contact_frame("B")
    apart = np.angle(np.exp(1j * (frame.journal_angle - run["reaction_B_angle"])))
    np.testing.assert_allclose(apart, 0.0, atol=1e-9)
    np.testing.assert_allclose(frame.contact_force, run["reaction_B_magnitude"], rtol=1e-12)
    np.testing.assert_array_equal(frame.crank_angle, run.crank_angle)
    assert frame.in_contact.all()
    np.testing.assert_allclose(np.hypot(frame.journal_x, frame.journal_y), 0.01, rtol=1e-4)


@pytest.mark.mujoco
def test_an_orbit_is_drawn_within_its_clearance_circle() -> None:
    figure = struck().plot_orbit()
    orbits = [axis for axis in figure.axes if axis.get_title()]
    assert [axis.get_title() for axis in orbits] == ["B, last revolution", "E, last revolution"]
    for axis, clearance in zip(orbits, CLEARANCE.values(), strict=True):
        assert axis.get_aspect() == 1.0
        circle, path = (np.hypot(*line.get_data()) for line in axis.lines)
        np.testing.assert_allclose(circle, 1e3 * clearance)
        assert path.max() == pytest.approx(1e3 * clearance, rel=0.2)  # of what its wall gives
        (points,) = axis.collections
        assert points.get_array().max() > 0
    (one,) = [axis for axis in struck().plot_orbit("E").axes if axis.get_title()]
    assert one.get_title() == "E, last revolution"


def test_what_has_no_clearance_has_no_orbit() -> None:
    result = as_document(sample_result())
    with pytest.raises(KeyError, match="joint 'D' has no clearance in this run; those that have are B"):
        result.run(joint_model="contact").contact_frame("D")
    with pytest.raises(KeyError, match="no joint of this run has clearance"):
        result.run(joint_model="ideal").plot_orbit()
    assert result.run(joint_model="ideal").contact_rows() == []
    with pytest.raises(KeyError, match=r"3 runs with clearance: run\('mujoco', 'massless-link'\)\.plot_orbit\(\), run"):
        result.plot_orbit()  # one of a cross-check is that of its run with clearance
    contact = result.run(joint_model="contact")
    alone = result.model_copy(update={"runs": (result.run(joint_model="ideal"), contact)})
    assert alone.contact_frame("B").equals(contact.contact_frame("B"))


def turned(result: CrossCheck, turns: int) -> CrossCheck:
    """A result whose simulated directions are so many turns on."""
    runs = []
    for run in result.runs:
        simulated = {k: v + math.tau * turns * k.endswith("_angle") for k, v in run.simulated.items()}
        runs.append(run.model_copy(update={"simulated": simulated}))
    return result.model_copy(update={"runs": tuple(runs)})


def test_engines_are_side_by_side_and_angles_beside_the_analytic_ones() -> None:
    """Directions that are turns on are drawn where they are the same."""
    engines = ("mujoco", "exudyn", "dart")
    result = as_document(sample_result("crank-rocker", {"B": 1e-4}, engines))
    plain, far = result.plot(), turned(result, 3).plot()
    assert [axis.get_title() for axis in plain.axes[:3]] == list(engines)
    assert len(plain.axes) == 2 * len(engines)
    for one, other in zip(plain.axes, far.axes, strict=True):
        dots = [line for line in one.lines if line.get_marker() == "."]
        assert len(dots) == 4  # its own joint models
        for line, again in zip(one.lines, other.lines, strict=True):
            np.testing.assert_allclose(line.get_ydata(), again.get_ydata(), atol=1e-3)
