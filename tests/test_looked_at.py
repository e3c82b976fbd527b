"""Signals of results, looked at one by one in a notebook: their peaks, their pictures, the name that was meant."""

from __future__ import annotations

import numpy as np
import pandas
import pytest

import linkage_crosscheck as lc
from compare.faults import ArgumentError
from compare.results.crosscheck import Simulator

ANGLES = np.radians(np.arange(0.0, 360.0, 10.0))


def test_the_peaks_of_an_analysis_are_those_of_closely_spaced_angles() -> None:
    coarse, fine = (lc.analyse("crank-rocker", angles=np.radians(np.arange(0.0, 360.0, step))) for step in (10.0, 0.1))
    peaks = coarse.peaks.set_index("signal")
    assert list(coarse.peaks.columns) == ["signal", "unit", "largest", "crank_angle", "rms"]
    for name in ("drive_torque", "reaction_A_magnitude"):
        k = int(np.nanargmax(np.abs(fine[name])))
        assert peaks.largest[name] == pytest.approx(fine[name][k], rel=1e-4)
        assert abs(np.sin(peaks.crank_angle[name] - fine.crank_angle[k])) < np.radians(0.2)
    assert peaks.unit["drive_torque"] == "N.m"


def test_a_signal_is_drawn_by_its_name_with_its_peak() -> None:
    result = lc.analyse("crank-rocker", angles=ANGLES)
    found = result.peaks.set_index("signal")
    peaks, places = found.largest, np.degrees(found.crank_angle)
    figure = result.plot("drive_torque", "coupler_angle")
    for axis, (name, said, factor) in zip(
        figure.axes,
        (("drive_torque", "drive torque (N·m)", 1.0), ("coupler_angle", "angle (deg)", np.degrees(1.0))),
        strict=True,
    ):
        np.testing.assert_allclose(axis.lines[0].get_xdata(), np.degrees(ANGLES))
        np.testing.assert_allclose(axis.lines[0].get_ydata(), factor * result[name])
        assert axis.lines[1].get_ydata()[0] == pytest.approx(factor * peaks[name])  # type: ignore[index]
        assert axis.get_ylabel() == said
        assert axis.get_legend_handles_labels()[1][0].endswith(
            f", peak {factor * peaks[name]:.4g} at {places[name]:.4g}"
        )
    forces = [f"reaction_{joint}_magnitude" for joint in "DABE"]
    for axis in (result.plot(*forces, "drive_torque").axes[0], result.plot().axes[0]):  # one unit, one pair of axes
        labels = axis.get_legend_handles_labels()[1]
        assert labels == [f"at {name[9]}, peak {peaks[name]:.4g} at {places[name]:.4g}" for name in forces]
        assert axis.get_ylabel() == "reaction force (N)"


def test_peaks_are_of_what_has_one() -> None:
    """No zeros, no rounding, no direction of a reaction, no angle that goes round."""
    peaks = lc.analyse("slider-crank", angles=ANGLES).peaks
    assert not set(peaks.signal) & {"crank_angle", "position_O", "reaction_A_angle", "rod_rotation", "reaction_S_x"}
    assert {"rod_angle", "position_S", "drive_torque", "reaction_S_y"} <= set(peaks.signal)
    assert peaks.largest.abs().min() > 1e-6


@pytest.mark.mujoco
def test_both_sides_of_a_cross_check_have_their_peaks_and_are_drawn_together() -> None:
    result = lc.crosscheck("crank-rocker", simulator="mujoco", joint_model="ideal", angles=ANGLES)
    peaks = result.peaks.set_index(["side", "signal"])
    for side, signals in (("analytic", result.run().analytic), ("simulated", result.run().simulated)):
        row = peaks.loc[side, "drive_torque"]
        assert row.largest == max(signals["drive_torque"], key=abs)
        assert row.crank_angle == ANGLES[int(np.argmax(np.abs(signals["drive_torque"])))]
    (axis,) = result.plot("drive_torque").axes
    labels = axis.get_legend_handles_labels()[1]
    assert (axis.get_title(), labels) == ("mujoco", ["analytic", "ideal"])
    (empty,) = result.model_copy(update={"runs": ()}).plot().axes  # every run has failed
    assert not empty.lines
    run = lc.simulate("crank-rocker", "mujoco", angles=ANGLES)
    assert run.peaks.set_index("signal").largest["drive_torque"] == peaks.largest["simulated", "drive_torque"]
    assert len(run.plot("drive_torque").axes) == 1


