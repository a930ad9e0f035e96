"""Adjustments of simulated blocks and what the paper asks of each."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from aerotri.functional_model.additional_parameters import parameter_set, parse_parameters
from aerotri.functional_model.orientation_patterns import orientation_patterns
from aerotri.image_errors import (
    AveragedResiduals,
    Change,
    ErrorField,
    averaged_residuals,
    change,
    field_without_orientation,
    systematic_errors,
)
from aerotri.observations import Block
from aerotri.pipeline import adjust
from aerotri.results.adjusted_block import AdjustedBlock
from aerotri.simulation import SimulationSpec, Truth, parse_spec, simulate, true_image_errors
from paper_003.cases import Case


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
    averaged: AveragedResiduals
    field: ErrorField
    shape: float
    error_left_um: float
    estimated: int
    significant: int
    t80: float


def changed(spec: SimulationSpec, tables: Mapping[str, Mapping]) -> SimulationSpec:
    """The spec with keys of some tables replaced, checked anew; 'camera.NAME.errors.physical' as a dotted name."""
    data = spec.model_dump(exclude_none=True)
    for name, keys in tables.items():
        place = data
        for part in name.split("."):
            place = place.setdefault(part, {})
        place.update(keys)
    return parse_spec(data)


def with_parameters(block: Block, parameters: str, groups: str = "camera") -> Block:
    """The block to be adjusted with a set of parameters."""
    settings = replace(
        block.settings.adjustment, additional_parameters=parse_parameters(parameters), parameter_groups=groups
    )
    return replace(block, settings=replace(block.settings, adjustment=settings))


def measured(result: AdjustedBlock, truth: Truth, special: str) -> Run:
    """The numbers of an adjustment."""
    block, camera, p = result.block, result.block.cameras[0], result.parameters
    control_sigma = block.control.sigma[[list(block.control.point).index(k) for k in result.check.point]]
    averaged = averaged_residuals(result, camera.name)
    ours = (p.kinds == "additional") & np.isin(p.status, ("estimated", "weighted"))
    t80 = p.t[ours & (p.names == "dmc.80")]
    above_ground = float(np.median(truth.centre[:, 2]) - np.median(truth.points[:, 2]))
    return Run(
        len(block.images), len(block.points), len(block.image_points), len(result.control), len(result.check),
        result.outcome.sigma0_um, camera.pixel_um, above_ground * camera.pixel_mm / camera.focal_length_mm,
        np.mean(result.check.difference**2, axis=0), np.mean(result.check.sigma**2 + control_sigma**2, axis=0),
        averaged, field_without_orientation(result, camera.name), shape_share(averaged, special),
        error_left(result, truth), int(ours.sum()), int(np.sum(p.t[ours] > 1.96)),
        float(t80[0]) if len(t80) else float("nan"),
    )  # fmt: skip


def shape_share(averaged: AveragedResiduals, special: str) -> float:
    """How much of Σ n·|mean|² the patterns of a camera's own parameters explain, fitted with n as weights."""
    if not special:
        return float("nan")
    ((family, items),) = parse_parameters(special)
    shown = averaged.shown
    basis = parameter_set(family, items, averaged.camera).basis(averaged.x[shown], averaged.y[shown])
    weight = np.repeat(np.sqrt(averaged.count[shown]), 2)
    values = weight * averaged.mean[shown].ravel()
    design = weight[:, None] * basis.reshape(len(weight), -1)
    left = values - design @ np.linalg.lstsq(design, values, rcond=None)[0]
    return 1.0 - float(left @ left / (values @ values))


def error_left(result: AdjustedBlock, truth: Truth) -> float:
    """µm, RMS of a coordinate of estimated − true image error over the format, less the six patterns of orientation."""
    camera, sample = result.block.cameras[0], truth.image_errors[0]
    estimated, _ = systematic_errors(result, camera.name, *sample.xy.T)
    patterns = orientation_patterns(*sample.xy.T, camera.focal_length_mm).reshape(-1, 6)
    left = (estimated - sample.d).ravel()
    left = left - patterns @ np.linalg.lstsq(patterns, left, rcond=None)[0]
    return 1e3 * float(np.sqrt(np.mean(left**2)))


