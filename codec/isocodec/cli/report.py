"""How a command ends: one line on the error stream, and an exit code that says whose fault it was."""

from __future__ import annotations

import io
import json
import os
import re
import sys
import traceback
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import Any, BinaryIO

import click

from ..errors import FormatError, InputError, IsoError, KernelError, LimitError, OptionError, TruncatedError, plain

EXIT_CODES = """\b
Exit codes:
  0  done
  1  internal error
  2  wrong usage: options that are unknown, invalid or contradict one another
  3  the input cannot be read or encoded, or the output cannot be written
  4  not a valid .iso file
  5  the .iso file is truncated
  6  a limit is exceeded (memory, work, samples, vertices, layers or isovalues)
  7  an optional library is missing
  8  the compiled kernels cannot be loaded, or are of another version
  9  verify: the file does not keep what it promises
  130, 143, 129  interrupted (SIGINT), terminated (SIGTERM, SIGHUP); nothing is left behind
Set ISOCODEC_DEBUG=1 in the environment to see tracebacks."""

PARTIAL = "use --partial to decode what there is"
"""Remedy of the command line for a truncated file."""
STANDARD = "-"
"""Name of standard input and standard output."""
_URL = re.compile(r"([A-Za-z][A-Za-z0-9+.-]+):/{1,2}")
_PIECE = 1 << 20
BROKEN = 9
INTERRUPTED = 130  # as shells have it: 128 + SIGINT


class Failure(Exception):
    """An error together with the file that it is about."""

    def __init__(self, path: str | os.PathLike[str], cause: IsoError | OSError) -> None:
        super().__init__(path, cause)
        self.path = path
        self.cause = cause


@contextmanager
def concerning(path: str | os.PathLike[str]) -> Iterator[None]:
    """Whatever goes wrong within is reported as being about ``path``, but for what is wrong with this installation."""
    try:
        yield
    except KernelError:
        raise
    except (IsoError, OSError) as exc:
        raise Failure(path, exc) from exc
    except MemoryError as exc:
        raise Failure(path, LimitError("not enough memory", code="memory")) from exc


class Program(click.Group):
    """A group of commands that never ends in a traceback."""

    verb = ""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """As click; what fails while options are read does not know which command they belong to."""
        resolved = super().resolve_command(ctx, args)
        self.verb = resolved[0] or ""
        return resolved

    def main(
        self,
        args: Sequence[str] | None = None,
        prog_name: str | None = "isocodec",
        complete_var: str | None = None,
        standalone_mode: bool = True,
        **extra: Any,
    ) -> Any:
        if isinstance(sys.stdout, io.TextIOWrapper):
            # A name that the terminal's encoding lacks must not end the command.
            sys.stdout.reconfigure(errors="backslashreplace")
        self.verb = ""
        if not standalone_mode:
            return super().main(args, prog_name, complete_var, standalone_mode=False, **extra)
        try:
            result = super().main(args, prog_name, complete_var, standalone_mode=False, **extra)
            # Without the standalone mode, click hands back the code that --help and the like end with.
            code = result if isinstance(result, int) else 0
        except Exception as exc:
            code = _report(exc, self.verb)
        sys.exit(code)


def _report(exc: Exception, verb: str) -> int:
    """Print what there is to say about ``exc``; returns the exit code."""
    if isinstance(exc, click.Abort):
        if isinstance(exc.__cause__, KeyboardInterrupt) or isinstance(exc.__context__, KeyboardInterrupt):
            say("interrupted")
            return INTERRUPTED
        exc = exc.__cause__ if isinstance(exc.__cause__, Exception) else exc
    if os.environ.get("ISOCODEC_DEBUG", "0") not in ("", "0"):
        click.echo(plain("".join(traceback.format_exception(exc)), "\n"), err=True, nl=False)
    if isinstance(exc, click.UsageError):
        # Without arguments click raises the whole help as an error.
        if isinstance(exc, getattr(click.exceptions, "NoArgsIsHelpError", ())):
            exc.show()
        else:
            command = exc.ctx.command_path if exc.ctx is not None else f"isocodec {verb}".rstrip()
            say(f"{exc.format_message().rstrip('.')}: see '{command} --help'")
        return OptionError.exit_code
    path, cause = (exc.path, exc.cause) if isinstance(exc, Failure) else (None, exc)
    where = "" if path is None else f"{click.format_filename(path)}: "
    if isinstance(cause, IsoError):
        damaged = isinstance(cause, FormatError) and not isinstance(cause, TruncatedError) and cause.code != "tiled"
        say(f"{where}{'not a valid .iso file: ' if damaged else ''}{cause}")
        return cause.exit_code
    if isinstance(cause, OSError):
        if path is None and cause.filename is not None:
            where = f"{click.format_filename(cause.filename)}: "
        say(f"{where}{cause.strerror or cause}")
        return InputError.exit_code
    if isinstance(cause, MemoryError):
        say("not enough memory")
        return LimitError.exit_code
    if isinstance(cause, click.ClickException):
        say(cause.format_message())
        return cause.exit_code
    say(f"internal error: {type(cause).__name__}: {cause}: set ISOCODEC_DEBUG=1 to see where")
    return IsoError.exit_code


