"""``isocodec encode``: a field in, an .iso file out."""

from __future__ import annotations

import time
from pathlib import Path

import click

from .options import json_option, output_option
from .progress import load_kernels, progress_bar
from .report import check_output, concerning, tell, warn, write_output


@click.command("encode", short_help="Encode the isocontour of a picture, terrain or volume.")
@click.argument("source", metavar="INPUT", type=click.Path(path_type=Path))
@output_option("OUT.iso")
@click.option("--isovalue", type=float, required=True, metavar="V", help="Where the contour lies: value > V is inside.")
@click.option("--exact", is_flag=True, help="All values along the contour, to the last bit (integer data).")
@click.option("--tolerance", type=float, metavar="D", help="Largest distance to the extracted contour, in cells.")
@click.option("--signs-only", is_flag=True, help="Only on which side the samples are: no positions within a cell.")
@click.option("--step", type=float, metavar="S", help="Values along the contour in steps of S (float data).")
@click.option("--base-level", type=int, metavar="L", help="Level of the coarsest mesh, where the file begins.")
@click.option("--profile", default="baseline", show_default=True, metavar="NAME", help="Entropy coding profile.")
@click.option("--key", metavar="NAME", help="Which array of an .npz file.")
@click.option("--channel", type=int, metavar="N", help="Which channel of a colour picture, counted from 0.")
@json_option
def encode_command(
    source: Path,
    output: Path,
    isovalue: float,
    exact: bool,
    tolerance: float | None,
    signs_only: bool,
    step: float | None,
    base_level: int | None,
    profile: str,
    key: str | None,
    channel: int | None,
    as_json: bool,
) -> None:
    """Encode the isocontour (2-D) or isosurface (3-D) of the field in INPUT.

    INPUT is .npy, .npz, a PNG, JPEG or TIFF picture (a TIFF stack is a volume), or NIfTI. At most one of --exact,
    --tolerance, --signs-only and --step says how precisely the contour is kept.
    """
    given = {"--exact": exact, "--tolerance": tolerance is not None, "--signs-only": signs_only}
    given["--step"] = step is not None
    chosen = [name for name, is_given in given.items() if is_given]
    if len(chosen) > 1:
        raise click.UsageError(f"{' and '.join(chosen)} contradict one another: choose one")
    check_output(output, source)

    import isocodec

    from ..io.read import read_field

    with concerning(source):
        field = read_field(source, key=key, channel=channel)
        load_kernels()
        started = time.perf_counter()
        with progress_bar("encoding") as progress:
            data = isocodec.encode(
                field,
                isovalue,
                exact=exact,
                tolerance=tolerance,
                signs_only=signs_only,
                step=step,
                base_level=base_level,
                profile=profile,
                progress=progress,
            )
        seconds = time.perf_counter() - started
    write_output(output, data)
    low, high = field.min(), field.max()
    if not low <= isovalue < high:
        warn(source, f"the isovalue {isovalue:g} lies outside the data ({low:g} to {high:g}): the curve is empty")
    layers = len(isocodec.inspect(data).layers)
    tell(
        f"{click.format_filename(output)}: {len(data):,} bytes, {layers} layers, {seconds:.2f} s",
        {
            "output": str(output),
            "bytes": len(data),
            "layers": layers,
            "seconds": round(seconds, 3),
            "shape": list(field.shape),
            "dtype": str(field.dtype),
            "isovalue": isovalue,
        },
        as_json,
    )
