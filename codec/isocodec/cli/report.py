"""Output and end of a command: results, warnings, progress, one line for an error, an exit code."""

from __future__ import annotations

import io
import os
import sys
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..api.output import undoing
from ..errors import (
    FormatError,
    InputError,
    IsoError,
    KernelError,
    LimitError,
    MissingExtraError,
    OptionError,
    TruncatedError,
    one_line,
    plain,
)

if TYPE_CHECKING:
    from ..api.export import Exported

EXIT_CODES = """\b
Exit codes:
  0  done
  1  internal error
  2  wrong usage: unknown or invalid options, or options that cannot be combined
  3  the input cannot be read or encoded, or the output cannot be written
  4  not a valid .iso file
  5  the .iso file is truncated
  6  a limit is exceeded (memory, work, samples, vertices, layers or isovalues)
  7  an optional library is missing
  8  the compiled kernels cannot be loaded, or are of another version
  9  verify: the file does not keep a guaranteed distance, or has wrong signs
  130, 143, 129  interrupted (SIGINT), terminated (SIGTERM, SIGHUP); nothing is left behind
Set ISOCODEC_DEBUG=1 in the environment to see tracebacks."""

PARTIAL = "use --partial to decode as much as there is"
"""Remedy of the command line for a truncated file."""
STANDARD = "-"
"""Name of standard input and standard output."""
BROKEN = 9
INTERRUPTED = 130  # as shells have it: 128 + SIGINT
PATIENCE = 1.0
"""Seconds after which a progress bar appears: shorter work is done before anyone reads a bar."""
_SHOWN = 3
"""Largest number of library messages that a warning lists."""
_KEPT = 1 << 16
"""Largest number of bytes of a library's output that are examined."""


class Failure(Exception):
    """An error together with the file that it is about."""

    def __init__(self, path: str | os.PathLike[str], cause: IsoError | OSError) -> None:
        super().__init__(path, cause)
        self.path = path
        self.cause = cause


@contextmanager
def concerning(path: str | os.PathLike[str]) -> Iterator[None]:
    """Attribute errors raised within to ``path``, except those about this installation."""
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
    started = time.perf_counter()

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Resolve a command as click does, and remember its name for errors that are raised while options are read."""
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
        if args is not None:  # of a program that has begun before
            Program.started = time.perf_counter()
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
    """Print one line about an error; return the exit code."""
    if isinstance(exc, click.Abort):
        if isinstance(exc.__cause__, KeyboardInterrupt) or isinstance(exc.__context__, KeyboardInterrupt):
            say("interrupted")
            return INTERRUPTED
        exc = exc.__cause__ if isinstance(exc.__cause__, Exception) else exc
    if os.environ.get("ISOCODEC_DEBUG", "0") not in ("", "0"):
        import traceback

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
        if str(cause).startswith(where):
            where = ""  # the library names the file, too
        damaged = (isinstance(cause, FormatError) and not isinstance(cause, TruncatedError)
                   and cause.code not in ("tiled", "signature"))
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
    """Print text on the error stream as a single line, even if it contains line breaks or control characters."""
    click.echo("isocodec: " + plain(" ".join(text.split())), err=True)


def warn(path: str | os.PathLike[str], text: str) -> None:
    """Print a warning about a file; the command continues."""
    say(f"{click.format_filename(path)}: warning: {text}")


def result(text: str, record: dict[str, Any], as_json: bool) -> None:
    """Print the result of a command: a line for people, or an object for programs.

    On standard output, or on the error stream if the file that was written went there.
    """
    away = record.get("output") == STANDARD
    if as_json:
        import json

        text = json.dumps(record, allow_nan=False)
    click.echo(text if as_json else plain(text, "\n"), err=away)


@contextmanager
def progress_bar(label: str) -> Iterator[Callable[[int, int], None] | None]:
    """Yield a function ``(done, total)`` to report progress with, or None if the error stream is not a terminal.

    The bar appears after a second, and disappears when the work is done. A total of 0 means unknown, as in a search.
    """
    if not sys.stderr.isatty():
        yield None
        return
    started = time.monotonic()
    terminal = _terminal()
    bar: Any = None
    task: Any = None

    def report(done: int, total: int) -> None:
        nonlocal bar, task
        if bar is None:
            if time.monotonic() - started < PATIENCE:
                return
            from rich.console import Console
            from rich.progress import Progress

            bar = Progress(console=Console(file=terminal), transient=True)
            task = bar.add_task(label, total=None)
            bar.start()
        if total:
            bar.update(task, description=label, completed=done, total=total)
        else:
            bar.update(task, description=f"searching ({done} tried)")

    def clear() -> None:
        # bypasses rich, whose locks may be held when a signal arrives: clear the line, show the cursor
        if bar is not None:
            os.write(terminal.fileno() if terminal is not sys.stderr else 2, b"\r\x1b[2K\x1b[?25h")

    try:
        with undoing(clear):
            yield report
    finally:
        if bar is not None:
            bar.stop()
        if terminal is not sys.stderr:
            terminal.close()


def _terminal() -> Any:
    """The error stream, kept open for a bar while a library writes, when both streams of the process lead elsewhere."""
    try:
        number = os.dup(sys.stderr.fileno())
    except (AttributeError, OSError):  # it is none of the process
        return sys.stderr
    return os.fdopen(number, "w", encoding=sys.stderr.encoding, errors="backslashreplace")


@contextmanager
def own_warnings(path: str | os.PathLike[str]) -> Iterator[None]:
    """Print warnings of this library as warnings about ``path``; if an error is raised, they are dropped."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        yield
    for text in dict.fromkeys(str(one.message) for one in caught):
        warn(path, text)


