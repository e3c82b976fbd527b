"""An MJCF file, compiled by MuJoCo, and what it says when it cannot."""

from __future__ import annotations

import warnings
from pathlib import Path

import mujoco
import numpy as np

from analytic.mechanism.parts import LARGEST_NUMBER
from sim_models.mjcf.errors import MjcfError
from sim_models.mjcf.plane import actuator_words, joint_words
from sim_models.mjcf.scan import MEMORY, scan
from sim_models.mjcf.urdf import is_urdf, spec_of

COMPILED_FIELDS = (
    "body_pos", "body_ipos", "body_mass", "body_inertia", "jnt_pos", "jnt_axis", "jnt_stiffness", "dof_damping",
    "dof_armature", "dof_frictionloss", "qpos0", "qpos_spring", "eq_data", "site_pos", "key_qpos", "key_qvel",
    "key_ctrl", "actuator_gear", "actuator_damping", "actuator_armature", "actuator_biasprm", "actuator_gainprm",
)  # fmt: skip
AT_JOINT = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
AT_TENDON = int(mujoco.mjtTrn.mjTRN_TENDON)
SHORTEST_TIME_STEP = 1e-9  # s, of a time step
QUOTED_FROM_MUJOCO = 400  # characters of what MuJoCo says


def compiled(path: Path, notes: list[str]) -> mujoco.MjModel:
    """MuJoCo's model of a file; what it warns of is added to the ``notes``.  Raises MjcfError with what MuJoCo says, in
    one sentence.
    """
    try:
        with warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always")
            spec = spec_of(path, notes) if is_urdf(path) else mujoco.MjSpec.from_file(str(scan(path)))
            model = spec.compile()
        notes += dict.fromkeys(f"MuJoCo warns: {' '.join(str(each.message).split())}" for each in warned)
    except MjcfError:
        raise
    except (ValueError, TypeError, RuntimeError, mujoco.FatalError, MemoryError) as error:
        said = " ".join(str(error).split())[:QUOTED_FROM_MUJOCO].rstrip(".")
        raise MjcfError(f"{path}: MuJoCo cannot compile it ({said}); correct it so that MuJoCo loads it") from None
    if model.narena > MEMORY:
        raise MjcfError(f"{path}: asks for {model.narena / 2**30:.3g} GB of memory; give size.memory = 1G or less")
    if not SHORTEST_TIME_STEP <= model.opt.timestep <= LARGEST_NUMBER:
        raise MjcfError(f"{path}: option.timestep = {model.opt.timestep:g} s cannot be stepped by; give such as 0.001")
    for field in COMPILED_FIELDS:
        values = np.abs(getattr(model, field)).ravel()
        if not np.all(values <= LARGEST_NUMBER):
            worst = values[int(np.argmin(values <= LARGEST_NUMBER))]
            raise MjcfError(f"{path}: {field} holds {worst:g} once it is compiled; give finite numbers, in SI units")
    notes += reflect(model)
    return model


def reflect(model: mujoco.MjModel) -> list[str]:
    """Move armatures and dampers of actuators into the joints and tendons on which they act, whatever their controls
    are, so that these say all that they have; a sentence on each.
    """
    notes = []
    for i in range(model.nactuator):
        target, gear = int(model.actuator_trnid[i, 0]), abs(float(model.actuator_gear[model.actuator_outadr[i], 0]))
        if model.actuator_trntype[i] in AT_JOINT:
            which, of, on = "dof", int(model.jnt_dofadr[target]), joint_words(model, target)
        elif model.actuator_trntype[i] == AT_TENDON:
            which, of, on = "tendon", target, f"tendon {model.tendon(target).name!r}"
        else:
            continue
        for name in ("armature", "damping"):
            moved = gear**2 * float(getattr(model, f"actuator_{name}")[i])
            getattr(model, f"{which}_{name}")[of] += moved
            getattr(model, f"actuator_{name}")[i] = 0.0
            if moved:
                notes.append(f"the {name} of {actuator_words(model, i)} is part of that of {on}, {moved:g} of it")
        powers = gear ** (3.0 + np.arange(model.actuator_dampingpoly.shape[1]))
        getattr(model, f"{which}_dampingpoly")[of] += powers * model.actuator_dampingpoly[i]
        model.actuator_dampingpoly[i] = 0.0
    return notes