@pytest.mark.mujoco
def test_an_angle_of_both_sides_is_drawn_and_listed_in_one_turn() -> None:
    """At a loose pin they were told a whole turn apart."""
    result = lc.crosscheck(
        "slider-crank", "mujoco", joint_model="contact", clearance={"A": 1e-5}, revolutions=1, angles=ANGLES
    )
    run = result.run()
    gamma = run.simulated["reaction_A_angle"]
    turned = run.model_copy(update={"simulated": run.simulated | {"reaction_A_angle": gamma - 2 * np.pi}})
    result = result.model_copy(update={"runs": (turned,)})
    frame = result.to_dataframe()
    assert (frame.analytic_reaction_A_angle - frame.simulated_reaction_A_angle).abs().max() < np.pi
    (axis,) = result.plot("reaction_A_angle").axes
    analytic, simulated = (np.asarray(line.get_ydata()) for line in axis.lines)
    assert np.nanmax(np.abs(analytic - simulated)) < 180.0


def test_the_figure_of_results_that_were_read_is_of_signals_that_they_have() -> None:
    own = lc.analyse("crank-rocker", angles=ANGLES).to_dataframe()
    time = own.crank_angle / lc.load("crank-rocker").speed
    given = {"time [s]": time, "crank_angle [rad]": own.crank_angle}
    for names, drawn in (
        (("reaction_B_x", "reaction_B_y"), ["reaction angle at B (deg)", "reaction force at B (N)"]),
        (("drive_torque",), ["drive torque (N·m)"]),
    ):
        units = {"drive_torque": "N.m"}
        columns = given | {f"{name} [{units.get(name, 'N')}]": own[name] for name in names}
        figure = lc.check(pandas.DataFrame(columns), "crank-rocker").plot()
        assert [axis.get_ylabel() for axis in figure.axes] == drawn
        for axis in figure.axes:
            assert {line.get_label() for line in axis.lines} == {"analytic", "ideal"}


def test_what_swings_has_its_peaks_over_time() -> None:
    result = lc.analyse("pendulum", times=np.linspace(0.0, 1.0, 21))
    peak = result.peaks.set_index("signal").loc["reaction_O_magnitude"]
    assert 0.0 < peak.time < 1.0
    assert peak.crank_angle == pytest.approx(-np.pi / 2, abs=0.01)  # it is heaviest where it hangs
    assert result.plot("reaction_O_magnitude").axes[0].get_xlabel() == ("time (s)")


def test_a_name_that_is_near_is_said() -> None:
    result = lc.analyse("crank-rocker", angles=ANGLES)
    for ask in (lambda: result["torque"], lambda: result.plot("torque")):
        with pytest.raises(KeyError, match=r"torque: no such signal; did you mean drive_torque\?"):
            ask()
    with pytest.raises(KeyError, match=r"reaction_B_mag: no such signal; did you mean reaction_B_magnitude\?"):
        result["reaction_B_mag"]
    with pytest.raises(KeyError, match=r"did you mean .*reaction_B_magnitude\?"):
        result.plot("reaction_B")
    with pytest.raises(ArgumentError, match="did you mean 'drive_torque', which is always there"):
        lc.analyse("crank-rocker", signals="torque")
    with pytest.raises(ArgumentError, match=r"did you mean 'drive_power'$"):
        lc.analyse("crank-rocker", signals="drive_powr")


