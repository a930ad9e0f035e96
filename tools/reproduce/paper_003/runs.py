"""Adjustments of simulated blocks and what the paper asks of each."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from copy import deepcopy
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import aerotri
from aerotri import parameters as patterns
from paper_003.cases import Case

BYTES_OF_SEED = 2_000_000_000
"""Memory of a run of the largest block; chosen [C]."""
Plan = dict[str, Any]
"""The tables of simulation.toml."""


@dataclass(frozen=True, eq=False)
class Run:
    """One adjustment of one simulated block.

    Parameters
    ----------
    photographs, points, rays, control, check : counts.
    sigma0_um, pixel_um, gsd_m : σ̂0, pixel, ground sampling distance.
    square : (3,) m², mean squared differences at check points. expected : (3,) m², what σ of both sides say.
    averaged, field : over the format of the first camera; the field less what orientation takes.
    shape : share 0–1 of the averaged residuals that the camera's own patterns explain, NaN where it has none.
    error_left_um : RMS of a coordinate of estimated − true image error, less what orientation takes.
    estimated, significant : additional parameters, and those with t > 1.96.
    t80 : of the DMC's parameter 80, NaN without.
    """

    photographs: int
    points: int
    rays: int
    control: int
    check: int
    sigma0_um: float
    pixel_um: float
    gsd_m: float
    square: np.ndarray
    expected: np.ndarray
    averaged: Any
    field: Any
    shape: float
    error_left_um: float
    estimated: int
    significant: int
    t80: float


def read_plan(path: Path) -> Plan:
    """The tables of simulation.toml."""
    return tomllib.loads(path.read_text(encoding="utf-8"))


def changed(plan: Plan, tables: Mapping[str, Mapping]) -> Plan:
    """The plan with keys of some tables replaced; 'camera.NAME.errors.physical' as a dotted name."""
    data = deepcopy(plan)
    for name, keys in tables.items():
        place = data
        for part in name.split("."):
            place = place.setdefault(part, {})
        place.update(keys)
    return data


def adjusted(block: aerotri.Block, parameters: str, groups: str = "camera") -> aerotri.Adjustment:
    """The block adjusted with a set of parameters."""
    return aerotri.adjust(aerotri.with_settings(block, parameters=parameters, parameter_groups=groups), explain=False)


def measured(found: aerotri.Adjustment, truth, special: str) -> Run:
    """The numbers of an adjustment."""
    result, block, camera = found.adjusted, found.block, found.block.cameras[0]
    p = result.parameters
    control_sigma = block.control.sigma[[list(block.control.point).index(k) for k in result.check.point]]
    averaged = found.averaged_residuals(camera.name)
    ours = (p.kinds == "additional") & np.isin(p.status, ("estimated", "weighted"))
    t80 = p.t[ours & (p.names == "dmc.80")]
    above_ground = float(np.median(truth.centre[:, 2]) - np.median(truth.points[:, 2]))
    return Run(
        len(block.images), len(block.points), len(block.image_points), len(result.control), len(result.check),
        result.outcome.sigma0_um, camera.pixel_um, above_ground * camera.pixel_mm / camera.focal_length_mm,
        np.mean(result.check.difference**2, axis=0), np.mean(result.check.sigma**2 + control_sigma**2, axis=0),
        averaged, found.image_errors(camera.name, without_orientation=True).field, shape_share(averaged, special),
        error_left(found, truth), int(ours.sum()), int(np.sum(p.t[ours] > 1.96)),
        float(t80[0]) if len(t80) else float("nan"),
    )  # fmt: skip


def shape_share(averaged, special: str) -> float:
    """How much of Σ n·|mean|² the patterns of a camera's own parameters explain, fitted with n as weights."""
    if not special:
        return float("nan")
    shown = averaged.shown
    _, basis = patterns.patterns(special, averaged.camera, np.column_stack([averaged.x[shown], averaged.y[shown]]))
    weight = np.repeat(np.sqrt(averaged.count[shown]), 2)
    values = weight * averaged.mean[shown].ravel()
    design = weight[:, None] * basis.reshape(len(weight), -1)
    left = values - design @ np.linalg.lstsq(design, values, rcond=None)[0]
    return 1.0 - float(left @ left / (values @ values))


def error_left(found: aerotri.Adjustment, truth) -> float:
    """µm, RMS of a coordinate of estimated − true image error over the format, less the six patterns of orientation."""
    camera, sample = found.block.cameras[0], truth.image_errors[0]
    six = patterns.orientation_patterns(sample.xy, camera.focal_length_mm).reshape(-1, 6)
    left = (found.image_errors_at(sample.xy, camera.name) - sample.d).ravel()
    left = left - six @ np.linalg.lstsq(six, left, rcond=None)[0]
    return 1e3 * float(np.sqrt(np.mean(left**2)))


