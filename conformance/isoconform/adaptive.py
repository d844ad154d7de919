"""Vectors of adaptive meshes: bases and refinements (clauses 4.7 and 5.8)."""

from __future__ import annotations

from collections.abc import Iterator

from isocodec.format.chunks import CHECKSUM_BYTES
from isocodec.format.events import LayerComplete
from isocodec.format.header import Header, write_header
from isocodec.format.program import Layer
from isospec.container import ChunkType, Operation

from .draft import Draft, encoded, within
from .dump import CUT_OFF, Output, dump
from .fields import Integers, noise, random_numbers, salt, torus, waves
from .meshes import Mesh, Point, chosen, closed, exponent, random_mesh, uniform
from .streams import Chunk, File, planned, rounds, sign_tube, steps_of

HILLS = waves((17, 20), 255)
RING = torus((15, 15, 9), 9, 4)
FEW, SOME, MANY = 30, 120, 400
"""Shares of middles picked, of 1024."""
REFINED: tuple[Point, ...] = ((13, 11), (5, 7, 6))
RANDOM_CHUNK = 600
"""Bytes of a run that is stated, and not all there."""
RANDOM_SIZES = (40, 80, 160, 320)
RANDOM_SYMBOLS = 150
SPACES = {2: "plane", 3: "space"}

Steps = tuple[object, ...]


def base_on(field: Integers, mesh: Mesh, level: int = 0) -> Steps:
    """An entry of a plan: an adaptive base on a mesh."""
    return "adaptive_base", level, chosen(field.shape, mesh | uniform(field.shape, level))


def adapt_to(field: Integers, mesh: Mesh, births: int = 1) -> Steps:
    """An entry of a plan: an adaptive layer that leads to a mesh."""
    return "adapt", births, chosen(field.shape, mesh)


def reduced() -> Iterator[Draft]:
    """Bases on meshes that the reference encoder finds by reduction (docs/encoders.md)."""
    parts: tuple[tuple[str, Integers, float], ...] = (("plane", HILLS, 100.5), ("space", RING, 0.5))
    for space, field, isovalue in parts:
        about = "adaptive base by reduction"
        yield encoded(
            f"{space}_reduced_topology_refined", field, isovalue, about, "refined to the full grid", "topology kept",
            precision="signs", keep_topology=True, states=True,
        )
        for criterion, parameter in (("topology", None), ("crossing", None), ("curvature", 0.25), ("distortion", 0.75)):
            yield encoded(
                f"{space}_reduced_{criterion}", field, isovalue, about, f"criterion: {criterion}", precision="signs",
                layers=criterion if parameter is None else f"{criterion}={parameter}",
                keep_topology=criterion == "distortion", states=criterion == "topology",
            )
        yield encoded(
            f"{space}_reduced_level", field, isovalue, about, "criterion: level", "topology not kept",
            precision="signs", layers="level=7.0",
        )
        yield encoded(
            f"{space}_searched", field, isovalue, "adaptive mesh and offsets searched for a tolerance", "offsets",
            precision=0.4, keep_topology=True, states=True,
        )
    for space, field, isovalue in parts:
        yield encoded(
            f"{space}_steps_topology", field, isovalue, "steps: distances one after the other", "topology kept",
            precision=[3.0, 1.0], keep_topology=True, states=True,
        )
    yield encoded(
        "plane_steps", HILLS, 100.5, "steps: distances one after the other, then all values",
        "values after offsets on coarser meshes", precision=[3.0, 1.0, "exact"], states=True,
    )


