"""A `Block` written as a block folder, in full precision."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from aerotri.conventions import RADIANS_PER, FilePath, InputError
from aerotri.formats.block.logo import logo_to_write
from aerotri.formats.block.scanned_film import measured_px
from aerotri.formats.files.atomic import atomic_folder
from aerotri.formats.text.table_writer import check_names, write_table
from aerotri.formats.text.toml_text import Inline, toml_of
from aerotri.functional_model.additional_parameters import format_parameters
from aerotri.observations import Block, Camera, Mounting, Prior, Rig, RollingShutter
from aerotri.observations.block import INTERIOR_ELEMENTS
from aerotri.observations.settings import GnssSettings, PhotographFieldSettings

ANGLE_UNIT = "deg"
TABLE_NAMES = ("images", "image_points", "control", "gnss_ins", "fiducials", "edits", "constraints")
IMPORT = "import.json"
"""What was taken, assumed and left behind when the block was read from files of other programs."""
OWN_ENTRIES = ("block.toml", IMPORT, *(f"{name}.{ending}" for name in TABLE_NAMES for ending in ("csv", "parquet")))
DECIMALS = {
    **dict.fromkeys(("X", "Y", "Z", "X0", "Y0", "Z0", "time"), 6),
    **dict.fromkeys(("x", "y"), 7),
    **dict.fromkeys(("omega", "phi", "kappa"), 9),
}
"""Decimals that mean something: a micrometre on the ground, a tenth of a nanometre in the image, 1e-9 degrees."""
IMAGE_FIELDS = ("image", "camera", "strip", "X0", "Y0", "Z0", "omega", "phi", "kappa")


def write_block(
    block: Block, folder: FilePath, tables: Literal["csv", "parquet"] = "csv", rounded: bool = False
) -> None:
    """Write a block; the folder appears when it is whole.

    Tables of an older block of that name are replaced, whatever else the folder holds is kept. Units are mm (pixels
    where film was scanned) and degrees; floating point numbers are written so that they are read back the same, or
    `rounded` to what a measurement can mean.

    Parameters
    ----------
    block : the block.
    folder : its place.
    tables : 'csv' or 'parquet'.

    Raises
    ------
    InputError
        When a name cannot stand in a table, or the place cannot be written to.
    """
    if tables not in ("csv", "parquet"):
        raise InputError(f"tables = '{tables}'", "tables are written as csv or parquet")
    logo = logo_to_write(block.project)
    with atomic_folder(folder, own=(*OWN_ENTRIES, *logo)) as place:
        _check_all_names(block)
        for name, picture in logo.items():
            (place / name).parent.mkdir(parents=True, exist_ok=True)
            (place / name).write_bytes(picture)
        (place / "block.toml").write_bytes(_utf8(toml_of(settings_content(block))))
        for name, columns in _tables(block).items():
            if rounded:
                columns = {column: with_meaning(column, values) for column, values in columns.items()}
            write_table(columns, place / f"{name}.{tables}")


def with_meaning(column: str, values: np.ndarray) -> np.ndarray:
    """A column of a table with the decimals that mean something; as it is where nothing is said of it."""
    return np.round(values, DECIMALS[column]) if column in DECIMALS else values


def _utf8(text: str) -> bytes:
    try:
        return text.encode("utf-8")
    except UnicodeEncodeError as error:
        raise InputError("a name in the settings is no text in UTF-8", "rename it") from error


def _check_all_names(block: Block) -> None:
    check_names(np.array([camera.name for camera in block.cameras], dtype=str), "camera")
    check_names(block.images.names, "image")
    check_names(block.points, "point")
    check_names(block.images.strip, "strip", may_be_empty=True)
    check_names(np.array(list(block.images.columns), dtype=str), "grouping column")
    for name, values in block.images.columns.items():
        if name in IMAGE_FIELDS or name.startswith("x_"):
            raise InputError(f"a grouping column cannot be named '{name}'", "give it another name")
        check_names(np.asarray(values, dtype=str), name, may_be_empty=True)


def _tables(block: Block) -> dict[str, dict[str, np.ndarray]]:
    images, rays, control = block.images, block.image_points, block.control
    xy, sigma = measured_px(block) if block.interior_fits else (rays.xy, rays.sigma)
    per_radian = 1.0 / RADIANS_PER[ANGLE_UNIT]
    camera_names = np.array([camera.name for camera in block.cameras], dtype=str)
    tables = {
        "images": {"image": images.names, "camera": camera_names[images.camera], "strip": images.strip}
        | dict(images.columns)
        | _columns(("X0", "Y0", "Z0"), images.centre)
        | _columns(("omega", "phi", "kappa"), images.angles * per_radian),
        "image_points": {"image": images.names[rays.image], "point": block.points[rays.point]}
        | _columns(("x", "y"), xy, always=True)
        | _columns(("sx", "sy"), sigma if not _common_sigma(block) else np.full_like(sigma, np.nan)),
    }
    if len(control):
        role = np.where(control.is_check, "check", "control")
        tables["control"] = (
            {"point": block.points[control.point]}
            | _columns(("X", "Y", "Z"), control.xyz)
            | _columns(("sX", "sY", "sZ"), control.sigma)
            | {"role": role}
        )
    if block.gnss_ins is not None and len(block.gnss_ins):
        observed = block.gnss_ins
        tables["gnss_ins"] = (
            {"image": images.names[observed.image]}
            | _columns(("X", "Y", "Z"), observed.xyz, always=True)
            | _columns(("sX", "sY", "sZ"), observed.sigma, always=True)
            | _columns(("omega", "phi", "kappa"), observed.angles * per_radian)
            | _columns(("s_omega", "s_phi", "s_kappa"), observed.angles_sigma * per_radian)
            | _columns(("time",), observed.time[:, None])
        )
    return tables | _extra_tables(block)


def _columns(names: tuple[str, ...], values: np.ndarray, always: bool = False) -> dict[str, np.ndarray]:
    """Columns of an array, left out when all of it is unknown."""
    if not always and np.isnan(values).all():
        return {}
    return {name: values[:, k] for k, name in enumerate(names)}


def _common_sigma(block: Block) -> bool:
    """Whether the σ of the image points are all the block's own, and so need not be written."""
    return bool((block.image_points.sigma == block.settings.image_sigma_um * 1e-3).all())


