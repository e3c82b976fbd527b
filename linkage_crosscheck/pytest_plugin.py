"""A pytest plugin: the fixture ``linkage_check`` cross-checks a linkage in a test.

    def test_the_gripper_is_as_its_model_says(linkage_check):
        linkage_check("gripper.toml", simulator="mujoco", clearance={"B": 1e-4}, motion="static")

It is loaded with every run of pytest where the package is installed, so that it imports nothing of what computes before
the first check.
"""

from __future__ import annotations

import hashlib
import os
import re
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypedDict, Unpack

import pytest

if TYPE_CHECKING:
    from analytic.mechanism import Mechanism
    from analytic.paper.clearance import Model
    from compare.arguments import Linkage, Metres, Numbers, Simulators, ToleranceFile
    from compare.results.crosscheck import CrossCheck
    from sim_models.engine import JointModel, Motion

UPDATE = "--linkage-update-baselines"
REPORT = "--linkage-report"
LONGEST_FOLDER = 150  # characters of a folder's name; file systems take 255 bytes
STORED = "linkage_baseline"  # a test's property for each baseline file that it has written


class CheckOptions(TypedDict, total=False):
    """What :func:`compare.crosscheck.crosscheck` may be asked, by name; SI units and radians."""

    joint_model: JointModel | None
    motion: Motion
    clearance: Metres | None
    large: bool
    angles: Numbers | None
    analytic: Model
    flexible: bool
    tolerances: ToleranceFile | None
    map: str | Path | None
    workers: int | None


def pytest_addoption(parser: pytest.Parser) -> None:
    """The two options of the plugin."""
    group = parser.getgroup("linkage-crosscheck", "cross-checks of linkages (fixture linkage_check)")
    group.addoption(UPDATE, action="store_true", help="Write the baselines of linkage_check in place of checking them.")
    group.addoption(REPORT, metavar="DIR", help="Write the report of each linkage_check into a folder of its own here.")


@pytest.fixture
def linkage_check(request: pytest.FixtureRequest) -> LinkageCheck:
    """Cross-check a linkage, and fail with a line for each signal that disagrees: see
    :meth:`linkage_crosscheck.pytest_plugin.LinkageCheck.__call__`.
    """
    return LinkageCheck(request.node)


