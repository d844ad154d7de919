"""The list of vectors and what each decodes to: ``manifest.json`` next to the files."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

NAME = "manifest.json"
OK, TRUNCATED, ERROR, LIMIT, NO_MESH = "ok", "truncated", "error", "limit", "mesh"


@dataclass(frozen=True)
class LayerState:
    """The decoded state after a layer: the layer as the format names it, and the digest of the canonical text.

    ``isovalue`` is the number of the isovalue that the layer belongs to; None in a file of one isovalue.
    """

    kind: str
    level: int
    plane: int
    parts: int
    state: str
    unit: int = 0
    isovalue: int | None = None


@dataclass(frozen=True)
class Expected:
    """What a decoder makes of a vector.

    Attributes
    ----------
    status : str
        ``ok``; ``truncated``: the file ends too early, and the rest is what was received; ``error``: a decoder
        must refuse it; ``limit``: no decoder has to go on until the file turns out to be malformed, and one that
        stops before says so; ``mesh``: the mesh that the file was made on is missing, or another one is there.
    clause : str or None
        Of an ``error``, and of a ``limit`` for a decoder that goes on: the clause that the file violates, to inform.
    state : str or None
        Digest of the canonical text (``digest``).
    vertices, edges : int or None
        Lines of the text that tell of vertices, and of edges with offsets.
    symbols : dict of str to int
        Symbols by syntax element, to inform.
    coordinates : str or None
        Digest of the text of coordinates, of a file that has them; a decoder need not read them.
    """

    status: str
    clause: str | None = None
    state: str | None = None
    vertices: int | None = None
    edges: int | None = None
    symbols: dict[str, int] | None = None
    coordinates: str | None = None


@dataclass(frozen=True)
class Vector:
    """One vector.

    Attributes
    ----------
    name, file : str
        ``file`` is relative to the manifest.
    bytes : int
    sha256 : str
    dimension : int
    elements : list of str
        Syntax elements of which it has symbols.
    features : list of str
        What else it exercises.
    expected : Expected
    layers : list of LayerState
        States after each layer; empty where they are not stated.
    tier : int
        Lowest tier of conformance (spec clause 11.3) whose decoders have to decode the file.
    """

    name: str
    file: str
    bytes: int
    sha256: str
    dimension: int
    elements: list[str]
    features: list[str]
    expected: Expected
    layers: list[LayerState] = field(default_factory=list)
    tier: int = 0


def digest(text: str) -> str:
    """SHA-256 of a canonical text, in hexadecimal digits."""
    return hashlib.sha256(text.encode("ascii", "replace")).hexdigest()


def default_directory() -> Path:
    """Where the vectors are: in the installed package, or next to it in a checkout."""
    home = Path(__file__).resolve().parent
    inside = home / "vectors"
    return inside if inside.is_dir() else home.parent / "vectors"


def write_manifest(directory: Path, vectors: Sequence[Vector]) -> None:
    """Write the manifest, a line a vector, the same bytes for the same vectors."""
    lines = ",\n".join(json.dumps(_brief(asdict(v)), ensure_ascii=True) for v in vectors)
    (directory / NAME).write_bytes(f'{{"format": 0, "vectors": [\n{lines}\n]}}\n'.encode())


def read_manifest(directory: Path) -> list[Vector]:
    """Vectors in the order of the manifest.

    Raises
    ------
    OSError
        If there is none.
    ValueError
        If it is not a manifest.
    """
    content = json.loads((directory / NAME).read_bytes())
    try:
        return [_vector(entry) for entry in content["vectors"]]
    except (KeyError, TypeError) as error:
        raise ValueError(f"{directory / NAME} is not a manifest: {error}") from None


def _vector(entry: dict[str, Any]) -> Vector:
    layers = [LayerState(**layer) for layer in entry.get("layers", [])]
    return Vector(**{**entry, "expected": Expected(**entry["expected"]), "layers": layers})


def _brief(entry: dict[str, Any]) -> dict[str, Any]:
    """Without what is not stated."""
    entry["expected"] = {key: value for key, value in entry["expected"].items() if value is not None}
    for layer in entry["layers"]:
        if not layer["unit"]:
            del layer["unit"]
        if layer["isovalue"] is None:
            del layer["isovalue"]
    if not entry["layers"]:
        del entry["layers"]
    if not entry["tier"]:
        del entry["tier"]
    return entry
