"""The check of recorded results: what any program has computed of a linkage, held against the analytic model."""

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY
from typing import TYPE_CHECKING, Annotated

from compare.questions.option import ArgumentKind, Choice, Files, Option, Source, Switch
from compare.questions.question import Question
from compare.questions.shared import (
    JOINT_MODELS,
    MOTIONS,
    AnyPath,
    CaseOption,
    Clearance,
    HeadingsOption,
    Large,
    ModelOption,
    ProgressOption,
    RunWorkers,
    SplitOption,
    ToleranceOption,
)

if TYPE_CHECKING:
    from analytic.mechanism.columns import Layout
    from compare.arguments import Simulators
    from compare.diagnose.data.recording import Measured
    from compare.recorded.frames import Frame
    from sim_models.engine import JointModel, Motion

    Results = AnyPath | Frame | Measured | Sequence[AnyPath] | Mapping[str, AnyPath | Frame]
    """A file of results or a frame, several files, or several of both by the name of the program that wrote each; or
    the runs of measured data, with their mechanism, loads and noise.
    """


class CheckQuestion(Question):
    """Which results are held against what."""

    results: Annotated[
        "Results",
        Option(
            "Files of results (CSV, Parquet, MAT, TDMS, MDF4, HDF5, MCAP, xlsx ...), one for each program.",
            Files(),
            positional=True,
        ),
    ]
    mechanism: CaseOption = "paper"
    _: KW_ONLY
    map: Annotated["AnyPath | Layout | None", Option("TOML file that says what the columns are.", Source("FILE"))] = (
        None
    )
    columns: HeadingsOption = None
    split: SplitOption = False
    simulator: Annotated[
        "Simulators | None",
        Option(
            "Engines that simulate the same motion beside, or all.", ArgumentKind("NAME,..."), formerly="simulators"
        ),
    ] = None
    joint_model: Annotated[
        "JointModel | None",
        Option(
            "What the joints with clearance were [contact; ideal where none has clearance].",
            Choice(choices=JOINT_MODELS),
            name="joint",
        ),
    ] = None
    motion: Annotated[
        "Motion", Option("A motion over time, or an equilibrium in each row.", Choice(choices=MOTIONS))
    ] = "driven"
    clearance: Clearance = None
    large: Large = False
    analytic: ModelOption = "equilibrium"
    tolerances: ToleranceOption = None
    verify: Annotated[
        bool,
        Option(
            "State the numerical uncertainty of engines beside: run them in half and in quarter steps too (7 times as"
            " long).",
            Switch(),
        ),
    ] = False
    workers: RunWorkers = None
    progress: ProgressOption = None
