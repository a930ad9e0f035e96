"""What stands at the head of every page and file of a result: whose it is, when and by what it was computed."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

from aerotri.conventions import whole_number
from aerotri.coordinates.crs_names import crs_names
from aerotri.observations.project import Project
from aerotri.version import __version__

LONGEST_TIME = 11
"""Digits of seconds since 1970, up to the year 5138; with one more, dates have no name."""
CLOCK = "SOURCE_DATE_EPOCH"
"""Seconds since 1970 that stand for now: the variable by which builds are repeated bit for bit."""


def now() -> datetime:
    """The time, to the second; that of `SOURCE_DATE_EPOCH` where it is set."""
    stated = whole_number(os.environ.get(CLOCK, ""), digits=LONGEST_TIME)
    return datetime.now(UTC).replace(microsecond=0) if stated is None else datetime.fromtimestamp(stated, UTC)


@dataclass(frozen=True)
class Head:
    """The head of a result.

    Parameters
    ----------
    project : what `[project]` of block.toml says.
    crs : coordinate system: 'local', 'EPSG:n' or 'EPSG:n+m'; '' where none is stated.
    computed : when. version : of aerotri that computed it.
    """

    project: Project = field(default_factory=Project)
    crs: str = ""
    computed: datetime = field(default_factory=now)
    version: str = __version__

    def as_dict(self) -> dict[str, Any]:
        """What the JSON file of every result begins with."""
        names = crs_names(self.crs)
        return {
            "aerotri": self.version, "computed": time_text(self.computed), "project": self.project.as_dict(),
            "crs": self.crs, "crs_name": names.name, "height_system": names.vertical,
        }  # fmt: skip


def time_text(moment: datetime) -> str:
    """'2026-05-04T12:30:00Z'."""
    return moment.astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def time_of(text: object) -> datetime | None:
    """The time that `time_text` wrote; None where it is none."""
    try:
        return datetime.strptime(str(text), "%Y-%m-%dT%H:%M:%SZ").replace(tzinfo=UTC)
    except ValueError:
        return None
