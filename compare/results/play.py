"""How a pin moves in its bearing and what its bearing does to it, as a table and as a picture."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Protocol

import numpy as np

from compare.presentation import picture
from compare.results.contact import LEAST_FORCE, Contact
from compare.results.document import Row, as_dataframe, pictured, rows_of
from sim_models.common.free_share import OFF_WALL

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

    from sim_models.engine import SettingValue

UNITS = {"time": "s", "crank_angle": "rad", "journal_angle": "rad", "contact_force": "N"} | dict.fromkeys(
    ("journal_x", "journal_y"), "m"
)


class _Loose(Protocol):
    """A run of joints with clearance."""

    @property
    def title(self) -> str: ...
    @property
    def clearance(self) -> Mapping[str, float]: ...
    @property
    def crank_angle(self) -> np.ndarray: ...
    @property
    def time(self) -> np.ndarray | None: ...
    @property
    def settings(self) -> Mapping[str, SettingValue]: ...
    @property
    def simulated(self) -> Mapping[str, np.ndarray]: ...
    @property
    def contact(self) -> Contact | None: ...


class WithPlay:
    """What a run with clearance can show of each joint that has some."""

    def contact_rows(self: _Loose, joint: str | None = None) -> list[Row]:
        """A row for each instant of each joint with clearance, or of one: ``joint``, ``time`` (s), ``crank_angle``
        (rad), ``journal_x`` and ``journal_y`` (m, first body's pin centre minus the second's), ``journal_angle`` (rad,
        from the bearing's centre, within half a turn of 0), ``contact_force`` (N) and ``in_contact``, whether it is at
        its wall or pushed.

        Of a driven run in which pins may leave their walls it is the last revolution, closely, else every sample.  Of a
        block x is its height across the guide and y its tilt times half its length; it has no angle.  Raises KeyError
        for what has no clearance.
        """
        return [row for name in _named(self, joint) for row in _rows(self, name)]

    def contact_frame(self: _Loose, joint: str | None = None) -> pandas.DataFrame:
        """The same as a data frame.  Raises KeyError, or ImportError with the remedy where pandas is not installed."""
        rows = [row for name in _named(self, joint) for row in _rows(self, name)]
        return as_dataframe(rows, "contact_frame", UNITS)

    def plot_orbit(self: _Loose, joint: str | None = None) -> Figure:
        """A matplotlib figure of each pin's path in its clearance circle, its points in the colour of the force there.

        Raises KeyError for what has no clearance, ImportError with the remedy where matplotlib is not installed.
        """
        names = _named(self, joint)
        if not names:
            raise KeyError(f"{self.title}: no joint of this run has clearance")
        rows = {name: _rows(self, name) for name in names}
        return pictured(lambda figure: picture("orbit")(self, rows, figure), "plot_orbit")


def _named(run: _Loose, joint: str | None) -> list[str]:
    if joint is not None and joint not in run.clearance:
        those = ", ".join(run.clearance) or "none"
        raise KeyError(f"{run.title}: joint {joint!r} has no clearance in this run; those that have are {those}")
    return list(run.clearance) if joint is None else [joint]


def _rows(run: _Loose, joint: str) -> list[Row]:
    contact = None if run.contact is None else run.contact.joints.get(joint)
    block = f"clearance_{joint}_angle" in run.simulated
    if contact is not None:
        x, y, force = contact.orbit.x, contact.orbit.y, contact.orbit.force
        places = {"time": contact.orbit.time, "crank_angle": contact.orbit.crank_angle}
    else:
        nothing = np.full(run.crank_angle.shape, np.nan)
        x, y, *across = (
            run.simulated.get(f"{name}_{joint}_{axis}", nothing) for name in ("clearance", "reaction") for axis in "xy"
        )
        force = np.hypot(*across)
        places = {"time": run.time, "crank_angle": run.crank_angle}
    angle = np.full(x.shape, np.nan) if block else np.arctan2(y, x)
    columns = {name: values for name, values in places.items() if values is not None}
    columns |= {"journal_x": x, "journal_y": y, "journal_angle": angle, "contact_force": force}
    reach = np.abs(x) + np.abs(y) if block else np.hypot(x, y)
    margins = run.settings.get("contact_margin")  # before its wall, where an engine begins to push
    wall = run.clearance[joint] - (margins.get(joint, 0.0) if isinstance(margins, Mapping) else 0.0)
    on = (reach >= wall * (1 - OFF_WALL)) | (force > LEAST_FORCE * np.nanmax(force, initial=0.0))
    return [{**row, "in_contact": bool(at)} for row, at in zip(rows_of(columns, joint=joint), on, strict=True)]
