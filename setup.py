"""Builds the native kernel where a C compiler is there, and goes on without it where none is."""

from __future__ import annotations

import sys
import zlib
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_ext import build_ext

SOURCES = sorted(path.as_posix() for path in Path("hfsim/maths").glob("_re*.[ch]"))
FLAGS = ["-O3", "-fno-math-errno", "-fno-trapping-math"]
"""Known to GCC and clang; the kernel needs one of them."""
LIMITED = "cp311"
"""The oldest Python whose limited API it needs."""
WITHOUT = """
hfsim: the native kernel was not built: {why}
hfsim: all works without it, in NumPy, but runs take longer. With GCC or clang at hand install hfsim again.
"""


def checksum() -> int:
    """Return what tells sources apart."""
    return zlib.crc32(b"".join(Path(one).read_bytes() for one in SOURCES)) & 0x7FFFFFFF


class BuildKernel(build_ext):
    """Builds the kernel, or leaves it out and says so."""

    def run(self) -> None:
        """Build in the place that is asked for."""
        inplace = self.inplace
        try:
            super().run()
        except Exception as why:  # whatever keeps a compiler from it: it must not keep hfsim from its user
            print(WITHOUT.format(why=why), file=sys.stderr)
            self.inplace, self.extensions, self.distribution.ext_modules = inplace, [], []

    def build_extensions(self) -> None:
        """Say how, now that the compiler is known."""
        if self.compiler.compiler_type == "msvc":
            raise RuntimeError("this compiler lacks complex numbers of C and vectors")
        if sys.implementation.name != "cpython":
            raise RuntimeError("this Python lacks the limited API")
        for one in self.extensions:
            one.extra_compile_args, one.libraries = FLAGS, ["m"]
            one.define_macros = [("SOURCE", str(checksum()))]
        super().build_extensions()


class Wheel(bdist_wheel):
    """A wheel that says what is in it: for every Python on this platform, or for every platform."""

    def run(self) -> None:
        """Build first; what was built decides."""
        self.run_command("build")
        self.root_is_pure = not self.distribution.has_ext_modules()
        super().run()

    def get_tag(self) -> tuple[str, str, str]:
        """Return the tags of Python, its interface and the platform."""
        python, interface, platform = super().get_tag()
        return (python, interface, platform) if self.root_is_pure else (LIMITED, "abi3", platform)


setup(
    ext_modules=[
        Extension(
            "hfsim.maths._replay",
            [one for one in SOURCES if one.endswith(".c")],
            depends=[one for one in SOURCES if one.endswith(".h")],
            py_limited_api=True,
        )
    ],
    cmdclass={"build_ext": BuildKernel, "bdist_wheel": Wheel},
)
