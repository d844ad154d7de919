"""Files that ask for smoothing, and how the reference draws them with and without it: a line of JSON each."""

import base64
import json

import numpy as np

import isocodec

FORMS = ["1", "9", "10", "59", "64", "", "0", "65", "07", "x", "-1", "1.0", " 4", "100", "4\n", "\u0664"]
"""Of the note, right ones and others."""


def show(data: bytes, parts: int) -> None:
    """Print the points with and without smoothing; ``parts``: of edges, 0 if the mesh is not the full grid."""
    even, plain = isocodec.decode(data), isocodec.decode(data, smooth=False)
    print(json.dumps({
        "data": base64.b64encode(data).decode(), "even": even.points.tolist(), "plain": plain.points.tolist(),
        "parts": parts,
    }))


for shape, radius in (((40, 41), 14.2), ((17, 16, 18), 6.3)):
    axes = np.meshgrid(*(np.arange(side) - side / 2.1 for side in shape), indexing="ij")
    field = radius - np.sqrt(sum(x**2 for x in axes)) + 0.4 * np.sin(axes[0])
    holes = np.where(axes[1] > radius - 1, np.nan, field)
    for values, precision in ((field, "signs smooth"), (field, "0.2 smooth"), (holes, "0.3 smooth")):
        file = isocodec.open(isocodec.encode(values, 0.05, precision=precision))
        assert "smoothing" in file.metadata
        layers = file.info.layers
        for count, layer in enumerate(layers, start=1):
            parts = layer.parts or 1
            show(file.edited(layers=count), parts if layer.level == layers[-1].level else 0)
    for form in FORMS:
        show(isocodec.encode(field, 0.05, precision="signs", metadata={"smoothing": form}), 1)
