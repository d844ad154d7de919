"""``isocodec transcode`` and ``isocodec merge``: files made of files, without the field."""

from __future__ import annotations

from pathlib import Path

import click

from ..stream.names import ProfileName
from .options import iso_argument, json_option, limit_options, limits_of, output_option
from .report import check_iso_output, concerning, read_iso, tell, write_output

_PROFILE = click.Choice(["main", "baseline"])


@click.command("transcode", short_help="Encode a file's curves again, in another profile or less precisely.")
@iso_argument
@output_option("OUT.iso")
@click.option("--profile", type=_PROFILE, help="Profile of OUT.iso.  [default: that of IN.iso]")
@click.option("--tolerance", type=float, metavar="D", help="Largest distance from the curves of IN.iso, in cells.")
@click.option("--signs-only", is_flag=True, help="Keep only which samples are inside.")
@click.option("--preserve-topology", is_flag=True, help="Keep the topology of the curves in every layer.")
@limit_options
@json_option
def transcode_command(
    source: Path, output: Path, profile: ProfileName | None, tolerance: float | None, signs_only: bool,
    preserve_topology: bool, limit_memory: int | None, limit_work: int | None, as_json: bool,
) -> None:
    """Encode the curves or surfaces of IN.iso again; without --tolerance and --signs-only no point moves.

    IN.iso must hold the full grid. Files made with a criterion, or with a (last) tolerance of 0.1 or more, may not.
    What is promised of OUT.iso is about the curves of IN.iso: their own distance from those of the field comes on top.
    """
    if tolerance is not None and signs_only:
        raise click.UsageError("--tolerance and --signs-only contradict one another: choose one")
    check_iso_output(output, source)
    data = read_iso(source)

    import isocodec

    with concerning(source):
        made = isocodec.transcode(
            data, profile=profile, tolerance=tolerance, signs_only=signs_only, preserve_topology=preserve_topology,
            limits=limits_of(limit_memory, limit_work),
        )
    write_output(output, made)
    tell(
        f"{click.format_filename(output)}: {len(made):,} bytes of {len(data):,}",
        {"output": str(output), "bytes": len(made), "input_bytes": len(data)},
        as_json,
    )


@click.command("merge", short_help="Put the isovalues of several files of one field into one file.")
@click.argument("sources", metavar="IN.iso ...", nargs=-1, required=True,
                type=click.Path(path_type=Path, readable=False))
@output_option("OUT.iso")
@click.option("--profile", type=_PROFILE, default="main", show_default=True, help="Profile of OUT.iso.")
@limit_options
@json_option
def merge_command(
    sources: tuple[Path, ...], output: Path, profile: ProfileName, limit_memory: int | None, limit_work: int | None,
    as_json: bool,
) -> None:
    """Put the isovalues of all IN.iso, files of one field, into OUT.iso; no point moves.

    They must hold the full grid, as those of transcode.
    """
    for source in sources:
        check_iso_output(output, source)
    files = [read_iso(source) for source in sources]

    import isocodec

    with concerning(sources[0]):
        made = isocodec.merge(files, profile=profile, limits=limits_of(limit_memory, limit_work))
    write_output(output, made)
    count, before = len(isocodec.inspect(made).isovalues), sum(map(len, files))
    tell(
        f"{click.format_filename(output)}: {len(made):,} bytes of {before:,}, {count} isovalues",
        {"output": str(output), "bytes": len(made), "input_bytes": before, "isovalues": count},
        as_json,
    )
