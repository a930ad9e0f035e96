"""From a spec to a block with its truth."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerotri.conventions import InputError
from aerotri.functional_model.additional_parameters import parse_parameters
from aerotri.observations import (
    AdjustmentSettings,
    Block,
    Control,
    GnssIns,
    GnssSettings,
    ImagePoints,
    Images,
    InsSettings,
    Settings,
)
from aerotri.simulation.camera_errors import ImageError, image_error_fields
from aerotri.simulation.camera_errors.lens import format_grid
from aerotri.simulation.cameras import true_camera
from aerotri.simulation.flight import FlightFrame, FlownImages, plan_flight
from aerotri.simulation.ground_points import ControlPoints, choose_seen, lay_out_control, tie_candidates
from aerotri.simulation.measuring import Imaging, gross_errors, tie_rays
from aerotri.simulation.motion import true_motion, true_readouts
from aerotri.simulation.navigation import observe_navigation
from aerotri.simulation.projection import Motion, Photographs, Rays, TrueCamera
from aerotri.simulation.random_streams import stream
from aerotri.simulation.rigs import reference_cameras, stated_rigs, tilted, true_mountings, with_rigs
from aerotri.simulation.spec import ControlSpec, SimulationSpec
from aerotri.simulation.terrain import Terrain, make_terrain
from aerotri.simulation.towers import build_towers, plumb_lines
from aerotri.simulation.truth import ImageErrorSample, Truth

SAMPLES = (46, 30)
"""Columns and rows of the grid on which the truth samples an image error."""
REACH = 1.5
"""How much larger than on a grid an image error may be between its nodes."""


@dataclass(frozen=True, eq=False)
class Scene:
    """The object points that are measured, and their rays without noise.

    Parameters
    ----------
    names : (N,) str, in the order they are first measured; xyz : (N, 3) m.
    rays : sorted by image.
    signals : (k,) index of control and check points; is_check : (k,) bool. towers : (t, 2) index of foot and top.
    """

    names: np.ndarray
    xyz: np.ndarray
    rays: Rays
    signals: np.ndarray
    is_check: np.ndarray
    towers: np.ndarray


def simulate(spec: SimulationSpec, seed: int) -> tuple[Block, Truth]:
    """A block as a flight would have brought it, and what is behind it.

    Parameters
    ----------
    spec : see `SimulationSpec`.
    seed : non-negative; the same seed gives the same block bit for bit.

    Returns
    -------
    The block, its points in the order they are first measured, its rays sorted by image; and the truth.
    """
    if seed < 0:
        raise InputError(f"the seed {seed} is negative", "give 0 or more")
    settings = settings_of(spec)
    cameras = tuple(true_camera(name, camera) for name, camera in spec.camera.items())
    nominal = tuple(camera.nominal for camera in cameras)
    plan = stream(seed, "flight")
    planned, frame = plan_flight(spec.flight, nominal, spec.terrain.height_m, plan, reference_cameras(spec))
    planned = tilted(planned, spec)
    flown, lead = with_rigs(planned, spec, stream(seed, "rigs"))
    motion = true_motion(spec, planned, lead, seed)
    imaging = imaging_of(spec, cameras, flown, motion, seed)
    terrain = make_terrain(spec.terrain, spec.flight.centre_m, stream(seed, "terrain"))
    scene = _scene(spec, flown, frame, terrain, imaging, seed)
    image_points, wrong_rays, gross = observe(spec, scene, imaging, seed)
    control, wrong_control, blunders = control_of(spec.control, scene, seed)
    block = Block(
        name=spec.name,
        cameras=nominal,
        images=images_of(spec, flown, seed),
        points=scene.names,
        image_points=image_points,
        control=control,
        gnss_ins=_navigation(spec, planned, lead, seed),
        settings=settings,
        rotation=spec.rotation,
        constraints=None if spec.towers is None else plumb_lines(scene.towers, spec.towers.sigma_m),
        rigs=stated_rigs(spec, stream(seed, "stated rigs")),
    )
    names, groups, values = parameters_of(spec)
    truth = Truth(
        centre=flown.centre,
        angles=flown.angles,
        points=scene.xyz,
        parameter_names=names,
        parameter_groups=groups,
        parameter_values=values,
        interior=np.array([(c.focal_length, c.x0, c.y0) for c in cameras]),
        image_errors=sampled(imaging),
        gross_errors=wrong_rays,
        gross_error_mm=gross,
        control_blunders=wrong_control,
        control_blunder_m=blunders,
        mountings=true_mountings(spec.rig),
        motion=motion,
        readout_ms=true_readouts(spec),
    )
    return block, truth


def _navigation(spec: SimulationSpec, planned: FlownImages, lead: np.ndarray, seed: int) -> GnssIns | None:
    """What GNSS and INS say of the reference photographs, which stand for their stations."""
    observed = observe_navigation(spec.gnss, spec.ins, planned, spec.rotation, stream(seed, "navigation"))
    first = np.unique(lead, return_index=True)[1]
    return None if observed is None else replace(observed, image=first[observed.image])


def true_image_errors(spec: SimulationSpec, seed: int) -> dict[tuple[str, str], ImageError]:
    """The image errors d(x, y) that `simulate` adds for this spec and seed, by (camera name, day); day '' without days.

    Returns
    -------
    Functions of (n,) x and (n,) y in mm that give (n, 2) mm.
    """
    cameras = [true_camera(name, camera) for name, camera in spec.camera.items()]
    days = [str(i + 1) for i in range(spec.flight.days)] if spec.flight.days else [""]
    errors = {name: camera.errors for name, camera in spec.camera.items()}
    return image_error_fields(cameras, errors, days, seed)


def imaging_of(
    spec: SimulationSpec, cameras: tuple[TrueCamera, ...], flown: FlownImages, motion: Motion | None, seed: int
) -> Imaging:
    fields = true_image_errors(spec, seed)
    reach = []
    for camera in cameras:
        x, y = format_grid(camera.nominal.half_format_mm, *SAMPLES)
        own = [field(x, y) for (name, _), field in fields.items() if name == camera.nominal.name]
        reach.append(REACH * float(np.abs(own).max()))
    photographs = Photographs.of(flown.centre, flown.angles, spec.rotation, flown.camera, cameras, motion)
    return Imaging(photographs, flown.day, fields, reach)


def _scene(
    spec: SimulationSpec, flown: FlownImages, frame: FlightFrame, terrain: Terrain, imaging: Imaging, seed: int
) -> Scene:
    def on_ground(xy: np.ndarray) -> np.ndarray:
        return np.column_stack([xy, terrain.height(xy)])

    def candidates(count: int) -> np.ndarray:
        rng = stream(seed, "tie points")
        return on_ground(
            tie_candidates(spec.tie_points, count, flown, imaging.cameras, frame, spec.terrain.height_m, rng)
        )

    base = (1.0 - spec.control.base_end_lap) * frame.footprint[0]
    layout = lay_out_control(spec.control, frame, base, stream(seed, "control"))
    layout, signals, signal_rays = measured_signals(spec, layout, on_ground(layout.xy), imaging)
    towers = build_towers(spec, flown, imaging, on_ground, seed)
    ties, rays = tie_rays(spec.tie_points, imaging, candidates, lambda: stream(seed, "measuring"))
    names = np.array([*layout.names, *towers.names, *(f"T{i + 1:06d}" for i in range(len(ties)))])
    xyz = np.concatenate([signals, towers.xyz, ties])
    all_rays = joined([(signal_rays, len(signals)), (towers.rays, len(towers.xyz)), (rays, len(ties))])
    return in_order(names, xyz, all_rays, layout.is_check, len(towers.xyz))


def joined(parts: list[tuple[Rays, int]]) -> Rays:
    """The rays of several lists of points, (rays, number of points) each, numbered through."""
    first = np.cumsum([0, *(count for _, count in parts[:-1])])
    return Rays(
        np.concatenate([rays.image for rays, _ in parts]),
        np.concatenate([rays.point + start for (rays, _), start in zip(parts, first, strict=True)]),
        np.concatenate([rays.xy for rays, _ in parts]),
    )


def measured_signals(
    spec: SimulationSpec, layout: ControlPoints, xyz: np.ndarray, imaging: Imaging
) -> tuple[ControlPoints, np.ndarray, Rays]:
    """The signalised points in use and their rays: every image that sees one measures it."""
    rays, _ = imaging.measure(xyz, imaging.rays(xyz), spec.tie_points.margin_px)
    used = choose_seen(layout, np.bincount(rays.point, minlength=len(xyz)), spec.control.check_points)
    number = np.full(len(xyz), -1)
    number[used] = np.arange(len(used))
    rays = rays.take(number[rays.point] >= 0)
    # check points that were only to spare are left out, so the names are given anew
    check = layout.is_check[used]
    rank = np.where(check, np.cumsum(check), np.cumsum(~check))
    names = np.array([f"{'K' if c else 'C'}{i:02d}" for c, i in zip(check, rank, strict=True)], dtype=str)
    return ControlPoints(names, layout.xy[used], check), xyz[used], Rays(rays.image, number[rays.point], rays.xy)


def in_order(names: np.ndarray, xyz: np.ndarray, rays: Rays, is_check: np.ndarray, tower_points: int) -> Scene:
    """Rays by image, points by their first ray: as a reader of the written block numbers them.

    Parameters
    ----------
    names, xyz : signalised points first, then `tower_points` points of towers, foot and top by turns.
    """
    rays = rays.take(np.lexsort((rays.point, rays.image)))
    points, first = np.unique(rays.point, return_index=True)
    order = points[np.argsort(first)]
    number = np.empty(len(names), dtype=np.int64)
    number[order] = np.arange(len(order))
    k = len(is_check)
    towers = number[k : k + tower_points].reshape(-1, 2)
    in_order = Rays(rays.image, number[rays.point], rays.xy)
    return Scene(names[order], xyz[order], in_order, number[:k], is_check, towers)


def observe(
    spec: SimulationSpec, scene: Scene, imaging: Imaging, seed: int, part: tuple[str, ...] = ()
) -> tuple[ImagePoints, np.ndarray, np.ndarray]:
    """Noise and gross errors on the rays; index of the wrong ones, (k, 2) mm of their gross errors.

    Parameters
    ----------
    part : name of the part whose random numbers are drawn, nothing of the whole.
    """
    ties, rays = spec.tie_points, scene.rays
    signal_um = ties.sigma_um if spec.control.image_sigma_um is None else spec.control.image_sigma_um
    stated_um = ties.stated_sigma_um or ties.sigma_um
    stated_signal_um = spec.control.image_sigma_um or stated_um
    is_signal = np.isin(rays.point, scene.signals)[:, None]
    noise = np.where(is_signal, signal_um, ties.sigma_um) * 1e-3
    sigma = np.repeat(np.where(is_signal, stated_signal_um, stated_um) * 1e-3, 2, axis=1)
    xy = rays.xy + noise * stream(seed, "image noise", *part).normal(size=(len(rays), 2))
    wrong, gross = np.zeros(0, np.int64), np.zeros((0, 2))
    if spec.gross_errors is not None:
        tie = np.flatnonzero(~is_signal[:, 0])
        half = np.array([camera.half_format_mm for camera in imaging.cameras])
        half = half[imaging.photographs.camera[rays.image[tie]]]
        which, gross = gross_errors(spec.gross_errors, xy[tie], sigma[tie], half, stream(seed, "gross errors", *part))
        wrong = tie[which]
        xy[wrong] += gross
    return ImagePoints(rays.image, rays.point, xy, sigma), wrong, gross


def control_of(spec: ControlSpec, scene: Scene, seed: int) -> tuple[Control, np.ndarray, np.ndarray]:
    """Given coordinates with their errors; index of the wrong ones, (b, 3) m of their blunders."""
    check_sigma = spec.sigma_m if spec.check_sigma_m is None else spec.check_sigma_m
    sigma = np.where(scene.is_check[:, None], check_sigma, spec.sigma_m).astype(float)
    xyz = scene.xyz[scene.signals] + sigma * stream(seed, "control coordinates").normal(size=sigma.shape)
    stated = sigma if spec.stated_sigma_m is None else np.tile(spec.stated_sigma_m, (len(sigma), 1))
    names = scene.names[scene.signals].tolist()
    wrong = np.zeros(len(spec.blunders), np.int64)
    for k, blunder in enumerate(spec.blunders):
        if blunder.point not in names:
            raise InputError(
                f"'control.blunders.{k}.point' names '{blunder.point}', which is not there",
                f"there are {', '.join(names)}" if names else "there is no control",
            )
        wrong[k] = names.index(blunder.point)
        xyz[wrong[k]] += blunder.error_m
    errors = np.array([blunder.error_m for blunder in spec.blunders], dtype=float).reshape(-1, 3)
    return Control(scene.signals, xyz, stated, scene.is_check), wrong, errors


def images_of(spec: SimulationSpec, flown: FlownImages, seed: int) -> Images:
    start = spec.start_values
    centre, angles = np.full((len(flown), 3), np.nan), np.full((len(flown), 3), np.nan)
    if start.kind == "perturbed":
        rng = stream(seed, "start values")
        centre = flown.centre + start.position_sigma_m * rng.normal(size=centre.shape)
        angles = flown.angles + np.radians(start.angle_sigma_deg) * rng.normal(size=angles.shape)
    columns = {"day": flown.day} if spec.flight.days else {}
    if flown.station is not None:
        columns["station"] = flown.station
    if any(camera.rolling_shutter is not None for camera in spec.camera.values()) and spec.gnss is None:
        columns["time"] = np.array([f"{t:.4f}" for t in flown.time])
    return Images(flown.names, flown.camera, flown.strip, centre, angles, columns)


def settings_of(spec: SimulationSpec) -> Settings:
    groups = spec.adjustment.parameter_groups
    known = ["camera", "block", "strip", *(["day"] if spec.flight.days else [])]
    if groups not in known:
        raise InputError(f"'adjustment.parameter_groups' = '{groups}' is not known", f"there are {', '.join(known)}")
    gnss = GnssSettings()
    if spec.gnss is not None:
        drift = "strip" if any(spec.gnss.drift_sigma_m_s) else "off"
        shift = "strip" if any(spec.gnss.shift_sigma_m) else "off"
        gnss = GnssSettings(shift, drift, spec.gnss.lever_arm_m)
    boresight = spec.ins is not None and any(spec.ins.boresight_deg)
    return Settings(
        adjustment=AdjustmentSettings(parse_parameters(spec.adjustment.additional_parameters), groups),
        gnss=gnss,
        ins=InsSettings("camera" if boresight else "off") if spec.ins is not None else InsSettings(),
        image_sigma_um=spec.tie_points.stated_sigma_um or spec.tie_points.sigma_um,
    )


def parameters_of(spec: SimulationSpec) -> tuple[tuple[str, ...], tuple[str, ...], np.ndarray]:
    """Names, groups and values of the parameters in force: bluh.1, brown.K1, lens.k1, …, the camera as group."""
    rows = []
    for camera, errors in ((name, its.errors) for name, its in spec.camera.items()):
        rows += [(name, camera, value) for name, value in errors.parameters.items()]
        rows += [(f"brown.{name}", camera, value) for name, value in errors.brown.items()]
        rows += [(f"lens.{name}", camera, value) for name, value in errors.lens.items()]
    return tuple(r[0] for r in rows), tuple(r[1] for r in rows), np.array([r[2] for r in rows], dtype=float)


def sampled(imaging: Imaging) -> tuple[ImageErrorSample, ...]:
    """Each different field on a grid; under day '' when the camera has one for all days."""
    samples = []
    for camera in imaging.cameras:
        own = {day: field for (name, day), field in imaging.fields.items() if name == camera.name}
        x, y = format_grid(camera.half_format_mm, *SAMPLES)
        constant = len({id(field) for field in own.values()}) == 1
        for day, field in own.items():
            samples.append(ImageErrorSample(camera.name, "" if constant else day, np.stack([x, y], 1), field(x, y)))
            if constant:
                break
    return tuple(samples)