@dataclass(frozen=True, eq=False)
class Row:
    """A set of a case over several seeds: its runs, the first of them drawn, and the true image error of that one."""

    heading: str
    runs: tuple[Run, ...]
    true_field: Any

    @property
    def first(self) -> Run:
        return self.runs[0]

    @property
    def rms(self) -> np.ndarray:
        """(3,) m at check points."""
        return np.sqrt(np.mean([run.square for run in self.runs], axis=0))

    @property
    def expected(self) -> np.ndarray:
        """(3,) m, what the σ say."""
        return np.sqrt(np.mean([run.expected for run in self.runs], axis=0))

    @property
    def horizontal_m(self) -> float:
        """RMS of a coordinate in plan, √((X² + Y²)/2), the paper's."""
        return float(np.sqrt(np.mean(self.rms[:2] ** 2)))

    def mean(self, name: str) -> float:
        """Of a number of the runs."""
        return float(np.mean([getattr(run, name) for run in self.runs]))

    @property
    def averaged_um(self) -> float:
        """RMS length of the averaged residuals."""
        return 1e3 * float(np.mean([run.averaged.rms for run in self.runs]))

    @property
    def noise_um(self) -> float:
        """RMS length that noise alone would leave in them."""
        return 1e3 * float(np.mean([run.averaged.rms_of_noise for run in self.runs]))


def of_seed(shared: tuple[Case, Plan], seed: int) -> tuple[Any, list[Run]]:
    """The true image errors of a simulation, and every set of its case."""
    case, plan = shared
    flight = aerotri.simulate(plan, seed)
    found = [measured(adjusted(flight.block, spec), flight.truth, case.special) for _, spec in case.sets]
    return flight.true_image_errors().field, found


def rows_of(case: Case, plan: Plan, seeds: Iterable[int], runs: Any) -> list[Row]:
    """Every set of a case over the seeds, which `runs` computes."""
    true, found = zip(*runs(of_seed, (case, plan), seeds, BYTES_OF_SEED), strict=True)
    sets = zip(*found, strict=True)
    return [Row(heading, own, true[0]) for (heading, _), own in zip(case.sets, sets, strict=True)]


def of_camera(shared: tuple[Case, Plan], seed: int) -> list[tuple[float, float]]:
    """Plan and height, m, of every set for a camera drawn anew."""
    case, plan = shared
    other = changed(plan, {f"camera.{next(iter(plan['camera']))}.errors.physical": {"seed": seed}})
    true, found = of_seed((case, other), 1)
    rows = [Row(heading, (run,), true) for (heading, _), run in zip(case.sets, found, strict=True)]
    return [(row.horizontal_m, float(row.rms[2])) for row in rows]


def over_cameras(case: Case, plan: Plan, cameras: int, runs: Any) -> np.ndarray:
    """(cameras, sets, 2) m, plan (of a coordinate) and height at check points, for cameras drawn anew."""
    return np.array(runs(of_camera, (case, plan), range(101, 101 + cameras), BYTES_OF_SEED))


@dataclass(frozen=True, eq=False)
class Days:
    """Two days of one camera: the test of no change, and the fields of both days and their difference."""

    change_um: float
    change: Any
    fields: tuple[Any, Any]


def two_days(case: Case, plan: Plan, change_um: float) -> Days:
    """The block with parameters of its own for each day, the camera having changed by so much between them."""
    name = next(iter(plan["camera"]))
    other = changed(plan, {f"camera.{name}.errors.physical": {"day_change_um": change_um}})
    result = adjusted(aerotri.simulate(other, 1).block, case.sets[3][1], "day")
    one, two = (result.image_errors(day, without_orientation=True).field for day in ("1", "2"))
    return Days(change_um, result.change_between("1", "2"), (one, two))


def of_days(shared: tuple[Case, Plan], seed: int) -> Any:
    """The test of no change between two days of one simulation."""
    case, flown = shared
    return adjusted(aerotri.simulate(flown, seed).block, case.sets[3][1], "day").change_between("1", "2")


def days_over_seeds(case: Case, plan: Plan, seeds: Iterable[int], runs: Any) -> list:
    """The test of no change between two days of a camera that stays, block after block."""
    return runs(of_days, (case, changed(plan, {"flight": {"days": 2}})), seeds, BYTES_OF_SEED)


@dataclass(frozen=True, eq=False)
class Navigation:
    """What observed positions and attitudes change: RMS at check points (3,) m without and with them, and RMS of the
    change of the height of all points, m.
    """

    heading: str
    without: np.ndarray
    using: np.ndarray
    change_z: float


def with_navigation(case: Case, plan: Plan) -> list[Navigation]:
    """The first, second and fourth set without and with GNSS (5 cm) and INS (0.005°, κ 0.008°)."""
    flown = changed(plan, {"gnss": {"sigma_m": [0.05, 0.05, 0.05]}, "ins": {"sigma_deg": [0.005, 0.005, 0.008]}})
    block = aerotri.simulate(flown, 1).block
    found = []
    for heading, parameters in (case.sets[0], case.sets[1], case.sets[3]):
        using, without = (adjusted(one, parameters).adjusted for one in (block, replace(block, gnss_ins=None)))
        change = using.points.xyz[:, 2] - without.points.xyz[:, 2]
        rms = [np.sqrt(np.mean(result.check.difference**2, axis=0)) for result in (without, using)]
        found.append(Navigation(heading, *rms, float(np.sqrt(np.nanmean(change**2)))))
    return found
