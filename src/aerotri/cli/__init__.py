"""The command lines: thin, each a few lines around the package; heavy imports only where they are used."""

from __future__ import annotations

import atexit
import contextlib
import errno
import io
import os
import sys
import warnings
from typing import Any

from aerotri.cli import interruption

if interruption.is_program():
    interruption.while_importing()

import typer

from aerotri.cli import (
    adjusting,
    blocks,
    change,
    converting,
    explaining,
    exporting,
    image_errors,
    ortho,
    planning,
    run,
    terrain,
    viewing,
    volumes,
)
from aerotri.cli.app import app
from aerotri.conventions import InputError
from aerotri.execution.work import NO_SPACE, TasksFailedError

__all__ = [
    "adjusting", "app", "blocks", "change", "converting", "explaining", "exporting", "image_errors", "main", "ortho",
    "planning", "run", "terrain", "viewing", "volumes",
]  # fmt: skip

FAILED, BAD_INPUT, BUG = 1, 2, 3
"""Exit status for work without a result, for input that cannot be used, the same as typer's for a bad command line, and
for an error of the program itself."""
OUT_OF_MEMORY = ("failed to map segment", "annot allocate memory", "cannot create shared object descriptor")
"""What the loader of glibc says of a library for which there is no room."""
UsageError: Any = next(kind for kind in typer.BadParameter.__mro__ if kind.__name__ == "ClickException")
"""What typer raises for a command line that cannot be read; where the class stands depends on its version."""


def main() -> None:
    """Entry point.

    Exit codes: 0 done, 1 the adjustment or a task failed, 2 bad input, 3 an error of this program, 130 and 143
    interrupted.
    """
    interruption.while_running()
    _speak_any_encoding()
    _warn_in_lines()
    try:
        code = _ended()
    except KeyboardInterrupt:
        # a second signal, or one that came between the two lines
        code = _told(interruption.message(), interruption.exit_code())
    interruption.afterwards()
    lost = _lost_output()
    if lost is not None:
        code = _told(_about_lost(lost), code or BAD_INPUT)
    _leave(code)