@contextmanager
def one_warning(path: str | os.PathLike[str], doing: str = "reading") -> Iterator[None]:
    """Collect the output of third-party libraries into one warning about ``path``, dropped if an error is raised.

    Must not enclose code that prints on purpose: both output streams of the process are redirected.
    """
    noted: list[str] = []
    printed = io.StringIO()
    raw: list[str] = []
    with (
        _logged(noted), warnings.catch_warnings(record=True) as caught, redirect_stdout(printed),
        redirect_stderr(printed), _streams(raw),
    ):
        warnings.simplefilter("always")
        yield
    texts = [*(str(one.message) for one in caught), *noted, *printed.getvalue().splitlines(), *raw]
    lines = [*dict.fromkeys(line for text in texts if (line := one_line(text)))]
    if lines:
        more = f", and {len(lines) - _SHOWN} more" if len(lines) > _SHOWN else ""
        warn(path, f"messages while {doing}: {'; '.join(lines[:_SHOWN])}{more}")


@contextmanager
def _logged(texts: list[str]) -> Iterator[None]:
    """Collect what libraries log; one that is loaded meanwhile logs to the error stream, which is collected, too."""
    logging = sys.modules.get("logging")
    if logging is None:
        yield
        return

    class Notes(logging.Handler):  # type: ignore[name-defined]
        def emit(self, record: Any) -> None:
            texts.append(record.getMessage())

    loggers = [logging.getLogger(name) for name in [*logging.root.manager.loggerDict]]
    handlers = [(logger, logger.handlers) for logger in (logging.root, *loggers)]
    for logger, _ in handlers:
        logger.handlers = []
    logging.root.handlers = [Notes(logging.WARNING)]
    try:
        yield
    finally:
        for logger, before in handlers:
            logger.handlers = before


@contextmanager
def _streams(lines: list[str]) -> Iterator[None]:
    """Collect lines that C and C++ libraries print, bypassing Python."""
    from tempfile import TemporaryFile

    with TemporaryFile() as file:
        saved: dict[int, int] = {}

        def back() -> None:
            for number, before in saved.items():
                os.dup2(before, number)

        for stream in (sys.__stdout__, sys.__stderr__):
            if stream is not None and not stream.closed:
                stream.flush()
        try:
            # if a signal ends the process, its line must reach the real streams
            with undoing(back):
                for number in (1, 2):
                    try:
                        saved[number] = os.dup(number)
                    except OSError:  # a process may have been started without them
                        continue
                    os.dup2(file.fileno(), number)
                yield
        finally:
            back()
            for before in saved.values():
                os.close(before)
        file.seek(0)
        lines += file.read(_KEPT).decode(errors="replace").splitlines()


@contextmanager
def written_to(output: Path, source: str) -> Iterator[Any]:
    """Yield where to write a result: a path, or a buffer that goes to standard output once complete.

    Output of libraries becomes one warning. Errors of formats are attributed to the output, others to the source.
    """
    whole = io.BytesIO()
    try:
        with concerning(output), one_warning(output, "writing"):
            yield whole if str(output) == STANDARD else output
    except Failure as failure:
        if isinstance(failure.cause, OSError | OptionError | MissingExtraError):
            raise
        raise Failure(source, failure.cause) from failure.cause
    if str(output) == STANDARD:
        write_output(output, whole.getvalue())


def written_out(made: Exported, output: Path, source: str) -> int:
    """Write what was decoded or drawn, with a progress bar and its remarks as warnings; returns the bytes."""
    with progress_bar("writing") as progress, written_to(output, source) as target:
        size = made.write(target, progress)
    for remark in made.remarks:
        warn(source, remark)
    return size


def write_output(output: Path, data: bytes) -> None:
    """Write a result to a file, completely or not at all, or to standard output."""
    from ..api.output import write_bytes

    with concerning(output):
        if str(output) == STANDARD:
            sys.stdout.buffer.write(data)
            sys.stdout.buffer.flush()
        else:
            write_bytes(output, data)


def table(headings: Mapping[str, str], rows: Sequence[Sequence[str]], title: str | None = None) -> str:
    """Format a table: columns two spaces apart, under a rule; cells may have several lines.

    Headings map the names of columns to ``"left"`` or ``"right"``.
    """
    columns = zip(headings, *rows, strict=True)
    width = [max(len(line) for cell in column for line in cell.split("\n")) for column in columns]
    sides = [str.rjust if side == "right" else str.ljust for side in headings.values()]

    def lines(cells: Iterable[str]) -> Iterator[str]:
        for parts in zip_longest(*(cell.split("\n") for cell in cells), fillvalue=""):
            placed = (side(part, most) for part, side, most in zip(parts, sides, width, strict=True))
            yield "  ".join(placed).rstrip()

    rule = "  ".join("-" * most for most in width)
    shown = [*lines(headings), rule, *(line for row in rows for line in lines(row))]
    return "\n".join(([title] if title else []) + shown)


def named(output: str | os.PathLike[str]) -> str:
    """Format the name of a file for a result."""
    return click.format_filename(output)


def counted(number: int, noun: str) -> str:
    """Format a number with its noun: ``1 layer``, ``2 layers``."""
    return f"{number:,} {noun}{'s' * (number != 1)}"