def say(text: str) -> None:
    """One line on the error stream, whatever a file name or a library's message brings along."""
    click.echo("isocodec: " + plain(" ".join(text.split())), err=True)


def warn(path: str | os.PathLike[str], text: str) -> None:
    """A line about a file, where the command goes on."""
    say(f"{click.format_filename(path)}: warning: {text}")


def tell(text: str, record: dict[str, Any], as_json: bool) -> None:
    """The result of a command: a line for people, or an object for programs.

    On standard output, or on the error stream if the file that was written went there.
    """
    away = record.get("output") == STANDARD
    click.echo(json.dumps(record, allow_nan=False) if as_json else plain(text, "\n"), err=away)


def read_iso(path: Path) -> bytes:
    """The bytes of an .iso file, which may come through a pipe; of anything else, which may never end, the first."""
    from isospec.container import SIGNATURE

    from ..limits import Limits

    with concerning(path), _opened(path) as file:
        pieces = [file.read(len(SIGNATURE))]
        most = Limits().bytes - len(SIGNATURE)
        while pieces[0] == SIGNATURE and most >= 0 and (piece := file.read(_PIECE)):
            pieces.append(piece)
            most -= len(piece)
        if most < 0:
            raise LimitError(f"more than {Limits().bytes:,} bytes", code="limit-bytes", clause="11.2")
        data = b"".join(pieces)
        if not data:
            raise TruncatedError("the file is empty", code="truncated", offset=0, clause="3.3")
        return data


def _opened(path: Path) -> AbstractContextManager[BinaryIO]:
    """A file, standard input (``-``), or what a URL names."""
    if str(path) == STANDARD:
        return nullcontext(sys.stdin.buffer)
    if url := url_of(path):
        from ..storage.content import opened

        return opened(url)
    return path.open("rb")


def url_of(path: str | os.PathLike[str]) -> str | None:
    """The URL that an argument is, of which a path has lost a slash; None if it is the name of a file."""
    found = _URL.match(str(path))
    if found is None or os.path.exists(path):
        return None
    host = "/" if found[1].lower() == "file" else ""
    return f"{found[1]}://{host}{str(path)[found.end() :]}"


def check_output(output: Path, source: Path) -> None:
    """Find out before the work that ``output`` can be written, and is not the input.

    Raises
    ------
    Failure
        With an OSError, or an OptionError if both are one file.
    """
    from ..storage.atomic import check_target

    with concerning(output):
        if str(output) == STANDARD:
            return
        check_target(output)
        if output.exists() and source.exists() and output.samefile(source):
            raise OptionError("the output is the input file itself", code="same-file", remedy="choose another name")


def check_iso_output(output: Path, source: Path) -> None:
    """The same of an .iso file, which does not go under the name of another format.

    Raises
    ------
    Failure
    """
    from ..io.readers.read import FIELD_SUFFIXES
    from ..io.writers.registry import SUFFIXES

    check_output(output, source)
    with concerning(output):
        suffix = next((s for s in (*SUFFIXES, *FIELD_SUFFIXES) if output.name.lower().endswith(s)), None)
        if suffix is not None:
            raise OptionError(
                f"the output is an .iso file, not {suffix}", code="suffix", remedy="choose a name that ends in .iso"
            )


def write_output(output: Path, data: bytes) -> None:
    """Write the result, whole or not at all; on standard output as it is."""
    from ..storage.atomic import write_bytes

    with concerning(output):
        if str(output) == STANDARD:
            sys.stdout.buffer.write(data)
            sys.stdout.buffer.flush()
        else:
            write_bytes(output, data)
