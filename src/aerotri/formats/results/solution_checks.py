"""What solution.npz may hold: arrays of the sizes of the block, and values that an adjustment can have."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

import numpy as np

from aerotri.adjustment._point_kernels import FARTHEST
from aerotri.adjustment._robust_kernels import ADAPTIVE, ADAPTIVE_STEPS
from aerotri.adjustment.ray_status import RAY_STATUS
from aerotri.adjustment.robust import CODES, WIDEST
from aerotri.formats.files.npz import Archive, Shape
from aerotri.observations import Block
from aerotri.results.model_part import OtherSet
from aerotri.results.photograph_fields import PhotographFields
from aerotri.results.position_errors import PositionErrors
from aerotri.results.removal import Removal
from aerotri.results.variance_components import ChiSquareTest, VarianceComponent

SCHEMA = 1
"""Version of the archive; it grows when an array changes its meaning, and others are refused."""
STATUS = ("converged", "not converged", "rank deficient")
VERDICTS = ("", "accepted", "doubtful", "rejected")
OF_OTHER_SET = ("other_images", "other_shared", "other_points")
"""Arrays that are there beside the text 'other_set'."""
SQUARE = 1e-6
"""Largest deviation of RᵀR from the unit matrix in a rotation written with all its digits."""
LARGEST = 1e15
"""No value of an adjustment is larger, as in tables: numbers beyond lose their decimals, and squares of them
overflow."""
FARTHEST_POINT = 1e3 * FARTHEST
"""Coordinate, m, of points that are as good as at infinity [C]: of a block with parallel rays the adjustment may have
such, a step of `FARTHEST` at most at a time."""
SCALARS = {"estimator_code": "iu", "estimator_limit": "f", "sigma0": "f", "iterations": "iu", "status": "U"} | {
    "geoid": "U", "components": "U", "removals": "U",
}  # fmt: skip
LATER = {"verdict": "U", "position_errors": "U", "photograph_fields": "U", "other_set": "U"}
"""Texts that results of older versions do not have, '' there."""


def checked_values(archive: Archive, block: Block | None) -> dict[str, Any]:
    """All entries of `SavedSolution` by name.

    Parameters
    ----------
    block : that was adjusted, whose sizes the arrays must have; None: they only have to agree with one another.

    Raises
    ------
    InputError
        For what no adjustment writes.
    """
    if archive.scalar("schema", "iu") != SCHEMA:
        raise archive.error("was written by another version")
    values = {name: archive.scalar(name, kind) for name, kind in SCALARS.items()}
    values |= {name: archive.scalar(name, kind) if name in archive.members else "" for name, kind in LATER.items()}
    values |= _arrays(archive, block)
    for name in ("warnings", "reasons", "notes"):
        texts = archive.array(name, "Uf", (None,)) if name in archive.members else np.zeros(0, "U1")
        values[name] = tuple(str(text) for text in texts)
    _check_scalars(archive, values)
    _check_arrays(archive, values)
    _check_json(archive, values)
    return values


def _arrays(archive: Archive, block: Block | None) -> dict[str, np.ndarray]:
    """The arrays of numbers and names, of sizes that agree."""
    sizes: tuple[int | None, int | None, int | None] = (None, None, None)
    if block is not None:
        sizes = len(block.images), len(block.points), len(block.image_points)
    n, count, m = sizes
    centre = archive.array("centre", "f", (n, 3))
    points = archive.array("points", "f", (count, 3))
    xy = archive.array("xy", "f", (m, 2))
    shared = archive.array("shared", "f", (None,))
    s, n, m = len(shared), len(centre), len(xy)
    others: dict[str, tuple[str, Shape]] = {
        "origin": ("f", (3,)),
        "rotation": ("f", (n, 3, 3)),
        "shared_names": ("Uf", (s,)),
        "shared_groups": ("Uf", (s,)),
        "shared_cofactor": ("f", (s, s)),
        "frame_origin": ("f", (3,)),
        "held": ("iu", (None, 2)),
        "ray_status": ("iu", (m,)),
        "weight": ("f", (m,)),
    }
    if "other_set" in archive.members:
        others |= {
            "other_images": ("f", (len(centre), 6)),
            "other_shared": ("f", (s,)),
            "other_points": ("f", (len(points), 3)),
        }
    found = {"centre": centre, "points": points, "xy": xy, "shared": shared}
    return found | {name: archive.array(name, kind, shape) for name, (kind, shape) in others.items()}


def _check_scalars(archive: Archive, values: dict[str, Any]) -> None:
    code = values["estimator_code"]
    adaptive = ADAPTIVE <= code < ADAPTIVE + ADAPTIVE_STEPS * WIDEST
    sigma0 = values["sigma0"]
    for good, what in (
        (values["status"] in STATUS, f"its status is '{values['status'][:40]}'"),
        (values["verdict"] in VERDICTS, f"its verdict is '{values['verdict'][:40]}'"),
        (code in CODES.values() or adaptive, f"it names an unknown estimator {code}"),
        (0.0 <= values["estimator_limit"] <= LARGEST, f"the limit of its estimator is {values['estimator_limit']:g}"),
        (values["estimator_limit"] > 0.0 or code == CODES["off"], "the limit of its estimator is 0"),
        (np.isnan(sigma0) or 0.0 <= sigma0 <= LARGEST, f"its σ0 is {sigma0:g}"),
        (0 <= values["iterations"] < 1 << 31, f"it has {values['iterations']} iterations"),
    ):
        if not good:
            raise archive.error(f"holds no solution: {what}")


def _check_arrays(archive: Archive, values: dict[str, Any]) -> None:
    count = len(values["points"])
    held, status, weight = values["held"], values["ray_status"], values["weight"]
    inside = ((held >= 0) & (held < np.array([max(count, 1), 3]))).all()
    adjusted = values["rotation"][np.isfinite(values["centre"]).all(axis=1)]
    frame = values["frame_origin"]
    for good, what in (
        (_whole_or_unknown(values["centre"]), "a projection centre is not finite"),
        (_whole_or_unknown(values["points"]), "a point is not finite"),
        (_is_bounded(values["origin"]), "its origin is not finite"),
        (_is_bounded(values["xy"]), "an image point is not finite"),
        (_is_bounded(values["shared"]), "a shared parameter is not finite"),
        (_are_rotations(adjusted), "a rotation matrix is not orthogonal"),
        (
            bool(inside) and len(held) == len(np.unique(held, axis=0)),
            "a held coordinate is of no point",
        ),
        (bool(((status >= 0) & (status < len(RAY_STATUS))).all()), "a ray has an unknown status"),
        (bool(((weight >= 0.0) & (weight <= 1.0) | np.isnan(weight)).all()), "a weight is not between 0 and 1"),
        (bool(np.isnan(frame).all()) or _is_bounded(frame), "its local frame has no origin"),
        (values["shared_names"].dtype.kind == "U" or not len(values["shared"]), "its parameters have no names"),
        (values["shared_groups"].dtype.kind == "U" or not len(values["shared"]), "its parameters have no groups"),
        (
            all(_is_bounded(values[name]) for name in OF_OTHER_SET if name in values),
            "what another set of parameters changes is not finite",
        ),
    ):
        if not good:
            raise archive.error(f"holds no solution: {what}")


def _is_bounded(values: np.ndarray) -> bool:
    return bool((np.abs(values) <= LARGEST).all())


def _whole_or_unknown(xyz: np.ndarray) -> bool:
    """Whether every row is finite, or NaN as a whole."""
    unknown = np.isnan(xyz).all(axis=1)
    return bool((np.abs(xyz[~unknown]) <= FARTHEST_POINT).all())


def _are_rotations(matrix: np.ndarray) -> bool:
    if not (np.abs(matrix) <= 2.0).all():
        return False
    skew = np.abs(matrix @ np.swapaxes(matrix, 1, 2) - np.eye(3))
    return bool((skew <= SQUARE).all() and (np.linalg.det(matrix) > 0.0).all())


def _check_json(archive: Archive, values: dict[str, Any]) -> None:
    removals = _json(archive, "removals", values["removals"] or "[]")
    if not isinstance(removals, list) or not all(_is_record(removal, Removal) for removal in removals):
        raise archive.error("holds no list of parameters that were taken out")
    if values["position_errors"]:
        errors = _json(archive, "position_errors", values["position_errors"])
        if not _is_record(errors, PositionErrors):
            raise archive.error("holds no record of the errors of positions")
    if values["other_set"]:
        other = _json(archive, "other_set", values["other_set"])
        if not _is_record(other, OtherSet) or not all(_is_share(other[key]) for key in ("weight", "unexplained")):
            raise archive.error("holds no record of another set of parameters")
    if values["photograph_fields"]:
        fields = _json(archive, "photograph_fields", values["photograph_fields"])
        if not _is_record(fields, PhotographFields):
            raise archive.error("holds no record of the errors of photographs")
    if not values["components"]:
        return
    content = _json(archive, "components", values["components"])
    good = isinstance(content, dict) and set(content) == {"components", "rounds", "settled"}
    good = good and isinstance(content["components"], list) and isinstance(content["rounds"], int)
    if not good or not all(_is_component(entry) for entry in content["components"]):
        raise archive.error("holds no variance components")


def _is_share(value: float | None) -> bool:
    return value is not None and 0.0 <= value <= 1.0


def _json(archive: Archive, name: str, text: str) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise archive.error(f"holds '{name}' that is no JSON") from error


def _is_component(entry: Any) -> bool:
    if not isinstance(entry, dict) or not _is_record(entry.get("test"), ChiSquareTest):
        return False
    return _is_record({key: value for key, value in entry.items() if key != "test"}, VarianceComponent, ("test",))


def _is_record(entry: Any, record: type[Any], without: tuple[str, ...] = ()) -> bool:
    """Whether a table has the fields of a record and values of their types; null stands for what is not known."""
    fields = {field.name: field.type for field in dataclasses.fields(record) if field.name not in without}
    if not isinstance(entry, dict) or set(entry) != set(fields):
        return False
    return all(_fits(entry[name], str(kind)) for name, kind in fields.items())


def _fits(value: Any, kind: str) -> bool:
    if kind == "str":
        return isinstance(value, str)
    if kind == "bool" or isinstance(value, bool):
        return kind == "bool" and isinstance(value, bool)
    if kind == "int":
        return isinstance(value, int)
    return value is None or (isinstance(value, int | float) and not abs(value) > LARGEST)
