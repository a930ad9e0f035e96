"""Functions and records of a script, for workers that were not started by it.

A process that this one starts knows the script as its main module. A worker that was started by hand does not: it reads
the script from its file, under a name of its own, so that what begins under `if __name__ == "__main__":` is not done.
"""

from __future__ import annotations

import hashlib
import io
import pickle
import socket
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from threading import RLock
from typing import Any

from aerotri.conventions import InputError, real_path

MAIN, OURS = "__main__", "aerotri."
"""Names of the module that a script is where it runs, and of what every worker has."""
_lock = RLock()


@dataclass(frozen=True)
class Script:
    """A script that runs.

    Parameters
    ----------
    path : of its file. mark : of its content: a script that was changed is another one.
    """

    path: Path
    mark: str

    @property
    def module(self) -> str:
        """Name of the module that a worker makes of it."""
        return f"_script_{self.path.stem}_{self.mark}"


def script_of(pickled: Sequence[bytes], function: Any) -> Script | None:
    """The script that runs here, where tasks may need it; else None.

    Parameters
    ----------
    pickled : what tasks share, and tasks. function : that does them: of the script, or of a module beside it.
    """
    main: Any = sys.modules[MAIN]
    file = getattr(main, "__file__", None)
    is_ours = str(getattr(function, "__module__", OURS)).startswith(OURS)
    named = any(MAIN.encode() in content for content in pickled)
    if (is_ours and not named) or file is None or not Path(file).is_file():
        return None
    path = real_path(Path(file))
    script = Script(path, _mark_of(path))
    # a record that a worker sends back is one of the module that it made
    sys.modules[script.module] = main
    return script


def unpickled(content: bytes, script: Script | None) -> Any:
    """What was pickled, also where it speaks of what a script defines.

    Raises
    ------
    InputError
        When this process does not see the script, or sees another one.
    """
    return pickle.loads(content) if script is None else _Unpickler(content, script).load()


class _Unpickler(pickle.Unpickler):
    def __init__(self, content: bytes, script: Script):
        super().__init__(io.BytesIO(content))
        self._script = script
        # modules that lie beside the script, behind everything that is installed
        folder = str(script.path.parent)
        if folder not in sys.path:
            sys.path.append(folder)

    def find_class(self, module_name: str, global_name: str, /) -> Any:
        if module_name == MAIN and not _is_main(self._script):
            _load(self._script)
            module_name = self._script.module
        return super().find_class(module_name, global_name)


def _is_main(script: Script) -> bool:
    file = getattr(sys.modules[MAIN], "__file__", None)
    return file is not None and real_path(Path(file)) == script.path


def _load(script: Script) -> None:
    """Read the script once."""
    with _lock:
        if script.module in sys.modules:
            return
        _refuse_another(script)
        spec = spec_from_file_location(script.module, script.path)
        assert spec is not None
        assert spec.loader is not None
        module = module_from_spec(spec)
        sys.modules[script.module] = module
        try:
            spec.loader.exec_module(module)
        except BaseException:
            del sys.modules[script.module]
            raise


def _refuse_another(script: Script) -> None:
    worker = f"the worker on {socket.gethostname()}"
    remedy = "put it where all machines have it under the same name"
    try:
        mark = _mark_of(script.path)
    except OSError as error:
        raise InputError(f"{worker} does not see the script {script.path}", remedy) from error
    if mark != script.mark:
        raise InputError(f"{worker} has another script in the place of {script.path}", remedy)


def _mark_of(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16]
