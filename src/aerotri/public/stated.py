"""Adjustments as users state them: a result, or the folder of one."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from aerotri.conventions import FilePath, real_path
from aerotri.public.adjustment import Adjustment
from aerotri.public.results import open_result

if TYPE_CHECKING:
    from aerotri.results.adjustment import Adjustment as Record


@dataclass(frozen=True, eq=False)
class StatedAdjustment:
    """An adjustment as the user states it, opened when it is needed.

    Parameters
    ----------
    source : a result, or its folder.
    """

    source: Adjustment | FilePath

    @cached_property
    def record(self) -> Record:
        """The adjustment with its equations.

        Raises
        ------
        InputError
            When the folder is no result, or the adjustment has not converged.
        """
        return (self.source if isinstance(self.source, Adjustment) else open_result(self.source)).record

    @property
    def name(self) -> str:
        """That of the folder, else of the block."""
        if isinstance(self.source, Adjustment):
            return str(self.source.block.name) if self.source.folder is None else self.source.folder.name
        return Path(self.source).name

    @property
    def crs(self) -> str | None:
        """The plan CRS of its block, None where it is local or cannot be read."""
        import tomllib

        from aerotri.rasters.grids import horizontal_crs

        if isinstance(self.source, Adjustment):
            return horizontal_crs(self.source.block.crs)
        try:
            content = tomllib.loads((Path(self.source) / "block" / "block.toml").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        return horizontal_crs(str(content.get("crs", "local")))

    @property
    def doubt(self) -> str:
        """A sentence when the adjustment of a folder is not simply accepted, '' else; of a result the user knows."""
        outcome = self.record.result.outcome
        if isinstance(self.source, Adjustment) or outcome.verdict == "accepted":
            return ""
        return f"{self.source}: the adjustment is {outcome.verdict}: {outcome.reasons[0]}"

    @property
    def missing(self) -> str:
        """A sentence when σ lacks what the adjustment could not look for, '' else."""
        from aerotri.statistics.camera_field import missing_in_sigma

        return missing_in_sigma(self.record)

    def is_same(self, other: StatedAdjustment | None) -> bool:
        """Whether both are one folder, or one result."""
        if other is None or isinstance(self.source, Adjustment) or isinstance(other.source, Adjustment):
            return other is not None and self.source is other.source
        return real_path(Path(self.source)) == real_path(Path(other.source))
