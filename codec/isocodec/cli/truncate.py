"""``isocodec truncate``: a shorter file of the same curve."""

from __future__ import annotations

from pathlib import Path

import click

from .options import iso_argument, json_option, limit_options, limits_of, output_option
from .report import check_iso_output, concerning, read_iso, tell, warn, write_output


@click.command("truncate", short_help="Cut a file to fewer layers or bytes; the result is a valid file.")
@iso_argument
@output_option("OUT.iso")
@click.option("--layers", type=click.IntRange(min=1), metavar="N", help="Keep the first N layers, of all isovalues.")
@click.option("--bytes", "max_bytes", type=click.IntRange(min=1), metavar="N", help="Keep at most N bytes.")
@limit_options
@json_option
def truncate_command(
    source: Path, output: Path, layers: int | None, max_bytes: int | None, limit_memory: int | None,
    limit_work: int | None, as_json: bool,
) -> None:
    """Cut IN.iso to its first layers, or to a number of bytes; OUT.iso is complete in itself.

    Of a file in tiles, or of its URL, the bytes of the first layers are copied.
    """
    if (layers is None) == (max_bytes is None):
        raise click.UsageError("give exactly one of --layers and --bytes")
    check_iso_output(output, source)
    from .tiled import tiled_file, truncate_tiled

    if (tiled := tiled_file(source, limits_of(limit_memory, limit_work))) is not None:
        if layers is None:
            raise click.UsageError("a file in tiles is cut by --layers")
        return truncate_tiled(tiled, source, output, layers, as_json)
    data = read_iso(source)

    import isocodec

    with concerning(source):
        limits = limits_of(limit_memory, limit_work)
        cut = isocodec.truncate(data, layers=layers, max_bytes=max_bytes, limits=limits)
        short = isocodec.inspect(cut, symbols=True, limits=limits)
        kept = sum(layer.bytes is not None for layer in short.layers)
        lost = isocodec.inspect(data).isovalues[len(short.isovalues) :]
    write_output(output, cut)
    if lost:
        warn(source, f"the result ends before isovalue {' and '.join(map(repr, lost))}")
    tell(
        f"{click.format_filename(output)}: {len(cut):,} of {len(data):,} bytes, {kept} whole layers",
        {"output": str(output), "bytes": len(cut), "input_bytes": len(data), "layers": kept},
        as_json,
    )