def bases() -> Iterator[Draft]:
    """Adaptive bases on any closed meshes, in domains of all sorts."""
    shapes: tuple[tuple[tuple[int, ...], int], ...] = (
        ((9, 9), SOME), ((12, 11), MANY), ((3, 6), MANY), ((6, 3), MANY), ((10, 3), SOME), ((2, 13), MANY),
        ((5, 5, 5), FEW), ((5, 6, 3), SOME), ((6, 3, 6), SOME), ((6, 2, 6), MANY), ((4, 7, 5), FEW), ((3, 3, 9), SOME),
    )
    for seed, (shape, share) in enumerate(shapes, 100):
        field = noise(shape, seed, 1)
        mesh = random_mesh(shape, seed + 50, share)
        yield encoded(
            f"{SPACES[len(shape)]}_adaptive_{'x'.join(map(str, shape))}", field, 0.5, "adaptive base on any mesh",
            "noise", f"border: {'x'.join(map(str, shape))} samples", layers=[base_on(field, mesh)],
        )
    for name, field, isovalue, levels in (("plane", HILLS, 100.5, (3, 6)), ("space", RING, 0.5, (4, 6))):
        for level in levels:
            mesh = random_mesh(field.shape, level, FEW)
            yield encoded(
                f"{name}_adaptive_from_{level}", field, isovalue, f"adaptive base, uniform up to level {level}",
                "smooth", layers=[base_on(field, mesh, level)],
            )
    for shape, isovalue, about in (((9, 12), 2.0, "below"), ((9, 12), -1.0, "above"), ((5, 4, 6), 2.0, "below")):
        field = noise(shape, 1, 1)
        yield encoded(
            f"{SPACES[len(shape)]}_adaptive_all_{about}", field, isovalue, f"no curve: all {about}",
            layers=[base_on(field, random_mesh(shape, 2, SOME))],
        )
    for shape in ((9, 9), (5, 5, 5)):
        n = len(shape)
        field = noise(shape, 5, 1)
        full = n * exponent(shape)
        for name, mesh, level in (
            ("root", frozenset(), 0),
            ("all", uniform(shape, full), 0),
            ("full", frozenset(), full),
        ):
            yield encoded(
                f"{SPACES[n]}_adaptive_{name}", field, 0.5, "adaptive base on the mesh of a uniform level",
                layers=[base_on(field, mesh, level)],
            )


def refinements() -> Iterator[Draft]:
    """Adaptive layers after bases and rounds of both sorts, and rounds after them."""
    for shape in REFINED:
        n = len(shape)
        space, full = SPACES[n], n * exponent(shape)
        smooth = waves(shape, 255, 4)
        coarse = random_mesh(shape, 7, FEW)
        middle = random_mesh(shape, 8, SOME, coarse)
        fine = random_mesh(shape, 9, MANY, middle)
        rough = noise(shape, 33, 1)
        plans: tuple[tuple[str, Integers, float, str, list[Steps]], ...] = (
            ("after_base", smooth, 90.5, "adaptive refinement after a uniform base",
             [("base", n), adapt_to(smooth, fine | uniform(shape, n), 0)]),
            ("births", rough, 0.5, "noise", [base_on(rough, coarse), adapt_to(rough, fine)]),
            ("twice", rough, 0.5, "kept middles refined later",
             [base_on(rough, coarse), adapt_to(rough, middle), adapt_to(rough, fine)]),
            ("then_refined", rough, 0.5, "refined to the full grid", [base_on(rough, middle), ("refine", None)]),
            ("and_uniform", rough, 0.5, "uniform and adaptive refinement by turns",
             [("base", 1), adapt_to(rough, coarse | uniform(shape, 1)), ("refine", 2),
              adapt_to(rough, middle | uniform(shape, 3)), ("refine", 1),
              adapt_to(rough, fine | uniform(shape, 4)), ("refine", None)]),
            ("to_all", rough, 0.5, "every middle added by an adaptive layer, which does not make it the full grid",
             [("base", 2), adapt_to(rough, uniform(shape, full)), ("refine", None)]),
            ("nothing", rough, 0.5, "an adaptive layer that adds nothing",
             [base_on(rough, coarse), adapt_to(rough, coarse), adapt_to(rough, coarse, 0)]),
        )
        for name, field, isovalue, about, plan in plans:
            yield encoded(f"{space}_adapt_{name}", field, isovalue, about, layers=plan, states=True)
        # what no encoder should do: vertices come in whose signs are never told
        layers = [Layer("adaptive_base", 0), Layer("adapt", 0), *rounds(1, full)]
        meshes = [chosen(shape, coarse), chosen(shape, fine)]
        file = planned(Header(shape, 0.5), sign_tube(shape, rough > 0), [layers], meshes=meshes)
        yield Draft(f"{space}_adapt_no_births", bytes(file), n, ("new components left out", "noise"), layers=True)
    # births far from known curves, with all that their middles descend from
    salted: tuple[tuple[Point, list[Point]], ...] = (
        ((33, 29), [(3, 4), (25, 9), (14, 21)]),
        ((12, 17, 9), [(3, 3, 4), (9, 13, 3), (2, 15, 7)]),
    )
    for shape, points in salted:
        field = salt(shape, points)
        n = len(shape)
        mesh = random_mesh(shape, 3, 4) | uniform(shape, n) | closed(shape, points)
        yield encoded(
            f"{SPACES[n]}_adapt_births_far", field, 0.5, "new components far from known curves",
            layers=[("base", n), adapt_to(field, mesh)], states=True,
        )
        yield encoded(
            f"{SPACES[n]}_adapt_births_below", 1 - field, 0.5, "new components below, far from known curves",
            layers=[base_on(field, frozenset()), adapt_to(field, mesh)],
        )
    # an edge whose half further away is cut, and the nearer one is not, on the way of an inference
    field = salt((13, 11), [(0, 0), (7, 5), (9, 4), (11, 6), (12, 2)])
    yield encoded(
        "plane_adapt_births_past_cuts", field, 0.5, "new components far from known curves",
        layers=[base_on(field, frozenset([(0, 8), (4, 0), (4, 4), (8, 0), (8, 8)])), ("refine", None)],
    )
    # clamped images that are known before
    border: tuple[Point, ...] = ((3, 6), (6, 3), (11, 6), (5, 6, 3), (6, 3, 6))
    for seed, shape in enumerate(border, 70):
        field = noise(shape, seed, 3)
        coarse = random_mesh(shape, seed, FEW)
        fine = random_mesh(shape, seed + 1, MANY, coarse)
        yield encoded(
            f"{SPACES[len(shape)]}_adapt_known_middles_{'x'.join(map(str, shape))}", field, 2.5, "noise",
            "border: middles known before the round",
            layers=[base_on(field, coarse), adapt_to(field, fine), ("refine", None)],
        )


