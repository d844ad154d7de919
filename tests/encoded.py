"""Files that many tests need, encoded once as long as the sources stay as they are."""

from __future__ import annotations

import hashlib
import os
import pickle
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import isocodec
import isospec
from home import ROOT
from isocodec.kernel import EXECUTION

KEPT = ROOT / ".pytest_cache" / "encoded"
"""Beside what pytest keeps: `make clean` takes both away."""


@cache
def sources() -> bytes:
    """Digest of all sources that a file depends on."""
    out = hashlib.sha256(EXECUTION.value.encode())
    for package in (isocodec, isospec):
        for path in sorted(Path(str(package.__file__)).parent.rglob("*.py")):
            out.update(path.read_bytes())
    return out.digest()


@cache
def _kept(digest: str, asked: bytes) -> bytes:
    path = KEPT / digest
    if path.is_file():
        return path.read_bytes()
    field, isovalue, options = pickle.loads(asked)
    if "tile" in options:
        with TemporaryDirectory() as folder:
            isocodec.save(Path(folder) / "tiled.iso", field, isovalue, **options)
            data = (Path(folder) / "tiled.iso").read_bytes()
    else:
        data = isocodec.encode(field, isovalue, **options)
    KEPT.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f"{digest}.{os.getpid()}")
    part.write_bytes(data)
    # several processes may do so at once
    part.replace(path)
    return data


def encoded(field: Any, isovalue: Any = None, **options: Any) -> bytes:
    """`isocodec.encode`, or with ``tile`` what `isocodec.save` writes; or what either gave before."""
    asked = pickle.dumps((field, isovalue, options))
    return _kept(hashlib.sha256(sources() + asked).hexdigest(), asked)
