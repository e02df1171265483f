"""The compiled core, beside what pyproject.toml says: one plain C library for every Python."""

# mypy: ignore-errors

import hashlib
import os
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

from cffi import FFI
from setuptools import Extension, find_packages, setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_ext import build_ext
from setuptools.errors import CompileError

#: Nobody reads errno or floating-point exceptions; NaN keeps its meaning. Without fused operations
#: all processors give the same digits.
FLAGS = [
    "-O2",
    "-std=gnu11",
    "-shared",
    "-ftree-vectorize",
    # GCC's own limits leave calls and loops of three in the steps of a release: 7 % of a plan.
    "-fpeel-loops",
    "-finline-limit=2000",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-ffp-contract=off",
    "-fno-builtin-sin",
    "-fno-builtin-cos",
    "-fvisibility=hidden",
]
#: What the library is built from; a test compares it with the checkout.
SOURCES = sorted(str(path) for path in Path("core").glob("*.[ch]"))
HASH = hashlib.sha256(b"".join(Path(path).read_bytes() for path in SOURCES)).hexdigest()
#: The headers that Python reads, as the module `_binding` in which cffi has read them.
HEADERS = ["core/structures.h", "core/functions.h"]
BINDING = Extension("throwplan.core._binding", HEADERS)
CORE = Extension(
    "throwplan.core._core",
    [path for path in SOURCES if path.endswith(".c")],
    # A source distribution holds them too.
    depends=[path for path in SOURCES if path.endswith(".h")],
)


def compiler() -> list[str]:
    """CC, or cc, gcc, clang; else the one of the package ziglang; empty for none."""
    for name in (os.environ.get("CC", ""), "cc", "gcc", "clang"):
        if name and shutil.which(name.split()[0]):
            return name.split()
    if find_spec("ziglang"):
        # Unlike other compilers zig takes this machine's processor; a wheel is for all.
        return [sys.executable, "-m", "ziglang", "cc", "-mcpu=baseline"]
    return []


def declared() -> FFI:
    """What the headers declare."""
    lines = [line for path in HEADERS for line in Path(path).read_text("utf-8").splitlines()]
    plain = [line.removeprefix("EXPORT ") for line in lines if line[:4] not in ("#inc", "#pra")]
    found = FFI()
    found.cdef("\n".join(plain))
    return found


class BuildCore(build_ext):
    """It knows nothing of Python, so it is no extension module and has no Python's name."""

    def is_for(self, system: str) -> bool:
        """Whether for `win` or `mac`: a wheel's --plat-name, with a CC that compiles for it."""
        return self.get_finalized_command("bdist_wheel").plat_name.startswith(system)

    def get_ext_filename(self, fullname: str) -> str:
        """A library's name, or the module's."""
        if fullname.endswith("_binding"):
            return os.path.join(*fullname.split(".")) + ".py"
        suffix = ".dll" if self.is_for("win") else ".dylib" if self.is_for("mac") else ".so"
        return os.path.join(*fullname.split(".")) + suffix

    def build_extension(self, ext: Extension) -> None:
        """One call of cffi, or of the compiler."""
        target = Path(self.get_ext_fullpath(ext.name))
        target.parent.mkdir(parents=True, exist_ok=True)
        if ext is BINDING:
            ffi = declared()
            ffi.set_source(ext.name, None)
            ffi.emit_python_code(str(target))
            with target.open("a", encoding="utf-8") as file:
                file.write(f'SOURCES = "{HASH}"\n')
            return
        if not compiler():
            raise CompileError("throwplan's core needs a C compiler: install gcc, clang or ziglang")
        macro = f'-DCORE_SOURCES="{HASH}"'
        pic = [] if self.is_for("win") else ["-fPIC", "-lm"]
        command = [*compiler(), *FLAGS, macro, *ext.sources, "-o", str(target), *pic]
        done = subprocess.run(command, check=False)
        if done.returncode:
            raise CompileError(f"throwplan's core was not built: {' '.join(command)}")


class Wheel(bdist_wheel):
    """One wheel a platform serves every Python."""

    def get_tag(self) -> tuple[str, str, str]:
        """For Python 3, by no Python's binary interface."""
        return "py3", "none", super().get_tag()[2]


HEART = ("core", "models", "planner", "problems")
ROOMS = ("cli", "cycles", "lab", "pictures", "robots")
FOLDERS = [f"{name}*" for name in HEART + ROOMS]
# Called so, the script is no module of the package.
setup(
    packages=["throwplan", *(f"throwplan.{name}" for name in find_packages(include=FOLDERS))],
    ext_modules=[BINDING, CORE],
    cmdclass={"build_ext": BuildCore, "bdist_wheel": Wheel},
    # Build front ends take a compiler from the package index where there is none; 400 MB unpacked.
    setup_requires=[] if compiler() else ["ziglang>=0.13"],
    script_name="setup.py",
)
