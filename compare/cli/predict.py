"""``compare predict``: the explained model of a diagnosis where nothing was measured, with a 95 % band."""

from __future__ import annotations

from pathlib import Path
from typing import cast

from compare.cli.folders import named_after
from compare.cli.typed import CommandLine, Plotted, Shown, Where, command
from compare.questions.predict import PredictQuestion


@command(PredictQuestion, Where, Plotted, Shown)
def predict(line: CommandLine) -> None:
    """Foretell a run that was not measured, from a diagnosis: each sensor with a 95 % band, and what it is made of.

    Exit status: 0 computed, 2 bad input, 3 the simulator is missing or failed.
    """
    with line.complaints() as caught:
        from compare.diagnose.prediction import predict

        folder = line.folder(f"{named_after(cast(Path, line.words['diagnosis']))}-prediction", "prediction.json")
        line.drawn(lambda: line.ask(predict, PredictQuestion), caught, folder)
