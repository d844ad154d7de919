"""The kernels as WebAssembly: a module of all of them, and one of those that a decoder needs.

Modules import nothing; they export their memory, and ``__heap_base``, from where on it is free. Entries are those of a
library, with addresses in the low halves of their slots. What they take stands in sections of the module: `layouts`.

    python tools/kernels/webassembly.py DIR    says what the modules in a folder weigh; needs brotli
"""

from __future__ import annotations

import multiprocessing
import re
import sys
from pathlib import Path

import back
import front
import layouts
from targets import WASM

DECODER = "decoder.wasm"


def link(code: bytes, place: Path, decoders: set[str], jobs: int) -> None:
    """Write both modules into a folder.

    Parameters
    ----------
    code : bytes
        LLVM's bitcode of all kernels.
    place : Path
    decoders : set of str
        The entries that a decoder needs.
    jobs : int
        Processes.
    """
    everything = {found.symbol for found in front.kernels()}
    modules = {WASM.library: everything, DECODER: decoders}
    with multiprocessing.get_context("spawn").Pool(min(jobs, len(modules))) as pool:
        objects = pool.starmap(_object, [(code, entries) for entries in modules.values()])
    for (name, entries), content in zip(modules.items(), objects, strict=True):
        exports = [f"--export={entry}" for entry in sorted(entries)]
        back.linked([content], [*WASM.linker, name, *exports], place)
        with (place / name).open("ab") as module:
            module.write(layouts.sections(entries))
    (place / "0.o").unlink()


def _object(code: bytes, entries: set[str]) -> bytes:
    """The object of some kernels."""
    from llvmlite import binding

    machine = back.machine_of(WASM, WASM.variants[0], reloc="static")
    text = back.text_of(code, WASM, machine)
    # pointers take four bytes, and lie anywhere in a structure
    text = re.sub(r"^( *(?:%\S+ = load|store) ptr\b.*, align) 8", r"\1 4", text, flags=re.M)
    # what is called from several places stays one function, if it is not small: that is smaller, and no slower
    text = text.replace("alwaysinline", "nounwind")
    module = binding.parse_assembly(text)
    for each in back.defined(module):
        if each.name not in entries:
            each.linkage = "internal"
    back.optimise(module, machine, vectors=False)
    return machine.emit_object(module)


def main() -> int:
    """Print bytes of each module in a folder: as it is, and as servers send it."""
    import brotli

    for path in sorted(Path(sys.argv[1]).glob("*.wasm")):
        content = path.read_bytes()
        print(f"{path.name}: {len(content)} bytes, {len(brotli.compress(content, quality=11))} with brotli")
    return 0


if __name__ == "__main__":
    sys.exit(main())
