"""Where a bench finds its block and its result, and where it keeps what is decided and adjusted on it."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import dataclass
from pathlib import Path

from aerotri.bench.records import RECORD
from aerotri.conventions import InputError, real_path
from aerotri.formats.files.atomic import atomic_folder

RUN = "run.json"
BLOCK, RESULT, OF_BENCH, OF_RESULT = "block", "result_", "_bench", "_result"
REMEDY = "give the folder of a block, or the folder that `aerotri adjust` or `aerotri plan` wrote"


@dataclass(frozen=True)
class Places:
    """The folders of a bench.

    Parameters
    ----------
    block : that is edited. result : shown, None where nothing was adjusted yet.
    bench : where new results go; made when it is needed. given : the block of a result, copied before it is edited.
    """

    block: Path
    result: Path | None
    bench: Path
    given: Path | None = None

    def next_result(self) -> Path:
        """The folder of the next adjustment."""
        return self.bench / f"{RESULT}{1 + max((_number(one) for one in _results(self.bench)), default=0):03d}"

    def keep_block(self) -> None:
        """Copy the block of a result, once, so that the result stays what it was.

        Raises
        ------
        InputError
            When the folder cannot be written.
        """
        if self.given is None or self.block.is_dir():
            return
        with atomic_folder(self.block) as folder:
            shutil.copytree(self.given, folder, dirs_exist_ok=True)

    @property
    def readable_block(self) -> Path:
        """The block as it is now: that of the result before anything was edited."""
        return self.block if self.given is None or self.block.is_dir() else self.given


def places_of(path: Path) -> Places:
    """The folders of the bench of a result or a block.

    Raises
    ------
    InputError
        When it is neither.
    """
    folder = real_path(path.parent if path.name == "block.toml" else path)
    if (folder / RECORD).is_file():
        bench = folder.with_name(folder.name.removesuffix(OF_RESULT) + OF_BENCH)
        if folder.parent.name.endswith(OF_BENCH):
            # one of the bench's own results
            bench = folder.parent
        found = Places(bench / BLOCK, folder, bench, folder / BLOCK)
        if (bench / BLOCK).is_dir() and folder.parent != bench:
            return Places(bench / BLOCK, _last(bench) or folder, bench, folder / BLOCK)
        return found
    if (folder / "block.toml").is_file():
        bench = folder.with_name(folder.name + OF_BENCH)
        beside = folder.with_name(folder.name + OF_RESULT)
        return Places(folder, _last(bench) or (beside if (beside / RECORD).is_file() else None), bench)
    raise InputError("holds neither a result nor a block", REMEDY, path)


def photographs_beside(path: Path) -> Path | None:
    """The photographs of the project of `aerotri run` that a block or a result belongs to; None where it has none."""
    record = real_path(path).parent / RUN
    if not record.is_file():
        return None
    try:
        content = json.loads(record.read_text(encoding="utf-8"))
    except (ValueError, RecursionError, OSError):
        return None
    source = content.get("source") if isinstance(content, dict) else None
    if not isinstance(source, str) or not Path(source).is_dir() or (Path(source) / "block.toml").is_file():
        return None
    return Path(source)


def _results(bench: Path) -> list[Path]:
    """Results of a bench, the oldest first."""
    found = bench.glob(f"{RESULT}*") if bench.is_dir() else ()
    return sorted((one for one in found if (one / RECORD).is_file() and _number(one)), key=_number)


def _last(bench: Path) -> Path | None:
    found = _results(bench)
    return found[-1] if found else None


def _number(folder: Path) -> int:
    match = re.fullmatch(rf"{RESULT}(\d+)", folder.name)
    return int(match[1]) if match else 0