def _extra_tables(block: Block) -> dict[str, dict[str, np.ndarray]]:
    """Decisions, fiducials and constraints, where there are any."""
    tables, images = {}, block.images.names
    if block.edits is not None and len(block.edits):
        edits = block.edits
        tables["edits"] = {
            "image": np.where(edits.image < 0, "", images[edits.image]),
            "point": block.points[edits.point],
            "action": edits.action,
            "reason": edits.reason,
        }
    if block.fiducials is not None and len(block.fiducials):
        marks = block.fiducials
        tables["fiducials"] = {"image": images[marks.image], "fiducial": marks.name} | _columns(
            ("column", "row"), marks.column_row
        )
    if block.constraints is not None and len(block.constraints):
        conditions = block.constraints
        tables["constraints"] = {
            "kind": conditions.kind,
            "points": np.array([_members(block.points[p]) for p in conditions.points], dtype=str),
            "value": conditions.value,
            "sigma": conditions.sigma,
        }
    return tables


def _members(names: np.ndarray) -> str:
    odd = [name for name in names.tolist() if len(name.split()) != 1]
    if odd:
        raise InputError(f"point {odd[0]!r} of a constraint has a blank in its name", "rename it")
    return " ".join(names.tolist())


def settings_content(block: Block) -> dict[str, Any]:
    """What block.toml of a block holds, by its keys; what was not given has its default."""
    settings, adjustment = block.settings, block.settings.adjustment
    content: dict[str, Any] = {
        "name": block.name,
        "crs": block.crs,
        "angle_unit": ANGLE_UNIT,
        "rotation": block.rotation,
        "image_unit": "px" if block.interior_fits else "mm",
        "camera": {camera.name: _camera(camera) for camera in block.cameras},
        "stochastic": {"image_sigma_um": settings.image_sigma_um} | _of_photographs(settings.photograph_fields),
        "adjustment": {
            "additional_parameters": format_parameters(adjustment.additional_parameters),
            "parameter_groups": adjustment.parameter_groups,
            "parameter_position": adjustment.parameter_position,
            "parameter_selection": adjustment.parameter_selection,
            "t_limit": adjustment.t_limit,
            "correlation_limit": adjustment.correlation_limit,
            "robust": adjustment.robust,
            "datum": adjustment.datum,
            "datum_points": list(adjustment.datum_points),
            "datum_fixed": [f"{image}:{element}" for image, element in adjustment.datum_fixed],
            "variance_components": adjustment.variance_components,
            "model_part": adjustment.model_part,
            "start": adjustment.start,
            "alpha": adjustment.alpha,
            "power": adjustment.power,
            "max_iterations": adjustment.max_iterations,
        },
        "corrections": {"refraction": settings.refraction, "earth_curvature": settings.earth_curvature},
        "gnss": {
            "shift": settings.gnss.shift,
            "drift": settings.gnss.drift,
            "lever_arm_m": list(settings.gnss.lever_arm_m),
            "time_offset": settings.gnss.time_offset,
        },
        "ins": {"boresight": settings.ins.boresight, "drift": settings.ins.drift},
    }
    known = {"sigma_um": settings.collocation.sigma_um, "length_mm": settings.collocation.length_mm}
    if any(value is not None for value in known.values()):
        content["collocation"] = {key: value for key, value in known.items() if value is not None}
    if settings.deviations.kind != "free":
        content["deviations"] = {"kind": settings.deviations.kind, "sigma_um": dict(settings.deviations.sigma_um or {})}
    project = {key: text for key, text in block.project.given().items() if key != "logo" or block.project.logo_content}
    if project:
        content["project"] = project
    if block.rigs:
        content["rig"] = {rig.name: _rig(rig) for rig in block.rigs}
    if settings.gnss.lever_arm_sigma_m is not None:
        content["gnss"]["lever_arm_sigma_m"] = list(settings.gnss.lever_arm_sigma_m)
    content["gnss"] |= _correlated(settings.gnss)
    return content