def true_field(field: ErrorField, spec: SimulationSpec, seed: int) -> ErrorField:
    """The true image error at the nodes of an estimated field; all of it significant. It holds no orientation."""
    error = next(iter(true_image_errors(spec, seed).values()))
    d = error(field.x.ravel(), field.y.ravel()).reshape(field.d.shape)
    return ErrorField(field.camera, field.group, field.x, field.y, d, np.zeros_like(d), np.ones(field.x.shape, bool))


@dataclass(frozen=True, eq=False)
class Row:
    """A set of a case over several seeds: its runs, the first of them drawn."""

    heading: str
    runs: tuple[Run, ...]

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


def rows_of(case: Case, spec: SimulationSpec, seeds: Iterable[int], say: Callable[[str], None]) -> list[Row]:
    """Every set of a case over the seeds."""
    found: list[list[Run]] = [[] for _ in case.sets]
    for seed in seeds:
        block, truth = simulate(spec, seed)
        for runs, (heading, parameters) in zip(found, case.sets, strict=True):
            say(f"{case.title}, seed {seed}, {heading}")
            runs.append(measured(adjust(with_parameters(block, parameters)), truth, case.special))
    return [Row(heading, tuple(runs)) for (heading, _), runs in zip(case.sets, found, strict=True)]


def over_cameras(case: Case, spec: SimulationSpec, cameras: int, say: Callable[[str], None]) -> np.ndarray:
    """(cameras, sets, 2) m, plan (of a coordinate) and height at check points, for cameras drawn anew."""
    name = next(iter(spec.camera))
    found = np.zeros((cameras, len(case.sets), 2))
    for k in range(cameras):
        other = changed(spec, {f"camera.{name}.errors.physical": {"seed": 101 + k}})
        row = rows_of(case, other, [1], lambda text, k=k: say(f"camera {k + 1}: {text}"))
        found[k] = [(one.horizontal_m, one.rms[2]) for one in row]
    return found


@dataclass(frozen=True, eq=False)
class Days:
    """Two days of one camera: the test of no change, and the fields of both days and their difference."""

    change_um: float
    change: Change
    fields: tuple[ErrorField, ErrorField]


def two_days(case: Case, spec: SimulationSpec, change_um: float) -> Days:
    """The block with parameters of its own for each day, the camera having changed by so much between them."""
    name = next(iter(spec.camera))
    other = changed(spec, {f"camera.{name}.errors.physical": {"day_change_um": change_um}})
    result = adjust(with_parameters(simulate(other, 1)[0], case.sets[3][1], "day"))
    one, two = (field_without_orientation(result, day) for day in ("1", "2"))
    return Days(change_um, change(result, "1", "2"), (one, two))


def days_over_seeds(case: Case, spec: SimulationSpec, seeds: Iterable[int]) -> list[Change]:
    """The test of no change between two days of a camera that stays, block after block."""
    flown = changed(spec, {"flight": {"days": 2}})
    found = []
    for seed in seeds:
        result = adjust(with_parameters(simulate(flown, seed)[0], case.sets[3][1], "day"))
        found.append(change(result, "1", "2"))
    return found


@dataclass(frozen=True, eq=False)
class Navigation:
    """What observed positions and attitudes change: RMS at check points (3,) m without and with them, and RMS of the
    change of the height of all points, m.
    """

    heading: str
    without: np.ndarray
    using: np.ndarray
    change_z: float


def with_navigation(case: Case, spec: SimulationSpec) -> list[Navigation]:
    """The first, second and fourth set without and with GNSS (5 cm) and INS (0.005°, κ 0.008°)."""
    flown = changed(spec, {"gnss": {"sigma_m": [0.05, 0.05, 0.05]}, "ins": {"sigma_deg": [0.005, 0.005, 0.008]}})
    block, _ = simulate(flown, 1)
    found = []
    for heading, parameters in (case.sets[0], case.sets[1], case.sets[3]):
        chosen = with_parameters(block, parameters)
        using, without = adjust(chosen), adjust(replace(chosen, gnss_ins=None))
        change = using.points.xyz[:, 2] - without.points.xyz[:, 2]
        rms = [np.sqrt(np.mean(result.check.difference**2, axis=0)) for result in (without, using)]
        found.append(Navigation(heading, *rms, float(np.sqrt(np.nanmean(change**2)))))
    return found
