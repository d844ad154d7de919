"""DXF drawings: curves as polylines, surfaces as meshes, each isovalue on a separate layer."""

from __future__ import annotations

import io
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from ...extras import optional
from ...field.labelling import is_of_labels
from .output_formats import Cost, Output, OutputOptions

if TYPE_CHECKING:
    from ...drawing.contour import Contour


def _render(contours: Iterable[Contour], suffix: str, _: OutputOptions) -> bytes:
    """A drawing (R2010). Polylines of curves lie at the height of their isovalue, of labels at 0; x and y are those of
    `placed`. Those of a plane in space lie there.
    """
    library: Any = optional("ezdxf", extra="cad", purpose=f"writing {suffix}")
    before = library.options.write_fixed_meta_data_for_testing
    # without the time and a unique identifier, so that equal input gives equal bytes
    library.options.write_fixed_meta_data_for_testing = True
    try:
        document = library.new("R2010", setup=False, units=0)
        space = document.modelspace()
        colour = 0
        for contour in contours:
            name = _layer_name(contour)
            colour = colour % 6 + 1
            if name not in document.layers:
                document.layers.add(name, color=colour)
            if contour.n == 2:
                whole = contour.joined
                for walk in whole.walks:
                    places = whole.along(walk)
                    closed = len(walk) > 2 and bool((places[0] == places[-1]).all())
                    points = places[: -1 if closed else None].tolist()
                    if places.shape[1] > 2:  # on a plane in space
                        space.add_polyline3d(points, close=closed, dxfattribs={"layer": name})
                        continue
                    attributes = {"layer": name, "elevation": _height(contour)}
                    space.add_lwpolyline(points, format="xy", close=closed, dxfattribs=attributes)
            elif len(contour.cells):
                whole = contour.joined
                with space.add_mesh(dxfattribs={"layer": name}).edit_data() as mesh:
                    mesh.vertices = whole.placed.tolist()
                    mesh.faces = whole.placed_cells.tolist()
            del contour
        text = io.StringIO()
        document.write(text)
    finally:
        library.options.write_fixed_meta_data_for_testing = before
    return text.getvalue().encode(document.output_encoding)


def _height(contour: Contour) -> float:
    """The height of a curve: its isovalue; of the border of a label 0."""
    return 0.0 if is_of_labels(contour.metadata) else float(contour.isovalue)


def _layer_name(contour: Contour) -> str:
    """The layer of an isovalue: ``ISO_500.5``; of a label ``LABEL_3``."""
    return f"{'LABEL' if is_of_labels(contour.metadata) else 'ISO'}_{contour.isovalue:.12g}"


_COST = {2: Cost(500, 200, 1 << 23), 3: Cost(600, 900, 1 << 24)}
OUTPUTS = (
    Output("contour", (".dxf",), "DXF", _render, (2, 3), (2, 3), "a layer each", extra="cad", libraries=("ezdxf",),
           cost=_COST),
)
