"""How each kind of result is shown.  What shows one kind is imported when the first of that kind is shown."""

from __future__ import annotations

from pathlib import Path

from compare.presentation import LEFT_OVER, PICTURES, PRESENTATIONS, TABLES

MODULES = {
    "Accuracy": "accuracy",
    "Analysis": "analysis",
    "Baselines": "baselines",
    "CrossCheck": "crosscheck",
    "Diagnosis": "diagnosis",
    "Measured": "measured",
    "Plan": "plan",
    "PlatformAccuracy": "platform",
    "Prediction": "prediction",
    "Preview": "preview",
    "Provenance": "provenance",
    "SignalResiduals": "residuals",
    "Simulation": "sides",
    "Sweep": "sweep",
    "Validity": "validity",
}
LISTS = ("Applied", "Cases", "Effects", "Exported", "Fields", "Imported", "Runs", "Simulators")


def _left_over(folder: Path, names: set[str]) -> set[str]:
    from compare.results.kinds import left_over

    return left_over(folder, names)


LEFT_OVER.append(_left_over)
PRESENTATIONS |= {kind: f"compare.report.{module}:PRESENTATION" for kind, module in MODULES.items()}
PRESENTATIONS |= {kind: f"compare.report.lists:{kind.upper()}" for kind in LISTS}
PICTURES |= {name: f"compare.report.{name}:plot" for name in ("orbit", "polar")}
TABLES["spread"] = "compare.report.spread:rows"