def _speak_any_encoding() -> None:
    """Letters that the encoding of the output lacks (σ, × in a log of Windows) become question marks, not errors."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")


def _warn_in_lines() -> None:
    warnings.formatwarning = _as_line


def _as_line(
    message: Warning | str, category: type[Warning], filename: str, lineno: int, line: str | None = None
) -> str:
    """What is meant for the user without the place in the code."""
    if category is UserWarning:
        return f"aerotri: {message}\n"
    return f"{filename}:{lineno}: {category.__name__}: {message}\n"


def _leave(code: int) -> None:
    """End the process when Python has done its part, and do not wait for the C++ part of Arrow to be taken down.

    A thread of Arrow that has hardly begun, after a short command on a busy machine, aborts the process there, and the
    exit code would be that of a crash (seen once in sixty runs; apache/arrow issue 34314, open).
    """
    if "pyarrow" not in sys.modules:
        raise SystemExit(code)
    atexit._run_exitfuncs()  # pyright: ignore[reportPrivateUsage]
    with contextlib.suppress(OSError, ValueError):
        if sys.stderr is not None:
            sys.stderr.flush()
    os._exit(code)


def _ended() -> int:
    """Run the command line; its exit code, when what went wrong is told."""
    try:
        ended = app(standalone_mode=False)
        if interruption.was_interrupted():
            # typer makes an exit code of the exception
            return _told(interruption.message(), interruption.exit_code())
        return ended if isinstance(ended, int) else 0
    except (KeyboardInterrupt, typer.Abort):
        return _told(interruption.message(), interruption.exit_code())
    except UsageError as error:
        error.show()
        return error.exit_code
    except InputError as error:
        return _told(f"aerotri: {error}", BAD_INPUT)
    except TasksFailedError as error:
        if os.environ.get("AEROTRI_DEBUG"):
            raise
        return _told(f"aerotri: {error}", FAILED)
    except BrokenPipeError:
        # whoever read our outcome has read enough; it stands in the files
        _forget_output()
        return 0
    except Exception as error:
        if interruption.was_interrupted():
            return _told(interruption.message(), interruption.exit_code())
        return _unexpected(error)


def _unexpected(error: Exception) -> int:
    """Tell an error that is no InputError: what the machine lacks, or what is wrong with this program."""
    if os.environ.get("AEROTRI_DEBUG"):
        raise error
    if isinstance(error, MemoryError):
        text = f": {error}" if str(error) else ""
        return _told(f"aerotri: not enough memory{text} — give less at a time, or use a larger machine", BAD_INPUT)
    library = _about_library(error)
    if library:
        return _told(library, BAD_INPUT)
    if isinstance(error, OSError) and not error.filename and error.errno in (*NO_SPACE, errno.EIO):
        lost = _lost_output(tried=True)
        if lost is not None:
            return _told(_about_lost(lost), BAD_INPUT)
    if isinstance(error, OSError) and error.errno in NO_SPACE:
        from aerotri.formats.files.places import full_disk

        return _told(f"aerotri: {full_disk(error.filename, error)}", BAD_INPUT)
    if isinstance(error, FileNotFoundError) and not error.filename:
        from aerotri.formats.files.places import is_current_folder_gone, not_written

        if is_current_folder_gone():
            return _told(f"aerotri: {not_written(None, error)}", BAD_INPUT)
    if isinstance(error, FileNotFoundError) and "temporary directory" in str(error):
        # of tempfile, when none of its folders takes a file
        remedy = "free some space on their disk, or let TMPDIR name another folder"
        return _told(f"aerotri: {error.strerror}: nothing can be written there — {remedy}", BAD_INPUT)
    said = " ".join(str(error).split())[:500]
    text = f"aerotri: unexpected {type(error).__name__}: {said} — please report it; AEROTRI_DEBUG=1 tells where"
    return _told(text, BUG)


def _told(text: str, code: int) -> int:
    """Print a line to stderr, whoever reads it; the code."""
    with contextlib.suppress(OSError, ValueError):
        # with stderr closed, print writes nowhere
        print(text, file=sys.stderr, flush=True)
    return code


def _about_library(error: Exception) -> str:
    """The line on a library that could not be loaded, '' where the error is another one or a module of ours."""
    said, chain = " ".join(str(error).split())[:300], list[BaseException]()
    link: BaseException | None = error
    while link is not None and link not in chain:
        chain.append(link)
        link = link.__cause__ or link.__context__
    is_library = isinstance(error, ImportError) or "shared object" in said
    if not is_library or str(getattr(error, "name", "") or "").startswith("aerotri"):
        return ""
    if any(text in str(one) or isinstance(one, MemoryError) for one in chain for text in OUT_OF_MEMORY):
        remedy = "close other programs, raise the limit of memory (ulimit -v), or use a larger machine"
        return f"aerotri: not enough memory to load a library: {said} — {remedy}"
    return f"aerotri: a library could not be loaded: {said} — install aerotri again into a new environment"


def _lost_output(tried: bool = False) -> OSError | None:
    """Why what was printed could not be written, None where all is well or nobody reads it; the rest goes nowhere.

    Parameters
    ----------
    tried : whether writing somewhere has failed; an end of line tells then whether it was here, as what Python does not
        keep back (PYTHONUNBUFFERED) is gone.
    """
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
            if tried:
                os.write(sys.stdout.fileno(), b"\n")
    except (OSError, ValueError) as error:
        _forget_output()
        if isinstance(error, OSError) and not isinstance(error, (BrokenPipeError, ValueError)):
            return error
    return None


def _about_lost(error: OSError) -> str:
    remedy = "free some space, or let the output go elsewhere"
    return f"aerotri: what is printed cannot be written: {error.strerror} — {remedy}"


def _forget_output() -> None:
    """What is still to be written to stdout goes nowhere, so that the end of the program does not fail by it."""
    with contextlib.suppress(OSError, ValueError):
        if sys.stdout is not None:
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
