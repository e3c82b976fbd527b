"""Signals of results, looked at one by one in a notebook: their peaks, their pictures, the name that was meant."""

from __future__ import annotations

import numpy as np
import pytest

import linkage_crosscheck as lc
from compare.faults import ArgumentError

ANGLES = np.radians(np.arange(0.0, 360.0, 10.0))


def test_the_peaks_of_an_analysis_are_those_of_closely_spaced_angles() -> None:
    coarse, fine = (lc.analyse("crank-rocker", angles=np.radians(np.arange(0.0, 360.0, step))) for step in (10.0, 0.1))
    peaks = coarse.peaks.set_index("signal")
    assert list(coarse.peaks.columns) == ["signal", "unit", "largest", "crank_angle"]
    for name in ("drive_torque", "reaction_A_magnitude"):
        k = int(np.nanargmax(np.abs(fine[name])))
        assert peaks.largest[name] == pytest.approx(fine[name][k], rel=1e-4)
        assert abs(np.sin(peaks.crank_angle[name] - fine.crank_angle[k])) < np.radians(0.2)
    assert peaks.unit["drive_torque"] == "N.m"


def test_a_signal_is_drawn_by_its_name_with_its_peak() -> None:
    result = lc.analyse("crank-rocker", angles=ANGLES)
    figure = result.plot("drive_torque", "coupler_angle")
    for axis, (name, factor) in zip(
        figure.axes, (("drive_torque", 1.0), ("coupler_angle", np.degrees(1.0))), strict=True
    ):
        np.testing.assert_allclose(axis.lines[0].get_xdata(), np.degrees(ANGLES))
        np.testing.assert_allclose(axis.lines[0].get_ydata(), factor * result[name])
        assert axis.lines[1].get_ydata()[0] == max(axis.lines[0].get_ydata(), key=abs)  # type: ignore[index]
        assert name in axis.get_ylabel()
    assert len(result.plot().axes) == 2


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
    assert labels == ["analytic, ideal", "mujoco, ideal"]
    run = lc.simulate("crank-rocker", "mujoco", angles=ANGLES)
    assert run.peaks.set_index("signal").largest["drive_torque"] == peaks.largest["simulated", "drive_torque"]
    assert len(run.plot("drive_torque").axes) == 1


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
    with pytest.raises(ArgumentError, match="did you mean 'drive_torque', which is always there"):
        lc.analyse("crank-rocker", signals="torque")
    with pytest.raises(ArgumentError, match=r"did you mean 'drive_power'$"):
        lc.analyse("crank-rocker", signals="drive_powr")