def test_the_peaks_of_an_accuracy_are_its_largest_errors_and_where_they_are() -> None:
    result = lc.accuracy("crank-rocker", clearance={"B": 1e-4, "E": 1e-4}, angles=ANGLES, samples=10)
    peaks = result.peaks.set_index("output")
    assert "crank_angle" not in peaks.index  # nothing displaces it
    error = result.outputs["follower_angle"].equilibrium
    k = int(np.nanargmax(np.abs(error)))
    row = peaks.loc["follower_angle"]
    assert (row["largest"], row["crank_angle"], row["unit"]) == (error[k], result.crank_angle[k], "rad")
    assert row["worst_case"] == result.outputs["follower_angle"].worst_case.max()
    several = lc.platform_accuracy("five-bar", clearance=5e-5, times=np.linspace(0.0, 0.3, 4))
    assert [*several.peaks.columns[3:6]] == ["time", "position_D", "position_E"]
    assert set(several.peaks["output"]) == set(several.outputs) - {"left-crank_angle", "right-crank_angle"}


def test_a_reaction_is_drawn_as_a_vector_by_its_size_over_its_direction() -> None:
    result = lc.analyse("crank-rocker", angles=ANGLES)
    (axis,) = result.plot_polar("B").axes
    ground, own = axis.lines[:2]
    assert [line.get_label() for line in (ground, own)] == ["in the ground's frame", "in the frame of follower"]
    force = result["reaction_B_x"] + 1j * result["reaction_B_y"]
    for line, turn in ((ground, 0.0), (own, result["follower_angle"])):
        drawn = np.asarray(line.get_ydata()) * np.exp(1j * np.asarray(line.get_xdata()))
        np.testing.assert_allclose(drawn[: force.size], force * np.exp(-1j * turn), rtol=1e-6, atol=1e-6)
    assert len(result.plot_polar().axes) == len(result.mechanism.joints)
    with pytest.raises(KeyError, match="X: no such joint; they are D, A, B, E"):
        result.plot_polar("X")


def test_a_cross_check_draws_engines_over_the_analytic_vector() -> None:
    """By the signals of size and direction, which the figure does not use; the analytic curve closes the turn."""
    result = lc.crosscheck("crank-rocker", simulator=["mujoco", "exudyn"], angles="0:345:15", workers=1)
    (axis,) = (figure := result.plot_polar("B")).axes
    engines = ["mujoco, ideal", "exudyn, ideal"]
    assert [line.get_label() for line in axis.lines] == ["analytic", *engines]
    sides = [result.runs[0].analytic, *(run.simulated for run in result.runs)]
    for line, signals in zip(axis.lines, sides, strict=True):
        drawn = np.asarray(line.get_ydata()) * np.exp(1j * np.asarray(line.get_xdata()))
        force = signals["reaction_B_magnitude"] * np.exp(1j * signals["reaction_B_angle"])
        np.testing.assert_allclose(drawn[: force.size], force, rtol=1e-6)
    assert [line.get_xdata().size for line in axis.lines] == [25, 24, 24]
    figure.draw_without_rendering()
    assert not axis.get_legend().get_window_extent().overlaps(axis.get_window_extent())
    assert len(result.plot_polar().axes) == len(result.mechanism.joints)
    with pytest.raises(KeyError, match="X: no such joint; they are D, A, B, E"):
        result.plot_polar("X")


def test_no_more_than_six_vectors_are_drawn_and_it_is_said_of_how_many_runs() -> None:
    result = lc.crosscheck("paper", motion="static", angles="30:60:10")
    (axis,) = result.plot_polar("B").axes
    labels = [line.get_label() for line in axis.lines]
    assert labels[:2] == ["analytic, ideal linkage (first-order direction)", "analytic, equilibrium"]
    assert labels[2:] == [run.title for run in result.runs]
    assert len(labels) == 6
    names = [Simulator(name=f"tool {k}", version="1") for k in range(7)]
    many = result.model_copy(
        update={"runs": tuple(run.model_copy(update={"simulator": name}) for name in names for run in result.runs)}
    )
    figure = many.plot_polar("B")
    labels = [line.get_label() for line in figure.axes[0].lines]
    assert labels == ["analytic, equilibrium", *(f"tool {k}, contact" for k in range(5))]
    assert figure.get_supxlabel() == "5 of 28 runs"
