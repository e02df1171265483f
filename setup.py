"""The compiled core, beside what pyproject.toml says: plain C, loaded by ctypes, optional."""

# mypy: ignore-errors

from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

#: Nobody reads errno or floating-point exceptions; NaN keeps its meaning. Without fused operations
#: all processors give the same digits.
FLAGS = [
    "-O2",
    "-g0",
    "-ftree-vectorize",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-ffp-contract=off",
    "-fno-builtin-sin",
    "-fno-builtin-cos",
    "-fvisibility=hidden",
]


class BuildCore(build_ext):
    """Without a compiler nothing is built: an editable installation would stop over that."""

    def run(self) -> None:
        """Builds, then forgets what is not there."""
        super().run()
        self.extensions = [
            e for e in self.extensions if Path(self.get_ext_fullpath(e.name)).exists()
        ]


CORE = Extension(
    "throwplan.core._core",
    sorted(str(path) for path in Path("core").glob("*.c")),
    depends=["setup.py", *sorted(str(path) for path in Path("core").glob("*.h"))],
    extra_compile_args=FLAGS,
    libraries=["m"],
    optional=True,
)

# Called so, the script is no module of the package.
setup(ext_modules=[CORE], cmdclass={"build_ext": BuildCore}, script_name="setup.py")
