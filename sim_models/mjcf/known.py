"""Which numbers of a compiled model are known here: read, refused, named in a note, or without part in the physics of
a rigid linkage.  A newer MuJoCo may have others; a file that gives one is told so.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import mujoco
import numpy as np

KNOWN_ATTRIBUTES: Mapping[str, frozenset[str]] = {
    what: frozenset(names.split())
    for what, names in {
        "body": """bvhadr bvhnum conaffinity contype dofadr dofnum geomadr geomnum gravcomp inertia invweight0 ipos
            iquat jntadr jntnum margin mass mocapid parentid plugin pos quat rootid sameframe simple subtreemass treeid
            user weldid""",
        "jnt": """actfrclimited actfrcrange actgravcomp actuatorid axis bodyid dofadr group limited margin plasticadr
            pos qposadr range solimp solref springyield stiffness stiffnesspoly type user""",
        "dof": """M0 Madr armature bodyid damping dampingpoly frictionloss invweight0 jntid length parentid simplenum
            solimp solref treeid""",
        "eq": "active0 data obj1id obj2id objtype solimp solref type",
        "tendon": """actfrclimited actfrcrange actuatorid adr armature damping dampingpoly frictionloss group invweight0
            length0 lengthspring limited margin matid num plasticadr range rgba solimp_fri solimp_lim solref_fri
            solref_lim springyield stiffness stiffnesspoly treeid treenum type user width""",
        "wrap": "objid prm type",
        "actuator": """acc0 actadr actearly actlimited actnum actrange armature biasprm biastype cranklength ctrladr
            ctrllimited ctrlnum ctrlrange ctrlspec damping dampingpoly delay dynprm dyntype forcelimited forcerange
            gainprm gaintype gear group history historyadr length0 lengthrange outadr outnum plugin trnid trntype
            user""",
        "opt": """ccd_iterations ccd_tolerance cone density disableactuator disableflags enableflags gravity impratio
            integrator iterations jacobian ls_iterations ls_tolerance magnetic noslip_iterations noslip_tolerance
            o_friction o_margin o_solimp o_solref sdf_initpoints sdf_iterations sleep_tolerance solver timestep
            tolerance viscosity wind""",
    }.items()
}
ATTRIBUTES_BY_ELEMENT = """
<mujoco>
  <worldbody><body><joint name="j"/><geom size="1"/><site name="s"/></body><site name="o"/></worldbody>
  <equality><connect site1="s" site2="o"/></equality>
  <tendon><fixed><joint joint="j" coef="1"/></fixed></tendon>
  <actuator><motor joint="j"/></actuator>
</mujoco>"""


def numbers(m: mujoco.MjModel) -> Iterator[tuple[str, str, np.ndarray]]:
    """The kinds, names and values (n, ...) of what says how a model moves."""
    for name in dir(m):
        what, _, field = name.partition("_")
        value = getattr(m, name)
        if what in KNOWN_ATTRIBUTES and isinstance(value, np.ndarray):
            yield what, field, value
    for field in dir(m.opt):
        if not field.startswith("_"):
            yield "opt", field, np.array([getattr(m.opt, field)])


def unknown(m: mujoco.MjModel, known: Mapping[str, frozenset[str]] = KNOWN_ATTRIBUTES) -> Iterator[str]:
    """What is not ``known`` of a model and is not as MuJoCo has it where a file is silent, a sentence each."""
    plain = {
        (what, field): value for what, field, value in numbers(mujoco.MjModel.from_xml_string(ATTRIBUTES_BY_ELEMENT))
    }
    for what, field, value in numbers(m):
        silent = plain[what, field][-1]
        if field not in known[what] and (value.shape[1:] != silent.shape or np.any(value != silent)):
            yield f"{what}_{field} of MuJoCo {mujoco.__version__} is not known here, and left out"
