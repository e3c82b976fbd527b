"""An FMU of FMI 3.0 in C, without any of FMI's headers: a crank that turns as it is told, and reads what turns it."""

from __future__ import annotations

import platform
import shutil
import subprocess
from pathlib import Path

import pytest

SYSTEM = f"{platform.machine()}-linux"
VARIABLES = """
    <Float64 name="phi" valueReference="1" causality="input" start="0" unit="deg"/>
    <Float64 name="omega" valueReference="2" causality="input" start="0"/>
    <Float64 name="angle" valueReference="3" causality="output" declaredType="Angle"/>
    <Float64 name="speed" valueReference="4" causality="output"/>
    <Float64 name="gain" valueReference="5" causality="parameter" variability="fixed" start="1"/>
    <Float64 name="many" valueReference="6" causality="output"><Dimension start="3"/></Float64>
    <Boolean name="ends" valueReference="7" causality="parameter" variability="fixed" start="false"/>
"""
DESCRIPTION = f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="crank" instantiationToken="token" generationTool="the tests">
  <CoSimulation modelIdentifier="crank" canHandleVariableCommunicationStepSize="true"/>
  <TypeDefinitions><Float64Type name="Angle" unit="deg"/></TypeDefinitions>
  <DefaultExperiment stepSize="1e-3"/>
  <ModelVariables>{VARIABLES}</ModelVariables>
  <ModelStructure/>
</fmiModelDescription>
"""
CODE = """
#include <stdbool.h>
#include <stddef.h>
#include <string.h>
typedef void (*Log)(void*, int, const char*, const char*);
static double value[8] = {0, 0, 0, 0, 0, 1};
static bool ends;
static Log tell;
static char it;
void* fmi3InstantiateCoSimulation(const char* name, const char* token, const char* path, bool visible, bool logging,
        bool events, bool early, const unsigned* needed, size_t n, void* environment, Log log, void* update) {
    tell = log;
    return strcmp(token, "token") ? NULL : &it;
}
static void solve(void) { value[3] = value[5] * value[1]; value[4] = value[2]; }
int fmi3SetFloat64(void* c, const unsigned* r, size_t n, const double* v, size_t m) {
    for (size_t i = 0; i < n; i++) value[r[i]] = v[i];
    return 0;
}
int fmi3SetBoolean(void* c, const unsigned* r, size_t n, const bool* v, size_t m) { ends = v[0]; return 0; }
int fmi3GetFloat64(void* c, const unsigned* r, size_t n, double* v, size_t m) {
    for (size_t i = 0; i < n; i++) v[i] = value[r[i]];
    return 0;
}
int fmi3EnterInitializationMode(void* c, bool t, double tolerance, double start, bool s, double stop) { return 0; }
int fmi3ExitInitializationMode(void* c) { solve(); return 0; }
int fmi3DoStep(void* c, double now, double step, bool no, bool* event, bool* end, bool* early, double* last) {
    *event = *early = false;
    *end = ends;
    *last = now + step;
    solve();
    if (value[5] > 1e6) { tell(NULL, 3, "error", "the gain is too large"); return 3; }
    return 0;
}
int fmi3Terminate(void* c) { return 0; }
"""


def build(folder: Path) -> Path:
    """The FMU in a folder.  Skips the test where there is no C compiler, or no Linux."""
    from fmpy.fmi3 import FMU3Slave

    compiler = shutil.which("cc")
    if compiler is None or platform.system() != "Linux":
        pytest.skip("there is no C compiler for an FMU of FMI 3.0")
    others = [name for name in dir(FMU3Slave) if name.startswith("fmi3") and f" {name}(" not in CODE.replace("*", "* ")]
    code = CODE + "".join(f"int {name}(void) {{ return 3; }}\n" for name in others)
    (folder / "crank.c").write_text(code, encoding="utf-8")
    library = folder / "crank.so"
    subprocess.run([compiler, "-shared", "-fPIC", "-w", "-o", library, folder / "crank.c"], check=True, timeout=60)
    from fmu_files import packed

    content = {"modelDescription.xml": DESCRIPTION.encode(), f"binaries/{SYSTEM}/crank.so": library.read_bytes()}
    return packed(content, folder / "crank.fmu")