def _of_photographs(fields: PhotographFieldSettings) -> dict[str, Any]:
    """What says that photographs have smooth errors of their own; nothing where it is not asked for."""
    content: dict[str, Any] = {} if fields.correlated == "off" else {"correlated": fields.correlated}
    known = {"correlated_sigma_um": fields.sigma_um, "correlation_length_mm": fields.length_mm}
    return content | {key: value for key, value in known.items() if value is not None}


def _correlated(gnss: GnssSettings) -> dict[str, Any]:
    """What says that errors of positions stay for a while; nothing where it is not asked for."""
    content: dict[str, Any] = {} if gnss.correlated == "off" else {"correlated": gnss.correlated}
    if gnss.correlation_time_s is not None:
        content["correlation_time_s"] = gnss.correlation_time_s
    if gnss.correlated_sigma_m is not None:
        content["correlated_sigma_m"] = list(gnss.correlated_sigma_m)
    if gnss.noise_factor != (1.0, 1.0):
        content["noise_factor"] = "estimated" if gnss.noise_factor is None else list(gnss.noise_factor)
    return content


def _camera(camera: Camera) -> dict[str, Any]:
    content: dict[str, Any] = {
        "model": camera.model,
        "size_px": list(camera.size_px),
        "pixel_um": camera.pixel_um,
        "focal_length_mm": camera.focal_length_mm,
        "principal_point_mm": list(camera.principal_point_mm),
    }
    if camera.is_fisheye:
        content["projection"] = camera.projection
    if camera.flight_axis is not None:
        content["flight_axis"] = camera.flight_axis
    unknown = {name: prior for name, prior in camera.interior.items() if name in INTERIOR_ELEMENTS and not prior.fixed}
    if unknown:
        # the start values stand above: focal_length_mm and principal_point_mm
        content["interior"] = {
            name: Inline({"fixed": False}) if prior.sigma is None else _prior(prior) for name, prior in unknown.items()
        }
    for section, priors in (("brown", camera.brown), ("lens", camera.lens), ("parameters", camera.parameters)):
        if priors:
            content[section] = {name: _prior(prior) for name, prior in priors.items()}
    if camera.interior_orientation is not None:
        content["interior_orientation"] = camera.interior_orientation
    if camera.fiducials:
        content["fiducials"] = {name: list(xy) for name, xy in camera.fiducials.items()}
    if camera.rolling_shutter is not None:
        content["rolling_shutter"] = _rolling_shutter(camera.rolling_shutter)
    return content


