"""Every run of a measurement by several engines, in processes where there are several workers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from compare.diagnose.data.recording import MeasuredRun
from compare.diagnose.effects.effect import landing_in
from compare.diagnose.predict import Hypothesis, Model, Term
from compare.diagnose.simulate import Simulated, Task, lacking, simulate
from compare.sweep import spread
from sim_models.engine import SettingValue, engine

Outcome = tuple[dict[str, np.ndarray], str, Mapping[str, SettingValue]] | str


@dataclass(frozen=True)
class Engines:
    """Simulates the runs of a model's measurement.

    What the ``chosen`` engine lacks is added to its readings by the model; other engines that lack something do not
    simulate.
    """

    model: Model
    chosen: str
    workers: int

    def simulate(self, hypothesis: Hypothesis, names: Sequence[str]) -> dict[str, Simulated]:
        """What each engine says under a hypothesis."""
        tasks = self.tasks(hypothesis, names)
        return self.answers(hypothesis, names, tasks, self.run(tasks))

    def begin(self, hypothesis: Hypothesis, names: Sequence[str]) -> Callable[[], dict[str, Simulated]]:
        """The same in the background, if there are processes for it; call what is returned to wait for it."""
        if self.workers == 1 or not names:
            return lambda: self.simulate(hypothesis, names)
        tasks = self.tasks(hypothesis, names)
        background = ThreadPoolExecutor(1)
        outcomes = background.submit(self.run, tasks)
        background.shutdown(wait=False)
        return lambda: self.answers(hypothesis, names, tasks, outcomes.result())

    def tasks(self, hypothesis: Hypothesis, names: Sequence[str]) -> list[Task]:
        """Every run by every engine that simulates the hypothesis."""
        able = [name for name in names if name == self.chosen or not self.lacks(name, hypothesis)]
        return [self.task(name, run, hypothesis) for name in able for run in self.model.measured.runs]

    def answers(
        self, hypothesis: Hypothesis, names: Sequence[str], tasks: Sequence[Task], outcomes: Sequence[Outcome]
    ) -> dict[str, Simulated]:
        """The outcomes of tasks, by engine."""
        done = [(task.engine, outcome) for task, outcome in zip(tasks, outcomes, strict=True)]
        return {
            name: self.answer(name, hypothesis, [outcome for engine, outcome in done if engine == name])
            for name in names
        }

    def lacks(self, name: str, hypothesis: Hypothesis) -> list[str]:
        """What an engine cannot represent of a hypothesis and of the model's links, in words."""
        effects = [t.label for t in lacking(name, [t for t, _ in hypothesis])]
        return effects + ["links that bend"] * self.lacks_beams(name)

    def lacks_beams(self, name: str) -> bool:
        """Whether the links bend and an engine has no beams."""
        return self.model.mechanism.bends and engine(name).capabilities.beams is None

    def task(self, name: str, run: MeasuredRun, hypothesis: Hypothesis) -> Task:
        """One run for one engine, without the effects that it lacks."""
        lacks = lacking(name, [t for t, _ in hypothesis])
        able = [h for h in hypothesis if h[0] not in lacks]
        start = tuple(self.model.starts(run, able)) if run.drive == "free" else ()
        return Task(name, run, self.model.mechanism, able, self.model.rig, self.model.courses.get(run.name), start)

    def run(self, tasks: Sequence[Task]) -> list[Outcome]:
        """Simulate tasks.  Processes take seconds to start: the chosen engine's few runs do not wait for them."""
        if self.workers == 1 or all(task.engine == self.chosen for task in tasks):
            return [simulate(task) for task in tasks]
        outcomes: dict[int, Outcome] = {}
        for ended in spread(_numbered, list(enumerate(tasks)), self.workers):
            outcomes[ended.item[0]] = str(ended.error) if ended.value is None else ended.value
        return [outcomes[i] for i in range(len(tasks))]

    def answer(self, name: str, hypothesis: Hypothesis, outcomes: Sequence[Outcome]) -> Simulated:
        """The outcomes of an engine's runs as one answer."""
        lacks = self.lacks(name, hypothesis)
        if lacks and name != self.chosen:
            return Simulated(name, skipped=f"cannot represent {', '.join(lacks)}")
        failed = next((o for o in outcomes if isinstance(o, str)), None)
        if failed is not None:
            return Simulated(name, skipped=failed)
        whole = [o for o in outcomes if not isinstance(o, str)]
        readings = [o[0] for o in whole]
        if lacks:
            readings = self.completed(readings, hypothesis, lacking(name, [t for t, _ in hypothesis]))
        lands = any(drive.half_gap > 0 for drive in self.model.mechanism.drives) or any(
            "backlash" in t.effect.needs for t, _ in hypothesis
        )
        said = self.model([hypothesis])[0] if lands else None
        if said is not None:
            readings = [
                r | {key: w[key] for key in map(landing_in, r) if key in w} for r, w in zip(readings, said, strict=True)
            ]
        return Simulated(name, whole[0][1], readings, settings=tuple(o[2] for o in whole), added=tuple(lacks))

    def completed(
        self, readings: list[dict[str, np.ndarray]], hypothesis: Hypothesis, lacks: Sequence[Term]
    ) -> list[dict[str, np.ndarray]]:
        """Readings of an engine that lacks some effects, with the difference that these make in the analytic model."""
        m = self.model
        rigid = Model(m.measured, m.rig, m.mechanism.rigid(), m.courses) if self.lacks_beams(self.chosen) else m
        full, less = m([hypothesis])[0], rigid([[h for h in hypothesis if h[0] not in lacks]])[0]
        if full is None or less is None:
            return readings
        return [{s: v + w[s] - p[s] for s, v in r.items()} for r, w, p in zip(readings, full, less, strict=True)]


def _numbered(item: tuple[int, Task]) -> Outcome:
    return simulate(item[1])
