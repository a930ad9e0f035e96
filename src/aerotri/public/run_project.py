"""What a run made: the results of its steps, and where everything was written."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from datetime import datetime
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aerotri.public.run_steps import (
    REPORT,
    Step,
)
from aerotri.results.head import Head, now

if TYPE_CHECKING:
    from aerotri.observations import Block
    from aerotri.public.accuracy import Accuracy
    from aerotri.public.adjustment import Adjustment
    from aerotri.public.dense import DenseSurface
    from aerotri.public.ortho import Orthophoto
    from aerotri.public.terrain import TerrainModel
    from aerotri.public.tying import TiedPhotographs
    from aerotri.public.volume_result import MeasuredVolume


@dataclass(eq=False, repr=False)
class Project:
    """What `aerotri.run` made: the results of its steps, None for those that were left out or failed.

    Parameters
    ----------
    folder : where everything was written.
    source : what it began with.
    steps : each with how it ended.
    tied : the photographs tied. adjustment : also where it was rejected. surface : the terrain. volume : over it.
    dense_volume : over the dense surface.
    dense : the surface of all that stands on the ground. orthophoto : over it.
    accuracy : by the check points, None without them.
    seconds : that it took. computed : when it began.
    unmarked : control points that are marked in no photograph, where the run stopped for them.
    """

    folder: Path
    source: Path
    steps: list[Step] = field(default_factory=list)
    tied: TiedPhotographs | None = None
    adjustment: Adjustment | None = None
    surface: TerrainModel | None = None
    volume: MeasuredVolume | None = None
    dense: DenseSurface | None = None
    dense_volume: MeasuredVolume | None = None
    orthophoto: Orthophoto | None = None
    accuracy: Accuracy | None = None
    seconds: float = 0.0
    computed: datetime = field(default_factory=now)
    unmarked: tuple[str, ...] = ()

    @property
    def block(self) -> Block | None:
        """The block as it was adjusted; that of the tie points where it was not."""
        if self.adjustment is not None:
            return self.adjustment.block
        return None if self.tied is None else self.tied.block

    @property
    def verdict(self) -> str:
        """'accepted', 'doubtful' or 'rejected' by the adjustment; 'failed' where there is none."""
        return "failed" if self.adjustment is None else self.adjustment.verdict

    @property
    def complete(self) -> bool:
        """Whether no step failed."""
        return not any(step.status == "failed" for step in self.steps)

    @property
    def report(self) -> Path:
        """The page about all steps."""
        return self.folder / REPORT

    @property
    def head(self) -> Head:
        """Of page and file: the block's."""
        block = self.block
        return Head(computed=self.computed) if block is None else Head(block.project, block.crs, self.computed)

    @property
    def summary(self) -> dict[str, Any]:
        """The content of run.json."""
        return {**self.head.as_dict(), "source": str(self.source), "steps": [asdict(step) for step in self.steps],
                "seconds": round(self.seconds, 1), "report": str(self.report)}  # fmt: skip

    def __repr__(self) -> str:
        done = ", ".join(f"{step.what.lower()} {step.status}" for step in self.steps)
        return f"<aerotri.Project in '{self.folder}': {self.verdict}; {done}>"

    def _repr_html_(self) -> str:
        """The steps, and what the adjustment found, as a notebook shows them."""
        rows = "".join(
            f"<tr><td>{escape(step.what)}</td><td>{escape(step.status)}</td><td>{step.seconds:.0f} s</td>"
            f"<td>{escape(step.reason or str(self.folder / step.folder))}</td></tr>"
            for step in self.steps
        )
        made = (self.adjustment, self.surface, self.volume, self.dense, self.orthophoto, self.dense_volume)
        shown = [one.html() for one in made if one is not None]
        return f"<div><table><caption>{escape(self.verdict)}</caption>{rows}</table>{''.join(shown)}</div>"
