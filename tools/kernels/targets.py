"""The platforms that there are libraries for."""

from __future__ import annotations

import platform
import sys
from typing import NamedTuple


class Variant(NamedTuple):
    """Code for some processors of a platform: what is appended to the names of entries, and what LLVM is told."""

    suffix: str
    cpu: str
    features: str


class Target(NamedTuple):
    """A platform.

    Attributes
    ----------
    name : str
    triple : str
        Its name in LLVM.
    linker : tuple of str
        What `ziglang` is called with to link objects into ``kernels.*``, but for the objects.
    library : str
    tag : str
        Of its wheels; empty if there are none.
    variants : tuple of Variant
        The one for every processor first.
    """

    name: str
    triple: str
    linker: tuple[str, ...]
    library: str
    tag: str
    variants: tuple[Variant, ...]


# No FMA, though every processor with AVX2 has it: no product is ever contracted with a sum, on any platform.
_X86 = (Variant("", "x86-64", ""), Variant("_avx2", "x86-64", "+avx2,+bmi,+bmi2,+lzcnt,+popcnt,+sse4.2"))
_ARM = (Variant("", "generic", ""),)
_ELF = ("ld.lld", "-shared", "-soname", "kernels.so", "--no-undefined", "-z", "now", "-z", "relro", "-z", "noexecstack",
        "--gc-sections", "--build-id=none", "-s", "-o", "kernels.so")
_PE = ("lld-link", "/dll", "/noentry", "/nodefaultlib", "/machine:x64", "/Brepro", "/out:kernels.dll")


def _mach(target: str) -> tuple[str, ...]:
    return ("build-lib", "-dynamic", "-target", target, "-fno-compiler-rt", "-fstrip", "-O", "ReleaseFast",
            "--name", "kernels", "-femit-bin=kernels.dylib")


# The stack lies below all else: what overflows it fails.
_WASM = ("wasm-ld", "--no-entry", "--gc-sections", "--strip-all", "--stack-first", "-z", "stack-size=1048576",
         "--export=__heap_base", "-o")
WASM = Target(
    "wasm32", "wasm32-unknown-unknown", _WASM, "kernels.wasm", "",
    (Variant("", "", "+bulk-memory,+bulk-memory-opt,+nontrapping-fptoint,+sign-ext,+simd128"),),
)
TARGETS = {
    target.name: target
    for target in (
        Target("linux-x86_64", "x86_64-unknown-linux-gnu", _ELF, "kernels.so",
               "manylinux_2_17_x86_64.manylinux2014_x86_64.musllinux_1_1_x86_64", _X86),
        Target("linux-aarch64", "aarch64-unknown-linux-gnu", _ELF, "kernels.so",
               "manylinux_2_17_aarch64.manylinux2014_aarch64.musllinux_1_1_aarch64", _ARM),
        Target("macos-aarch64", "arm64-apple-macosx11.0.0", _mach("aarch64-macos.11.0"), "kernels.dylib",
               "macosx_11_0_arm64", _ARM),
        Target("macos-x86_64", "x86_64-apple-macosx11.0.0", _mach("x86_64-macos.11.0"), "kernels.dylib",
               "macosx_11_0_x86_64", _X86),
        Target("windows-x86_64", "x86_64-pc-windows-gnu", _PE, "kernels.dll", "win_amd64", _X86),
    )
}


def native() -> Target | None:
    """The platform that this runs on, if it is one of those."""
    if sys.maxsize < 2**32:
        return None
    machine = {"AMD64": "x86_64", "arm64": "aarch64", "ARM64": "aarch64"}.get(platform.machine(), platform.machine())
    system = {"darwin": "macos", "win32": "windows"}.get(sys.platform, sys.platform)
    return TARGETS.get(f"{system}-{machine}")
