"""The Julia package: each ccall against its prototype in marble.h, and its own test by a real Julia where there is one.

Usage: julia_test.py BUILD_DIR
"""

import os
import pathlib
import re
import shutil
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
BUILD = pathlib.Path(sys.argv[1]).resolve()
PACKAGE = ROOT / "client/c/julia"
# By the declaration of a parameter or a result.
TYPES = [(r"marble_error\*", {"Ptr{UInt8}"}), (r"const char\*", {"Cstring"}), (r"marble_\w+\*\*", {"Ref{Ptr{Cvoid}}"}),
         (r"(const )?marble_\w+\*", {"Ptr{Cvoid}"}), (r"const double\*\*", {"Ref{Ptr{Float64}}"}),
         (r"const double\*", {"Ptr{Float64}"}), (r"double\*", {"Ref{Float64}"}),
         (r"const int32_t\*\*", {"Ref{Ptr{Int32}}"}), (r"const int32_t\*", {"Ptr{Int32}"}), (r"int64_t\*", {"Ref{Int64}"}),
         (r"int32_t", {"Int32"}), (r"int64_t", {"Int64"}), (r"double", {"Float64"}),
         (r"void", {"Cvoid"})]


def julia_types(declaration):
    kind = re.sub(r"\s*\w+$", "", declaration.strip()) if re.search(r"[*\s]\w+$", declaration.strip()) else declaration
    return next((names for pattern, names in TYPES if re.fullmatch(pattern, kind.strip())), set())


def prototypes():
    text = re.sub(r"/\*.*?\*/", "", (ROOT / "client/c/include/marble.h").read_text(), flags=re.DOTALL)
    found = re.findall(r"(int32_t|void|double|const char\*) (marble_\w+)\(([^)]*)\);", text)
    return {name: [julia_types(result), *(julia_types(one) for one in parameters.split(",") if one.strip() != "void")]
            for result, name, parameters in found}


def main():
    known, calls = prototypes(), 0
    source = (PACKAGE / "src/Marble.jl").read_text()
    for name, result, parameters in re.findall(r"ccall\(\(:(\w+), LIBRARY\), (\w+),\s*\(((?:[^()]|\n)*)\),", source):
        types = [result, *(one.strip() for one in parameters.split(",") if one.strip())]
        assert name in known, f"{name} is not in marble.h"
        assert len(types) == len(known[name]), (name, types, known[name])
        for place, (reported, wanted) in enumerate(zip(types, known[name], strict=True)):
            assert reported in wanted, f"{name}: {'result' if place == 0 else place} is {reported}, not {wanted}"
        calls += 1
    assert calls == source.count("ccall(("), "a ccall has not been looked at"
    error = re.search(r"typedef struct marble_error \{(.*?)\}", (ROOT / "client/c/include/marble.h").read_text(), re.DOTALL)[1]
    offset, offsets = 0, {}
    for kind, name, count in re.findall(r"(int32_t|int64_t|char) (\w+)(?:\[(\d+)\])?;", error):
        offsets[name] = (offset, int(count or 0))
        offset += {"int32_t": 4, "int64_t": 8, "char": 1}[kind] * int(count or 1)
    assert f"ERROR_BYTES = {offset}\n" in source
    for name in ("field", "value", "bound", "message"):
        assert "text(error, {}, {})".format(*offsets[name]) in source, name
    print(f"holds: {calls} calls as marble.h declares them")
    julia = shutil.which("julia")
    if julia is None:
        print("not run: there is no Julia here")
        return
    done = subprocess.run([julia, f"--project={PACKAGE}", HERE / "julia_test.jl"], timeout=280, check=False,
                          env={**os.environ, "MARBLE_LIBRARY": str(BUILD / "client/c/libmarble.so"), "MARBLE_SERVER": "local"})
    sys.exit(done.returncode)


main()
