"""The second half of a build: objects of the kernels for a platform, and a library of them."""

from __future__ import annotations

import multiprocessing
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

from targets import Target, Variant

PARTS = Path(__file__).parent
PREFIX = "iso_"
"""What the names of all entries begin with."""
_NAMES = "-non-global-value-max-name-size=1000000"
"""LLVM cuts longer names."""


def link(code: bytes, target: Target, place: Path, jobs: int) -> None:
    """Write a library into a folder.

    Parameters
    ----------
    code : bytes
        LLVM's bitcode of all kernels.
    target : Target
    place : Path
    jobs : int
        Processes.
    """
    with multiprocessing.get_context("spawn").Pool(min(jobs, len(target.variants))) as pool:
        objects = pool.starmap(_object, [(code, target, variant) for variant in target.variants])
    linked([*objects, *_parts(target)], target.linker, place)
    for path in place.iterdir():
        if path.name != target.library:
            path.unlink()


def linked(objects: Iterable[bytes], linker: Iterable[str], place: Path) -> None:
    """Call a linker for objects, in a folder where they stay."""
    names = []
    for number, content in enumerate(objects):
        names.append(f"{number}.o")
        (place / names[-1]).write_bytes(content)
    done = subprocess.run([sys.executable, "-m", "ziglang", *linker, *names], cwd=place, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"linking failed: {' '.join(linker)}\n{done.stderr}")


def machine_of(target: Target, variant: Variant, reloc: str = "pic"):  # type: ignore[no-untyped-def]
    """LLVM's description of a processor; no product is contracted with a sum."""
    from llvmlite import binding

    binding.set_option("", _NAMES)
    binding.initialize_all_targets()
    binding.initialize_all_asmprinters()
    binding.initialize_native_asmparser()
    return binding.Target.from_triple(target.triple).create_target_machine(
        cpu=variant.cpu, features=variant.features, opt=3, reloc=reloc
    )


def _object(code: bytes, target: Target, variant: Variant) -> bytes:
    """The object of all kernels for some processors."""
    from llvmlite import binding

    machine = machine_of(target, variant)
    module = binding.parse_assembly(text_of(code, target, machine))
    for each in defined(module):
        if each.name.startswith(PREFIX):
            each.name += variant.suffix
            if target.library.endswith(".dll"):
                each.storage_class = "dllexport"
        else:
            each.linkage = "internal"
    optimise(module, machine)
    return machine.emit_object(module)


def text_of(code: bytes, target: Target, machine) -> str:  # type: ignore[no-untyped-def]
    """LLVM code of all kernels for a target."""
    from llvmlite import binding

    text = _for_target(str(binding.parse_bitcode(code)), target, machine)
    text = re.sub(r'"target-(cpu|features)"="[^"]*"', "", text)
    # an instruction everywhere; where LLVM has seen that no root is of a negative number, it is one already
    text = re.sub(r"^declare .*@(sqrt|llvm\.sqrt\.f64)\(.*\n", "", text, flags=re.M)
    return text.replace("@sqrt(", "@llvm.sqrt.f64(") + "\ndeclare double @llvm.sqrt.f64(double)\n"


def defined(module):  # type: ignore[no-untyped-def]
    """All functions and data of a module that it does not take from elsewhere."""
    return [each for each in [*module.functions, *module.global_variables] if not each.is_declaration]


def optimise(module, machine, vectors: bool = True) -> None:  # type: ignore[no-untyped-def]
    """Run LLVM's passes over a module; whether they may make loops of vectors out of loops of numbers."""
    from llvmlite import binding

    tuning = binding.create_pipeline_tuning_options(speed_level=3)
    tuning.loop_vectorization = vectors
    tuning.slp_vectorization = False
    builder = binding.create_pass_builder(machine, tuning)
    builder.getModulePassManager().run(module, builder)


def _for_target(text: str, target: Target, machine) -> str:  # type: ignore[no-untyped-def]
    """LLVM code with the target's name and layout of data instead of its own, if any."""
    text = re.sub(r"^target (triple|datalayout) = .*\n", "", text, flags=re.M)
    return f'target datalayout = "{machine.target_data}"\ntarget triple = "{target.triple}"\n{text}'


def _parts(target: Target) -> Iterator[bytes]:
    """Objects of what is written in LLVM's language itself."""
    from llvmlite import binding

    machine = machine_of(target, target.variants[0])
    for name in ["runtime.ll"] + ["processor.ll"] * (len(target.variants) > 1):
        module = binding.parse_assembly(_for_target((PARTS / name).read_text(), target, machine))
        for function in module.functions:
            if function.name.startswith(PREFIX) and target.library.endswith(".dll"):
                function.storage_class = "dllexport"
        optimise(module, machine)
        yield machine.emit_object(module)