@pytest.hookimpl(trylast=True)
def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say which baselines were written, whichever process wrote them."""
    reports = (report for outcome in terminalreporter.stats.values() for report in outcome)
    properties = [each for report in reports for each in getattr(report, "user_properties", ())]
    written = dict.fromkeys(str(value) for name, value in properties if name == STORED)
    if written:
        terminalreporter.section("baselines of linkages")
        for line in written:
            terminalreporter.write_line(line)


@dataclass
class LinkageCheck:
    """What the fixture ``linkage_check`` is: call it with a linkage, as often as a test likes."""

    test: pytest.Item
    calls: int = 0

    def __call__(
        self,
        mechanism: Linkage,
        simulator: Simulators = "mujoco",
        *,
        baseline: str | Path | None = None,
        simulators: Simulators | None = None,
        **options: Unpack[CheckOptions],
    ) -> CrossCheck:
        """Cross-check a linkage; fail the test unless both sides agree.  Returns the result.

        ``mechanism`` is a shipped case, a mechanism, or a file, first looked for beside the test, as the files of
        ``mjcf:`` and ``fmu:`` are; ``options`` are those of ``lc.crosscheck``.  With a ``baseline``, a file (``.toml``)
        or the folder of it beside the test, the reaction forces of the linkage in each engine, at the baseline's own
        crank angles, are held to what is stored there, or stored with ``--linkage-update-baselines``.  With
        ``--linkage-report DIR`` the report is written into a folder of its own.

        The test fails, in a sentence, where the input is at fault and where an engine fails or, asked for by name, is
        not installed; ``simulator="all"`` leaves out those that are not.
        """
        __tracebackhide__ = True
        from analytic.errors import Error, warn

        self.calls += 1
        if simulators is not None:
            warn("simulators= is called simulator= now", DeprecationWarning)
            simulator = simulators
        try:
            return self._checked(self._beside(mechanism), self._models(simulator), baseline, options)
        except Error as error:
            why = str(error)
        pytest.fail(why)

    def _checked(
        self, mechanism: Linkage, simulators: Simulators, baseline: str | Path | None, options: CheckOptions
    ) -> CrossCheck:
        __tracebackhide__ = True
        import linkage_crosscheck as lc

        result = lc.crosscheck(mechanism, simulators, **options)
        folder = self._folder()
        if folder is not None:
            result.write(folder, overwrite=True)
        wrong = list(_differences(result))
        if wrong:
            again = f"for its report run: pytest {REPORT}=DIR {shlex.quote(self.test.nodeid)}"
            wrong.append(again if folder is None else f"report: {folder / result.opens}")
        if baseline is not None:
            moved = list(self._moved(result.mechanism, simulators, self.test.path.parent / baseline))
            wrong += [f"{result.case}: reaction forces have moved", *moved] if moved else []
        if wrong:
            pytest.fail("\n  ".join(wrong))
        return result

    def _moved(self, mechanism: Mechanism, simulators: Simulators, stored: Path) -> Iterator[str]:
        """A line for each reaction force that is not where the baseline has it; none where the baseline is written."""
        from compare.arguments import engines
        from compare.baseline.check import check_file, file_of, update_file
        from compare.faults import ArgumentError
        from compare.files import made_folder

        names, _ = engines(simulators)
        if stored.suffix == ".toml" and len(names) > 1:
            raise ArgumentError("baseline", f"{stored} is one file for {', '.join(names)}; give a folder of them")
        test, update = shlex.quote(self.test.nodeid), self.test.config.getoption(UPDATE)
        for name in names:
            path = stored if stored.suffix == ".toml" else file_of(stored, mechanism.name, name)
            if update:
                with made_folder(path.parent, "baseline"):
                    entry = update_file(path, mechanism, name, f"pytest {test}")
                self.test.user_properties.append((STORED, f"{path}: {entry.status}"))
                continue
            for moved in check_file(path, mechanism, name, f"pytest {UPDATE} {test}").moved:
                yield f"{path}: {moved.sentence}"

    def _beside(self, given: Linkage) -> Linkage:
        """What names a linkage, looked for beside the test first."""
        if not isinstance(given, str | os.PathLike):
            return given
        beside = self.test.path.parent / given
        return beside if beside.is_file() else given

    def _models(self, given: Simulators) -> Simulators:
        """Simulators; the files of models such as ``mjcf:gripper.xml`` looked for beside the test first."""
        from sim_models.engine import SEPARATOR, scheme_of

        names = given.split(",") if isinstance(given, str) else given
        if not isinstance(names, Sequence) or not any(isinstance(name, str) and scheme_of(name)[0] for name in names):
            return given
        models = []
        for name in names:
            scheme, place = scheme_of(name) if isinstance(name, str) else ("", "")
            parts = [str(self._beside(part)) if part else part for part in place.split(SEPARATOR)]
            models.append(f"{scheme}:{SEPARATOR.join(parts)}" if scheme else name)
        return models

    def _folder(self) -> Path | None:
        """Where the report of this call goes, if it is wanted."""
        place = self.test.config.getoption(REPORT)
        if place is None:
            return None
        name = re.sub(r"[^\w=.,@-]+", "_", self.test.nodeid).strip("_")
        if len(name) > LONGEST_FOLDER:
            name = f"{name[: LONGEST_FOLDER - 9]}-{hashlib.sha256(name.encode()).hexdigest()[:8]}"
        return self.test.config.invocation_params.dir / place / (name if self.calls == 1 else f"{name}-{self.calls}")


def _differences(result: CrossCheck) -> Iterator[str]:
    """What speaks against a result, a line each; none where both sides agree."""
    if result.verdict == "agrees":
        return
    from compare.report.summary import summarise
    from compare.report.words.crosscheck import VERDICT_WORDS, row_sentence, why

    summary = summarise(result)
    yield f"{result.case}: {VERDICT_WORDS[summary.verdict]}"
    for shown in summary.runs:
        title, rows = shown.run.title, shown.rows
        yield from (f"{title}: {row_sentence(row)}" for row in rows if row.verdict in ("disagrees", "unjudged"))
        if not rows:
            yield f"{title}: not judged: {shown.run.reason or 'it has no signal to compare'}"
    yield from (f"failed: {failure}" for failure in summary.failures)
    yield from (text for text in (why(summary), result.words) if text)
