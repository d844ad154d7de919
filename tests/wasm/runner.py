"""Kernels on WebAssembly: Python does all else, and every call of a kernel runs in a process of node.

A kernel's arrays are copied into the module's memory, and back what it has changed. Both sides know what lies there, so
that only what has changed meanwhile is sent.
"""

from __future__ import annotations

import ctypes
import importlib
import json
import pkgutil
import struct
import subprocess
from bisect import bisect_right
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

import isocodec
from isocodec.kernel.call import RESULTS, Entry, Kernel
from isocodec.kernel.library import symbol
from isocodec.kernel.types import SLOT, Array, Kind, Named, Record

FAILED = -1
SCRATCH = 1 << 16
"""Bytes of memory that are kept for results, fault and slots."""
_FAULT, _SLOTS = SLOT * RESULTS, SLOT * RESULTS + 64
MOST = 1 << 29
"""Bytes of memory from which on arrays that have been copied are forgotten."""


class Failed(Exception):
    """A kernel came to an end that it must not come to: a trap, or memory is lacking."""


def kernels() -> Iterator[Kernel]:
    """All kernels of the package."""
    for found in pkgutil.walk_packages(isocodec.__path__, f"{isocodec.__name__}."):
        if not found.name.endswith("__main__") and ".plugins." not in found.name:  # which other programs import
            module = importlib.import_module(found.name)
            yield from (each for each in vars(module).values()
                        if isinstance(each, Kernel) and each.function.__module__ == found.name)


class Runner:
    """A process of node with a module.

    Parameters
    ----------
    module : Path

    Attributes
    ----------
    entries : set of str
        Names of the module's entries.
    called : set of str
        Those that have been called.
    """

    def __init__(self, module: Path) -> None:
        script = Path(__file__).with_suffix(".mjs")
        pipe = subprocess.PIPE
        self._node = subprocess.Popen(["node", script, module], stdin=pipe, stdout=pipe, pipesize=1 << 20)
        start = json.loads(self._received())
        self.entries, self.called = set(start["entries"]), set[str]()
        self._scratch = -(-start["free"] // 16) * 16
        self._known = np.zeros(0, np.uint8)
        self._forget()

    def close(self) -> None:
        """End the process."""
        self._node.stdin.close()
        self._node.wait()
        self._node.stdout.close()

    @contextmanager
    def at_work(self) -> Iterator[None]:
        """Meanwhile all kernels of this process run there."""
        with ExitStack() as stack:
            for kernel in kernels():
                stack.enter_context(patch.dict(vars(kernel), entry=self.entry(kernel)))
            yield

    def entry(self, kernel: Kernel) -> Entry:
        """A kernel's entry, as that of a library."""
        name, places = symbol(kernel.name), list(_arrays(kernel.signature.frame, 0))

        def run(results: Any, _fault: Any, frame: bytes) -> int:
            if name not in self.entries:
                raise Failed(f"{name} is not in the module")
            self.called.add(name)
            slots = list(struct.unpack(f"<{len(frame) // SLOT}q", frame))
            arrays = [(place, slots[place], slots[place + 1] * size) for place, size in places if slots[place + 1]]
            regions = self._placed(_merged((address, size) for _, address, size in arrays))
            for place, address, _ in arrays:
                (start, _), there = regions[bisect_right(regions, address, key=lambda region: region[0][0]) - 1]
                slots[place] = there + address - start
            frame = struct.pack(f"<{len(slots)}q", *slots)
            return self._called(name, frame, regions, results)

        return run

    def _called(self, name: str, frame: bytes, regions: list[Any], results: Any) -> int:
        written = [(self._scratch + _SLOTS, frame)]
        for (address, size), there in regions:
            content, known = _view(address, size), self._known[there : there + size]
            if not np.array_equal(content, known):
                known[:] = content
                written.append((there, content))
        scratch = self._scratch
        parts = [struct.pack("<I", len(name)), name.encode(),
                 struct.pack("<5I", scratch, scratch + _FAULT, scratch + _SLOTS, self._end, len(written))]
        for there, content in written:
            parts += [struct.pack("<2I", there, len(content)), content]
        parts.append(struct.pack("<I", len(regions)))
        parts += [struct.pack("<2I", there, size) for (_, size), there in regions]
        self._send(parts)
        return self._taken(name, self._received(), regions, results)

    def _taken(self, name: str, answer: bytes, regions: list[Any], results: Any) -> int:
        (status,) = struct.unpack_from("<i", answer)
        if status == FAILED:
            raise Failed(f"{name}: {answer[4:].decode()}")
        ctypes.memmove(results, answer[4:], SLOT * RESULTS)
        place = 4 + SLOT * RESULTS
        homes = {there: address for (address, _), there in regions}
        while place < len(answer):
            there, size = struct.unpack_from("<2I", answer, place)
            place += 8
            content = np.frombuffer(answer, np.uint8, size, place)
            _view(homes[there], size)[:] = self._known[there : there + size] = content
            place += size
        return status

    def _placed(self, regions: list[tuple[int, int]]) -> list[tuple[tuple[int, int], int]]:
        """Regions of this process's memory, each with its address in the module's."""
        if self._end + sum(size + 16 for _, size in regions) > MOST:
            self._forget()
        for region in regions:
            if region not in self._places:
                self._places[region] = self._end
                self._end += -(-region[1] // 16) * 16
        if self._end > len(self._known):
            more = np.zeros(max(self._end - len(self._known), len(self._known)), np.uint8)
            self._known = np.concatenate([self._known, more])
        return [(region, self._places[region]) for region in regions]

    def _forget(self) -> None:
        self._places: dict[tuple[int, int], int] = {}
        self._end = self._scratch + SCRATCH

    def _send(self, parts: list[Any]) -> None:
        content = b"".join(parts)
        self._node.stdin.write(struct.pack("<I", len(content)))
        self._node.stdin.write(content)
        self._node.stdin.flush()

    def _received(self) -> bytes:
        (size,) = struct.unpack("<I", self._node.stdout.read(4))
        return self._node.stdout.read(size)


def _arrays(kind: Kind, slot: int) -> Iterator[tuple[int, int]]:
    """Of each array in what is handed over: its first slot, and the bytes of an entry."""
    if isinstance(kind, Array):
        yield slot, np.dtype(kind.dtype).itemsize
    elif isinstance(kind, Named):
        yield slot, SLOT
    elif isinstance(kind, Record):
        for _, member in kind.members:
            yield from _arrays(member, slot)
            slot += member.slots


def _merged(regions: Iterator[tuple[int, int]]) -> list[tuple[int, int]]:
    """Regions of memory, by address and size, without those that overlap: each of them as one."""
    out: list[tuple[int, int]] = []
    for address, size in sorted(regions):
        if out and address < sum(out[-1]):
            start, before = out.pop()
            address, size = start, max(before, address + size - start)
        out.append((address, size))
    return out


def _view(address: int, size: int) -> np.ndarray:
    """This process's memory."""
    return np.ctypeslib.as_array((ctypes.c_uint8 * size).from_address(address))
