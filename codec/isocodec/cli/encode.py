"""``isocodec encode``: a field in, an .iso file out."""

from __future__ import annotations

import time
from contextlib import ExitStack, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from .encode_options import encode_options, read_criterion, read_metadata, read_numbers, read_steps
from .inputs import local_input
from .isovalues import check_interval, multiples
from .mapped import read_tolerance, world_of
from .options import Grouped
from .planned import Planned
from .prepared import Prepared
from .progress import progress_bar
from .quiet import one_warning
from .report import check_iso_output, concerning, tell, warn, write_output
from .series import check_series, encode_series

if TYPE_CHECKING:
    pass


@click.command("encode", cls=Grouped, short_help="Encode the isocontour of a picture, terrain or volume.")
@click.argument("source", metavar="INPUT", type=click.Path(path_type=Path, readable=False))
@encode_options
def encode_command(
    source: Path,
    output: Path,
    isovalues: tuple[float, ...],
    interval: float | None,
    offset: float | None,
    labels: tuple[float, ...],
    independent: bool,
    exact: bool,
    tolerance: str | None,
    steps: str | None,
    preserve_topology: bool,
    criterion: str | None,
    plan: Path | None,
    signs_only: bool,
    step: float | None,
    base_level: int | None,
    profile: str,
    metadata: tuple[str, ...],
    spacing: str | None,
    missing: str | None,
    nodata: float | None,
    no_placement: bool,
    coordinates_error: float | None,
    periodic: tuple[int, ...],
    period: str | None,
    key: str | None,
    channel: int | None,
    frame: int | None,
    frames: bool,
    frame_axis: int | None,
    frame_interval: int | None,
    kind: str | None,
    limit_samples: int | None,
    follow: bool,
    values_name: str | None,
    mesh: str | None,
    mesh_error: float | None,
    as_json: bool,
) -> None:
    """Encode the isocontour (2-D) or isosurface (3-D) of the field in INPUT.

    INPUT is .npy, .npz, HDF5, NetCDF, Zarr, GRIB, PNG, JPEG, TIFF (a stack is a volume), NIfTI, NRRD, MetaImage, DICOM
    (a folder of slices, or a file) or .vti; - for standard input, or a URL. With --values it is a mesh of triangles or
    tetrahedra: .vtu, .msh, .ply, .xdmf, or .npz with points and cells; or it holds scattered points, which are joined
    to triangles: .csv, .xyz, .las, .laz, .gpkg.
    """
    if values_name is not None:
        from .on_mesh import encode_on_mesh

        check_iso_output(output, source)
        on_mesh = {
            "mesh": mesh, "mesh_error": mesh_error, "exact": exact, "step": step, "tolerance": tolerance,
            "signs_only": signs_only, "leaning": not independent, "interval": frame_interval or 0,
            "metadata": read_metadata(metadata),
        }
        encode_on_mesh(source, output, values_name, isovalues, limit_samples, on_mesh, as_json)
        return
    if mesh is not None or mesh_error is not None:
        raise click.UsageError("--mesh and --mesh-error are for meshes: name the values at its points by --values")
    asked = bool(isovalues) + (interval is not None) + bool(labels)
    if asked > 1 or (asked == 0 and plan is None):
        raise click.UsageError("give exactly one of --isovalue, --interval and --label")
    if len(labels) > 1:
        from .labelled import encode_labelled

        check_iso_output(output, source)
        encode_labelled(source, output, click.get_current_context().params)
        return
    label = labels[0] if labels else None
    check_interval(interval, offset)
    name, parameter = read_criterion(criterion)
    notes = read_metadata(metadata)
    check_series(frames, frame_axis, frame_interval)
    if spacing is not None and no_placement:
        raise click.UsageError("--spacing and --no-placement contradict one another: choose one")
    if label is not None and missing is not None:
        raise click.UsageError("--label and --missing contradict one another: a missing sample has another label")
    steps_along = read_numbers("--spacing", spacing)
    periods = read_numbers("--period", period)
    distances = read_steps(steps)

    from ..stream.options import PRECISIONS, Options, conflict

    if chosen := conflict([name for name, value in click.get_current_context().params.items() if _is_given(value)]):
        names = " and ".join("--" + option.replace("_", "-") for option in chosen)
        raise click.UsageError(f"{names} contradict one another: choose one")
    planned = None if plan is None else Planned.read(plan)
    options = Options(
        exact=exact, tolerance=read_tolerance(tolerance), signs_only=signs_only, step=step, base_level=base_level,
        preserve_topology=preserve_topology, steps=distances, criterion=name, parameter=parameter,
        leaning=not independent, plan=None if planned is None else planned.plan, profile=profile, metadata=notes,
    )
    check_iso_output(output, source)

    import isocodec

    from ..field.placement import CRS, FRAME_STEP, PLACEMENT, Placement, matrix_of
    from ..field.samples import without_holes
    from ..io.readers.opened import Choice
    from ..io.readers.registry import open_file
    from ..io.readers.slices import one_slice

    placed = steps_along is None and not no_placement and PLACEMENT not in notes
    with concerning(source), local_input(source, kind, limit_samples) as path, ExitStack() as held:
        with one_warning(source):
            opened = open_file(path, Choice(key, channel), samples=limit_samples, follow=follow, label="")
            held.enter_context(opened)
            if frames:
                found = opened.frames(frame_axis, frame, placed=placed)
            else:
                field = opened.values(frame)
                found = one_slice(field, opened.place(field.ndim, frame) if placed else Placement())
            nodata_given = nodata is not None
            if nodata is None and label is None:
                nodata = opened.nodata
        place, prepared = found.place, Prepared(found, nodata, label)
        shape = prepared.shape
        if steps_along is not None and len(steps_along) != len(shape):
            raise click.UsageError(f"--spacing {spacing}: give one number for each of the {len(shape)} axes")
        if label is not None:
            isovalues = (0.5,)
            notes.setdefault("label", f"{label:g}")
            if plan is None and not any(_is_given(getattr(options, precision)) for precision in PRECISIONS):
                options = replace(options, signs_only=True)
        elif interval is not None:
            with progress_bar("reading") as progress:
                isovalues = multiples(interval, *prepared.range(progress), offset)
        if planned is not None:
            isovalues = planned.isovalues(isovalues, shape, not independent)
        prepared.fill = None if missing == "hole" else missing
        where = place
        if steps_along is not None:
            where = Placement(matrix_of(steps_along, len(shape)))
        if place.remark:
            warn(source, place.remark)
        if options.tolerance is None and tolerance is not None:
            values, gone = without_holes(*prepared.samples(0, isovalues))
            if where.coordinates is not None and periods is not None:
                where = replace(where, periods=tuple(periods))
            options = replace(options, tolerance=where.cells_of(tolerance, values.shape, gone))
        placement = world_of(source, shape, where, options, coordinates_error, periodic, periods)
        if place.crs is not None:
            notes.setdefault(CRS, place.crs)
        if found.step:
            notes.setdefault(FRAME_STEP, found.step)
        options = replace(options, metadata=notes, placement=placement)
        valued = exact or step is not None
        prepared.tied = "" if options.signs_only else "biuf" if preserve_topology or valued else "biu"
        started = time.perf_counter()
        about_plan = nullcontext() if planned is None else planned.blamed()
        with progress_bar("encoding") as progress, about_plan:
            if frames:
                data = encode_series(prepared, frame_interval or 0, isovalues, vars(options), progress)
            else:
                ((values, hole),) = prepared.each(isovalues)
                data = isocodec.encode(
                    values, isovalues[0] if len(isovalues) == 1 else isovalues, mask=hole, progress=progress,
                    **vars(options),
                )
        seconds = time.perf_counter() - started
    write_output(output, data)
    if not prepared.missing and label is None and (missing is not None or nodata_given):
        warn(source, "no samples are missing; --nodata sets the value that marks them")
    prepared.warn(source, isovalues, valued, preserve_topology)
    layers = len(isocodec.inspect(data).layers)
    tell(
        f"{click.format_filename(output)}: {len(data):,} bytes, {layers} layers, {seconds:.2f} s",
        {
            "output": str(output),
            "bytes": len(data),
            "layers": layers,
            "seconds": round(seconds, 3),
            "shape": list(found.shape if frames else shape),
            "dtype": str(prepared.dtype),
            "missing": prepared.holes,
            "isovalues": [float(isovalue) for isovalue in isovalues],
        },
        as_json,
    )


def _is_given(value: object) -> bool:
    """Whether an option was given on the command line: a flag, or a value."""
    return value is not None and value is not False

