"""The bench of a planned flight: looked at, changed, and planned again behind the page."""

from __future__ import annotations

import json
import re
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from aerotri.bench.flight_plan import RECORD, FlightRecord, flight_content, read_flight
from aerotri.bench.flight_request import changed_request, texts_of
from aerotri.bench.job import Jobs
from aerotri.conventions import InputError, real_path

OF_BENCH, OF_PLAN, PLAN = "_bench", "_plan", "plan_"
NUMBERS = (
    ("photographs", "", 1.0, 0, ("flight", "photographs")),
    ("strips", "", 1.0, 0, ("flight", "strips")),
    ("length of the flight", "km", 1e-3, 2, ("flight", "length_m")),
    ("time in the air", "min", 1 / 60, 1, ("flight", "time_s")),
    ("smallest GSD", "cm", 100.0, 2, ("flight", "gsd_m", 0)),
    ("largest GSD", "cm", 100.0, 2, ("flight", "gsd_m", 1)),
    ("forward overlap, at least", "%", 100.0, 0, ("flight", "forward_overlap")),
    ("side overlap, at least", "%", 100.0, 0, ("flight", "side_overlap")),
    ("photographs of a place, at least", "", 1.0, 0, ("flight", "least_rays")),
    ("expected error in plan", "cm", 100.0, 2, ("accuracy", "rmse_h_m")),
    ("expected error in height", "cm", 100.0, 2, ("accuracy", "rmse_v_m")),
    ("σ of Z on 95 % of the area", "cm", 100.0, 2, ("accuracy", "sigma_z_95_m")),
    ("part of it that neighbours share", "cm", 100.0, 2, ("accuracy", "shared_z_95_m")),
    ("σ of the volume over the area", "m³", 1.0, 2, ("accuracy", "sigma_volume_m3")),
)
"""Of the table: words, unit, factor, digits, and where it stands in plan.json."""


def is_plan(path: Path) -> bool:
    """Whether a folder is that of a plan."""
    return (path / RECORD).is_file()


class FlightBench:
    """What the page of a plan asks for; every method may be called from any thread.

    Parameters
    ----------
    folder : that `aerotri plan` wrote, or one of those the bench has made of it. It is never written to.

    Raises
    ------
    InputError
        When it is damaged.
    """

    def __init__(self, folder: Path):
        self.given = real_path(folder)
        is_own = self.given.parent.name.endswith(OF_BENCH)
        self.bench = (
            self.given.parent if is_own else self.given.with_name(self.given.name.removesuffix(OF_PLAN) + OF_BENCH)
        )
        self._lock = threading.RLock()
        self._jobs = Jobs("a plan is being made already")
        self._before: FlightRecord | None = None
        self.generation = 0
        self.show(self.given)

    def show(self, folder: Path) -> None:
        """Take up a plan; the one before is what it is compared with."""
        found = read_flight(folder)
        with self._lock:
            self._before = self.record if self.generation else None
            self.record = found
            self.generation += 1

    def summary(self) -> dict[str, Any]:
        """The head of the page, its fields, the plans that are there, and the numbers of this one and that before."""
        c = self.record.outcome
        return {
            "name": c.get("area", {}).get("name", ""), "camera": c.get("camera", {}).get("name", ""),
            "crs": c.get("crs", ""), "target": c.get("target"), "warnings": c.get("warnings", []),
            "piles": c.get("piles", []), "fields": texts_of(self.record.request),
            "can_plan": bool(self.record.request), "plans": [one.name for one in self.plans()],
            "shown": self.record.folder.name, "folder": str(self.record.folder),
            "before": None if self._before is None else self._before.folder.name,
            "numbers": self._numbers(), "generation": self.generation,
        }  # fmt: skip

    def content(self) -> dict[str, Any]:
        """See `flight_content`."""
        return flight_content(self.record)

    def state(self) -> dict[str, Any]:
        """What goes on: asked for every second."""
        return {"generation": self.generation, "job": self._jobs.state()}

    def plans(self) -> list[Path]:
        """The plan that was given, and those of the bench, the oldest first."""
        own = [one for one in self.bench.glob(f"{PLAN}*") if is_plan(one)] if self.bench.is_dir() else []
        own.sort(key=_number)
        return own if self.given in own else [self.given, *own]

    def choose(self, name: str) -> dict[str, Any]:
        """Show another plan.

        Raises
        ------
        InputError
            When there is none of that name.
        """
        found = next((one for one in self.plans() if one.name == name), None)
        if found is None:
            raise InputError(f"there is no plan '{name[:60]}'", "load the page again")
        self.show(found)
        return self.state()

    def again(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """Plan with other values, behind the page; the plan that is shown stays.

        Raises
        ------
        InputError
            When a value is not possible, the folder does not say how it was planned, or planning is going on.
        """
        with self._lock:
            self._jobs.refuse_second()
            if not self.record.request:
                raise InputError("the folder does not say how it was planned", "run aerotri plan again")
            request = changed_request(self.record.request, given)
            self.bench.mkdir(exist_ok=True)
            out = self.bench / f"{PLAN}{1 + max((_number(one) for one in self.bench.glob(PLAN + '*')), default=0):03d}"
            words = [json.dumps(request), str(out)]
            self._jobs.start("aerotri.bench.flight_worker", words, out, self.show)
        return self.state()

    def stop(self) -> dict[str, Any]:
        """Stop the planning that is going on."""
        self._jobs.stop()
        return self.state()

    def wait(self) -> None:
        """Wait until the planning has ended."""
        self._jobs.wait()

    def _numbers(self) -> list[dict[str, Any]]:
        rows = [
            {"what": words, "unit": unit, "digits": digits, "now": _value(self.record, factor, place),
             "before": _value(self._before, factor, place)}
            for words, unit, factor, digits, place in NUMBERS
        ]  # fmt: skip
        counts = [None if one is None else len(one.outcome.get("control", [])) for one in (self.record, self._before)]
        return [*rows, {"what": "control points", "unit": "", "digits": 0, "now": counts[0], "before": counts[1]}]


def _value(record: FlightRecord | None, factor: float, place: tuple[Any, ...]) -> float | None:
    """A number of plan.json; None where it is not there."""
    value: Any = None if record is None else record.outcome
    for step in place:
        try:
            value = value[step]
        except (KeyError, IndexError, TypeError):
            return None
    return factor * value if isinstance(value, int | float) else None


def _number(folder: Path) -> int:
    match = re.fullmatch(rf"{PLAN}(\d+)", folder.name)
    return int(match[1]) if match else 0