def cuts() -> Iterator[Draft]:
    """Files that end within adaptive layers."""
    for space, field, isovalue in (("plane", noise((17, 19), 41, 3), 3.5), ("space", noise((6, 7, 9), 42, 3), 3.5)):
        coarse = random_mesh(field.shape, 43, FEW)
        fine = random_mesh(field.shape, 44, MANY, coarse)
        plan = [base_on(field, coarse), adapt_to(field, fine), ("refine", None)]
        data = encoded(space, field, isovalue, layers=plan).data
        for kind, about in (("adaptive_base", "an adaptive base"), ("adapt", "an adaptive layer")):
            yield Draft(
                f"{space}_ends_in_{kind}", within(data, kind)[1], field.ndim,
                ("the file ends too early", f"within {about}"),
            )
        yield Draft(
            f"{space}_ends_in_refine_after_adapt", within(data, "refine")[1], field.ndim,
            ("the file ends too early", "within a round after adaptive layers"),
        )


def random_run(file: File, program: bytes, layers: int) -> bytes:
    """The start of a file and of one more chunk, of random bytes that are no error and get to its last layer."""
    start = bytes(file.with_chunks(*file.chunks, Chunk(ChunkType.LAYERS, program + bytes(RANDOM_CHUNK))))
    start = start[: -CHECKSUM_BYTES - RANDOM_CHUNK]
    before, known = _progress(dump(start))
    for seed in range(20000):
        for size in RANDOM_SIZES:
            data = start + bytes(random_numbers(seed, size, 8))
            output = dump(data)
            if output.exit_code != CUT_OFF:
                break
            done, symbols = _progress(output)
            if done - before >= layers - 1 and symbols - known >= RANDOM_SYMBOLS:
                return data
    raise AssertionError("random runs get nowhere")


def _progress(output: Output) -> tuple[int, int]:
    """Layers that are complete, and symbols."""
    return sum(isinstance(event, LayerComplete) for event in output.events), sum(output.symbols.values())


def strange() -> Iterator[Draft]:
    """Runs of random bytes: no encoder writes that, every decoder reads it (a domain is told, the curve is not)."""
    for shape in ((11, 14), (6, 5, 8)):
        n = len(shape)
        header = write_header(Header(shape, 0.5))
        for name, steps, about in (
            ("adapt", ((Operation.ADAPTIVE_BASE, 1), (Operation.ADAPT, 1), (Operation.REFINE, 1)), "adaptive layers"),
            ("births", ((Operation.BASE, 2), (Operation.ADAPT, 1), (Operation.ADAPT, 1)), "adaptive layers"),
            ("base", ((Operation.ADAPTIVE_BASE, 0), (Operation.REFINE, 1)), "an adaptive base"),
        ):
            data = random_run(File(header, ()), steps_of(*steps), len(steps))
            yield Draft(
                f"{SPACES[n]}_random_{name}", data, n, ("a run of random bytes", about, "the file ends too early")
            )


def drafts() -> Iterator[Draft]:
    """All vectors of this module."""
    for group in (reduced, bases, refinements, cuts, strange):
        yield from group()
