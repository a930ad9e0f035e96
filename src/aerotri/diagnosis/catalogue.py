"""The usual mistakes that concern a whole set of positions, all angles or all measurements."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from aerotri.diagnosis import changes
from aerotri.diagnosis.angle_conventions import conventions
from aerotri.diagnosis.free_model import FreeModel
from aerotri.diagnosis.hypothesis import Hypothesis
from aerotri.observations import Block

Place = tuple[np.ndarray, np.ndarray]

SUBJECTS: dict[tuple[str, ...], str] = {
    ("control", "check"): "coordinates of control and check points",
    ("control",): "coordinates of control points",
    ("check",): "coordinates of check points",
    ("gnss",): "GNSS positions",
    ("start",): "start values of the projection centres",
    ("gnss", "start"): "GNSS positions and start values",
    ("ins",): "attitudes of the INS",
    ("start angles",): "start values of the angles",
    ("ins", "start angles"): "attitudes of the INS and start values of the angles",
}
POSITIONS = {"control", "check", "gnss", "start"}
UNITS = ((1e-3, "millimetres"), (1e-2, "centimetres"), (0.3048, "feet"))
"""Metres of one unit that coordinates may have been given in; the international foot is 0.3048 m exactly [L]."""


def sets_there(block: Block) -> set[str]:
    """Which sets of positions and attitudes a block has."""
    control, gnss, images = block.control, block.gnss_ins, block.images
    there = {
        "control": bool((~control.is_check).any()),
        "check": bool(control.is_check.any()),
        "gnss": gnss is not None and bool(np.isfinite(gnss.xyz).any()),
        "start": bool(np.isfinite(images.centre).any()),
        "ins": gnss is not None and bool(np.isfinite(gnss.angles).any()),
        "start angles": bool(np.isfinite(images.angles).any()),
    }
    return {name for name, is_there in there.items() if is_there}


def of_measurements() -> Iterator[Hypothesis]:
    """All image points in another frame: each makes the mirror image of the model."""
    for change, remedy in (
        (changes.negated(0), "x negated"),
        (changes.negated(1), "y negated"),
        (changes.x_and_y_exchanged, "x and y exchanged"),
    ):
        yield Hypothesis("measurements of all photographs", remedy, changes.on_image_points(change), _mirror(remedy))


def _mirror(remedy: str) -> Callable[[FreeModel], FreeModel]:
    """What a reflection of all measurements makes of the model: the mirror image, every camera turned in its plane."""
    # measured' = M·measured: R' = S·R·M with a reflection S of the space, here x of the model, whatever M is
    plane = {
        "x negated": np.diag([-1.0, 1.0, 1.0]),
        "y negated": np.diag([1.0, -1.0, 1.0]),
        "x and y exchanged": np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    }[remedy]
    space = np.diag([-1.0, 1.0, 1.0])

    def reflected(model: FreeModel) -> FreeModel:
        return FreeModel(model.centre @ space, space @ model.rotation @ plane, model.points @ space, model.miss)

    return reflected


def of_positions(block: Block, places: Mapping[str, Place]) -> Iterator[Hypothesis]:
    """Axes, units, order of the rows, of every set of positions.

    Parameters
    ----------
    places : by set, where its middle is given (2,), and where it should be according to the other sets (2,) m.
    """
    there = sets_there(block)
    for sets in (("control", "check"), ("control",), ("check",), ("gnss",), ("gnss", "start"), ("start",)):
        if not set(sets) <= there:
            continue
        yield from _axes_and_units(sets, block, places)
        if sets[0] in ("gnss", "start"):
            yield from _shifted_rows(sets, block)


def _axes_and_units(sets: tuple[str, ...], block: Block, places: Mapping[str, Place]) -> Iterator[Hypothesis]:
    def made(change: changes.Positions, remedy: str, note: str = "") -> Hypothesis:
        return Hypothesis(SUBJECTS[sets], remedy, changes.on_positions(sets, change), note=note)

    yield made(changes.x_and_y_exchanged, "X and Y exchanged")
    for axis, name in enumerate("XYZ"):
        yield made(changes.negated(axis), f"{name} negated")
    # all positions in another unit are a block of another size: nothing given contradicts it, they only count for less
    if set(sets) < sets_there(block) & POSITIONS:
        for factor, unit in UNITS:
            yield made(changes.scaled(factor), f"{unit} taken for what they are, not for metres")
    yield made(changes.scaled_heights(0.3048), "heights in feet taken for what they are, not for metres")
    xyz = _of_set(block, sets[0])
    if changes.could_be_degrees(xyz):
        for order, words in (((0, 1), "longitude and latitude"), ((1, 0), "latitude and longitude")):
            if block.crs != "local":
                change = changes.projected_degrees(order, block.crs)
            else:
                change = changes.metres_of_degrees(order, *places.get(sets[0], (np.nanmean(xyz[:, :2], axis=0),) * 2))
            yield made(change, f"{words} in degrees brought to metres")
    yield from _other_zones(sets, block)


def _other_zones(sets: tuple[str, ...], block: Block) -> Iterator[Hypothesis]:
    """Coordinates of a neighbouring UTM zone in a block of another one."""
    code = block.crs.partition("+")[0].removeprefix("EPSG:")
    if not (block.crs.startswith("EPSG:") and code.isdigit()):
        return
    number = int(code)
    families = ((32600, 60), (32700, 60), (25800, 60), (26900, 23))
    own = next(((base, last) for base, last in families if base < number <= base + last), None)
    if own is None:
        return
    for step in (-1, 1):
        zone = number - own[0] + step
        if not 1 <= zone <= own[1]:
            continue
        change = changes.other_zone(f"EPSG:{own[0] + zone}", f"EPSG:{number}")
        remedy = f"UTM zone {zone} (EPSG:{own[0] + zone}) brought to zone {number - own[0]}"
        yield Hypothesis(SUBJECTS[sets], remedy, changes.on_positions(sets, change))


def _of_set(block: Block, name: str) -> np.ndarray:
    if name in ("control", "check"):
        return block.control.xyz[block.control.is_check == (name == "check")]
    if name == "gnss":
        return block.gnss_ins.xyz if block.gnss_ins is not None else np.zeros((0, 3))
    return block.images.centre


def _shifted_rows(sets: tuple[str, ...], block: Block) -> Iterator[Hypothesis]:
    """Positions that stand beside the photograph before or after, in the whole table or by strip."""
    strip = np.asarray(block.images.strip)
    if "gnss" in sets and block.gnss_ins is not None:
        strip = strip[block.gnss_ins.image]
        if "start" in sets and not np.array_equal(block.gnss_ins.image, np.arange(len(block.images))):
            return
    for steps in (1, -1, 2, -2):
        count = "one photograph" if abs(steps) == 1 else f"{abs(steps)} photographs"
        for groups in (None, strip) if len(np.unique(strip)) > 1 else (None,):
            remedy = f"the positions shifted by {count}" + ("" if groups is None else " in every strip")
            change = changes.on_positions(sets, changes.moved_along(steps, groups))
            yield Hypothesis(SUBJECTS[sets], remedy, change)
    for name in np.unique(strip) if 1 < len(np.unique(strip)) <= 12 else ():
        for steps in (1, -1):
            only = np.where(strip == name, strip, "")
            change = _within(moved=changes.moved_along(steps, only), rows=strip == name)
            remedy = f"the positions of strip {name} shifted by one photograph"
            yield Hypothesis(SUBJECTS[sets], remedy, changes.on_positions(sets, change))


def _within(moved: changes.Positions, rows: np.ndarray) -> changes.Positions:
    def changed(xyz: np.ndarray) -> np.ndarray:
        return np.where(rows[:, None], moved(xyz), xyz)

    return changed


def of_angles(block: Block) -> Iterator[Hypothesis]:
    """Units, order, sense and axes of the angles."""
    there = sets_there(block)
    for sets in (("ins", "start angles"), ("ins",), ("start angles",)):
        if set(sets) <= there:
            for convention in conventions(block.rotation):
                yield Hypothesis(SUBJECTS[sets], convention.remedy, changes.on_angles(sets, convention.change))
