"""The very first run of a fresh installation: kernels are compiled ahead in other processes.

A command compiles what it needs from first to last; these processes begin with what many kernels call, and go on at the
end of the list of what the command will need. Whoever has compiled a kernel leaves it in the cache, where the others
find it (`kernel_cache`). A kernel that nobody has compiled when it is needed is compiled there and then: a list that is
out of date costs time, not results.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import threading
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

from aerotri.compiled import compiled_ahead
from aerotri.compiled_records import RecordType
from aerotri.execution.elsewhere import WORKER_VARIABLES
from aerotri.execution.threads import thread_count

LISTED = Path(__file__).with_name("first_run.json")
"""Kernels that `aerotri adjust` has compiled, in this order: [kernel, numbers of the types of its arguments]; a kernel
that others call stands before the first of them. And the types, each made of earlier ones.
`tools/benchmark/benchmark_first_run.py --record` writes it."""
MOST_PROCESSES = 3
"""Beside the command itself; chosen [C]: each takes some 300 MB, and the longest kernel ends no sooner with more."""


def compile_ahead() -> int:
    """Start processes that compile ahead, one for every further thread; how many.

    None are started where the kernels are in the cache, where nothing can be kept, or for a single thread. The
    processes end when they are done, or when this one ends.
    """
    count = min(thread_count() - 1, MOST_PROCESSES)
    if count < 1 or not _is_first_run():
        return 0
    folder = tempfile.TemporaryDirectory(prefix="aerotri_first_run_", ignore_cleanup_errors=True)
    _held.append(folder)
    line = [sys.executable, "-m", __name__, folder.name, str(LISTED)]
    for _ in range(count):
        with suppress(OSError):
            # the line to their input, never written to, closes with this process however it ends
            _held.append(
                subprocess.Popen(
                    line,
                    stdin=subprocess.PIPE,
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL,
                    env={**os.environ, **WORKER_VARIABLES},
                )
            )
    compiled_ahead()
    return count


def listed_kernels(path: Path) -> list[tuple[str, tuple[Any, ...]]]:
    """Names of kernels, 'module:function', and the numba types of their arguments."""
    content = json.loads(path.read_text(encoding="utf-8"))
    types: list[Any] = []
    for stated in content["types"]:
        types.append(_type_of(stated, types))
    return [(name, tuple(types[k] for k in arguments)) for name, arguments in content["kernels"]]


def as_listed(kernels: list[tuple[str, tuple[Any, ...]]]) -> str:
    """Such a list as the text of its file.

    Raises
    ------
    TypeError
        For an argument that is no scalar, array, tuple or named tuple of these.
    """
    types: dict[str, int] = {}
    rows = [[name, [_number(one, types) for one in arguments]] for name, arguments in kernels]
    text = ",\n  ".join(types)
    return f'{{"types": [\n  {text}\n],\n"kernels": [\n  ' + ",\n  ".join(json.dumps(row) for row in rows) + "\n]}\n"


def _number(one: Any, types: dict[str, int]) -> int:
    """Number of a type in the list, where it is put behind those that it is made of."""
    from numba import types as nb

    if isinstance(one, RecordType):
        name = f"{one.of.__module__}:{one.of.__qualname__}"
        stated: list[Any] = ["record", name, *(_number(part, types) for part in one.parts)]
    elif isinstance(one, nb.Array):
        stated = ["array", str(one.dtype), one.ndim, one.layout, not one.mutable, one.aligned]
    elif isinstance(one, nb.BaseTuple):
        parts: Any = one
        of: Any = getattr(one, "instance_class", None)
        name = f"{of.__module__}:{of.__qualname__}" if of else ""
        stated = ["tuple", name, *(_number(part, types) for part in parts)]
    elif isinstance(one, nb.IntegerLiteral):
        stated = ["literal", one.literal_value]
    elif isinstance(one, nb.Number | nb.Boolean):
        stated = ["scalar", str(one)]
    else:
        raise TypeError(f"an argument of type {one} cannot be listed")
    return types.setdefault(json.dumps(stated), len(types))


def _type_of(stated: list[Any], types: list[Any]) -> Any:
    from numba import types as nb

    kind, *rest = stated
    if kind == "array":
        dtype, ndim, layout, readonly, aligned = rest
        return nb.Array(getattr(nb, dtype), ndim, layout, readonly=readonly, aligned=aligned)
    if kind == "record":
        name, *parts = rest
        return RecordType(_found(name), tuple(types[k] for k in parts))
    if kind == "tuple":
        name, *parts = rest
        return nb.BaseTuple.from_types([types[k] for k in parts], _found(name) if name else None)
    return nb.literal(rest[0]) if kind == "literal" else getattr(nb, rest[0])


def _found(name: str) -> Any:
    module, _, attribute = name.partition(":")
    return getattr(import_module(module), attribute)


def _is_first_run() -> bool:
    """Whether the first kernel of the list is to be compiled and can be kept."""
    name = json.loads(LISTED.read_text(encoding="utf-8"))["kernels"][0][0]
    # without compilation (NUMBA_DISABLE_JIT) it is a function, and has no statistics
    place = getattr(getattr(_found(name), "stats", None), "cache_path", None)
    return place is not None and not any(Path(place).glob(f"*.{name.partition(':')[2]}-*.nbi"))


def _compile_from_the_end(folder: Path, listed: Path) -> None:
    """Kernels that no other process has begun: those that most others call, then the last one first."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    kernels = [(_found(name), arguments) for name, arguments in listed_kernels(listed)]
    callers = [sum(_calls(other, kernel) for other, _ in kernels) for kernel, _ in kernels]
    order = sorted(range(len(kernels)), key=lambda k: (-callers[k], -k))
    for k in order:
        try:
            (folder / str(k)).touch(exist_ok=False)
        except FileExistsError:
            continue
        kernels[k][0].compile(kernels[k][1])


def _calls(kernel: Any, other: Any) -> bool:
    """Whether a kernel has the other one in its own text."""
    function = kernel.py_func
    return any(function.__globals__.get(name) is other for name in function.__code__.co_names)


def _end_with_parent() -> None:
    sys.stdin.read()
    os._exit(0)


_held: list[Any] = []

if __name__ == "__main__":
    _compile_from_the_end(Path(sys.argv[1]), Path(sys.argv[2]))