def _rolling_shutter(shutter: RollingShutter) -> dict[str, Any]:
    content: dict[str, Any] = {
        "readout_ms": _prior(shutter.readout_ms),
        "row_direction": shutter.row_direction,
        "motion": shutter.motion,
        "rotation": shutter.rotation,
        "test": shutter.test,
    }
    if shutter.motion == "photograph":
        content["motion_sigma_m_s"] = shutter.motion_sigma_m_s
    if shutter.rotation == "photograph":
        content["rotation_sigma_deg_s"] = shutter.rotation_sigma / RADIANS_PER["deg"]
    if shutter.speed_m_s is not None:
        content["speed_m_s"] = shutter.speed_m_s
    return content


def _rig(rig: Rig) -> dict[str, Any]:
    content: dict[str, Any] = {
        "reference": rig.reference,
        "constraint": rig.constraint,
    }
    if rig.cameras:
        content["camera"] = {name: _mounting(mounting) for name, mounting in rig.cameras.items()}
    return content


def _mounting(mounting: Mounting) -> dict[str, Any]:
    content: dict[str, Any] = {"position_m": _three(mounting.position, 1.0)}
    if mounting.known or any(prior.fixed for prior in mounting.rotation):
        content["rotation_deg"] = _three(mounting.rotation, 1.0 / RADIANS_PER["deg"])
    if mounting.movement_m != 0.0:
        content["movement_m"] = "estimated" if mounting.movement_m is None else mounting.movement_m
    if mounting.movement_rad is not None:
        content["movement_deg"] = mounting.movement_rad / RADIANS_PER["deg"]
    return content


def _three(priors: tuple[Prior, Prior, Prior], per_unit: float) -> Mapping[str, Any]:
    """Three elements, in the unit of the file."""
    content: dict[str, Any] = {"value": [per_unit * prior.value for prior in priors]}
    held, observed = [prior.fixed for prior in priors], [prior.sigma is not None for prior in priors]
    if any(observed) and not all(s or h for s, h in zip(observed, held, strict=True)):
        message = "a rig camera with some elements observed and others free cannot be written"
        raise InputError(message, "give all three a σ, a very large one to those that are free")
    if any(observed):
        # the σ of a held element has no meaning
        content["sigma"] = [per_unit * (1.0 if prior.sigma is None else prior.sigma) for prior in priors]
    if any(held):
        content["fixed"] = True if all(held) else held
    return Inline(content)


def _prior(prior: Prior) -> Mapping[str, Any]:
    content: dict[str, Any] = {"value": prior.value}
    if prior.sigma is not None:
        content["sigma"] = prior.sigma
    if prior.fixed:
        content["fixed"] = True
    return Inline(content)
