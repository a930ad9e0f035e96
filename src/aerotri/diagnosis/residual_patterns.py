"""Mistakes that the misfits themselves show: positions off or exchanged, a constant offset, a wrong focal length."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from aerotri import of_known
from aerotri.conventions import SIGMA_PER_MAD
from aerotri.diagnosis import changes
from aerotri.diagnosis.angle_conventions import convention_between
from aerotri.diagnosis.catalogue import SUBJECTS
from aerotri.diagnosis.evidence import Evidence, Fit, Positions, expected_attitudes, fit, sizes
from aerotri.diagnosis.free_model import FreeModel
from aerotri.diagnosis.group_names import photographs_in_words
from aerotri.diagnosis.hypothesis import Hypothesis
from aerotri.functional_model.rotation import angles_from_rotation
from aerotri.observations import Block

FEW = 4
"""Positions of a set that may be off singly; of more the set as a whole is wrong."""
OFF = 2.0
"""Misfit in tolerances from which a position is off."""
SAME_PLACE = 1e-3
"""m within which two positions are the same [C]: the last digit of most files; a copied line differs by nothing."""
FAR_TURNED = np.pi / 4.0
"""Turn of an attitude, rad, from which it is of another kind than the others: half of the least mistake, 90°."""


def off_positions(own: Positions, found: Fit) -> np.ndarray:
    """Rows of a set that are off although most of the set fits; empty where the whole set is off."""
    size, tolerance = sizes(found.residual[own.name]), found.tolerance[own.name]
    off = np.flatnonzero(size > max(OFF * tolerance, 5.0 * float(np.median(size))))
    return off[np.argsort(-size[off])] if len(off) <= FEW and len(off) < 0.5 * len(own) else off[:0]


def of_single_positions(block: Block, evidence: Evidence, found: Fit) -> Iterator[Hypothesis]:
    """Positions that are off, and pairs of them that are exchanged."""
    for own in evidence.positions:
        off = off_positions(own, found)
        for a in range(len(off)):
            for b in range(a + 1, len(off)):
                yield from _exchanged(block, own, int(off[a]), int(off[b]))
        if len(off):
            yield _taken_out(own, off, found.residual[own.name][off])


def of_single_attitudes(block: Block, evidence: Evidence, found: Fit) -> Iterator[Hypothesis]:
    """Photographs, or strips, whose angles follow another convention than the others; else the angles left out."""
    for own in evidence.attitudes:
        off = np.flatnonzero(found.turned[own.name] > FAR_TURNED)
        if found.placed is None or not 0 < len(off) < 0.5 * len(own.row):
            continue
        gnss, rows = block.gnss_ins, own.row[off]
        image, angles = rows, block.images.angles
        if own.name == "ins" and gnss is not None:
            image, angles = gnss.image[rows], gnss.angles
        subject = f"{SUBJECTS[(own.name,)]} of {photographs_in_words(block, image)}"
        expected = angles_from_rotation(expected_attitudes(own, found.placed)[off], block.rotation)
        convention = convention_between(angles[rows], expected, block.rotation)
        if convention is not None:
            change = _on_rows(convention.change, rows)
            yield Hypothesis(subject, convention.remedy, changes.on_angles((own.name,), change))
        elif len(off) <= FEW:
            turned = np.degrees(np.median(found.turned[own.name][off]))
            nothing = changes.with_rows(rows, np.full((len(rows), 3), np.nan))
            yield Hypothesis(
                "block", f"the {subject} left out", changes.on_angles((own.name,), nothing), plural=False,
                note=f"they are turned by {turned:.0f}°",
            )  # fmt: skip


def _on_rows(change: changes.Positions, rows: np.ndarray) -> changes.Positions:
    """A change of some rows."""

    def changed(values: np.ndarray) -> np.ndarray:
        found = values.copy()
        found[rows] = change(values[rows])
        return found

    return changed


def _noun(own: Positions) -> str:
    return {"control": "control point", "check": "check point", "gnss": "GNSS position of photograph"}.get(
        own.name, "start value of photograph"
    )


def _exchanged(block: Block, own: Positions, a: int, b: int) -> Iterator[Hypothesis]:
    rows = own.row[[a, b]]
    first, second = str(own.labels[a]), str(own.labels[b])
    if own.name in ("control", "check"):
        swapped = _on_control(lambda xyz: _rows_exchanged(xyz, rows))
        yield Hypothesis("coordinates of the ground points", f"{first} and {second} exchanged", swapped)
        return
    images = rows if own.name == "start" or block.gnss_ins is None else block.gnss_ins.image[rows]
    yield Hypothesis(
        f"photographs {first} and {second}: the measurements", "the two names exchanged", _images_exchanged(images),
        on_model=_model_exchanged(images),
    )  # fmt: skip
    change = changes.on_positions((own.name,), lambda xyz: _rows_exchanged(xyz, rows))
    yield Hypothesis(SUBJECTS[(own.name,)], f"those of {first} and {second} exchanged", change)


def _rows_exchanged(xyz: np.ndarray, rows: np.ndarray) -> np.ndarray:
    found = xyz.copy()
    found[rows] = xyz[rows[::-1]]
    return found


def _images_exchanged(images: np.ndarray) -> changes.Change:
    def changed(block: Block) -> Block:
        image = block.image_points.image
        swapped = np.where(image == images[0], images[1], np.where(image == images[1], images[0], image))
        return replace(block, image_points=replace(block.image_points, image=swapped))

    return changed


def _model_exchanged(images: np.ndarray):
    def changed(model: FreeModel) -> FreeModel:
        order = np.arange(len(model.centre))
        order[images] = images[::-1]
        return FreeModel(model.centre[order], model.rotation[order], model.points, model.miss[order])

    return changed


def _taken_out(own: Positions, off: np.ndarray, residual: np.ndarray) -> Hypothesis:
    """The positions that are off left out, with how far they are off."""
    said = []
    for k, by in zip(off, residual, strict=True):
        amounts = ", ".join(
            f"{axis} {value:+.3g} m" for axis, value in zip("XYZ", by, strict=True) if np.isfinite(value)
        )
        same = _twin(own, int(k))
        said.append(f"{own.labels[k]} is off by {amounts}" + (f"; it has the coordinates of {same}" if same else ""))
    rows = own.row[off]
    nothing = changes.with_rows(rows, np.full((len(rows), 3), np.nan))
    change = changes.on_positions((own.name,), nothing)
    if own.name in ("control", "check"):
        change = _on_control(nothing)
    names = ", ".join(str(own.labels[k]) for k in off)
    plural = "s" if len(off) > 1 else ""
    return Hypothesis("block", f"the {_noun(own)}{plural} {names} left out", change, plural=False, note="; ".join(said))


def _on_control(change: changes.Positions) -> changes.Change:
    """A change of the rows of the control table, whatever their role."""
    return lambda block: replace(block, control=replace(block.control, xyz=change(block.control.xyz)))


def _twin(own: Positions, row: int) -> str:
    """Another position of the set at the same place."""
    apart = np.abs(own.given - own.given[row])
    apart[row] = np.inf
    same = np.flatnonzero(np.nan_to_num(apart, nan=0.0).max(axis=1) <= SAME_PLACE)
    return str(own.labels[same[0]]) if len(same) else ""


def of_offsets(evidence: Evidence) -> Iterator[Hypothesis]:
    """GNSS positions that differ from the ground by a constant."""
    names = {p.name for p in evidence.positions}
    ground = tuple(n for n in ("control", "check") if n in names)
    if not ground or "gnss" not in names:
        return
    found = fit(evidence, ground)
    if found.placed is None:
        return
    residual, tolerance = found.residual["gnss"], found.tolerance["gnss"]
    middle = of_known.medians(residual)
    scatter = SIGMA_PER_MAD * of_known.medians(np.abs(residual - middle))
    beyond = np.abs(middle) > np.maximum(3.0 * scatter, 0.5 * tolerance)
    offset = np.where(beyond & np.isfinite(middle), middle, 0.0)
    if not offset.any():
        return
    if offset[2] and not offset[:2].any():
        way = "high" if offset[2] > 0.0 else "low"
        remedy = f"heights that are {abs(offset[2]):.4g} m {'lower' if offset[2] > 0 else 'higher'}"
        note = f"the GNSS heights are {abs(offset[2]):.4g} m too {way}"
    else:
        said = ", ".join(f"{axis} {value:+.4g} m" for axis, value in zip("XYZ", offset, strict=True) if value)
        remedy, note = f"a constant offset taken off ({said})", f"the GNSS positions are off by {said}"
    yield Hypothesis(SUBJECTS[("gnss",)], remedy, changes.on_positions(("gnss",), changes.plus(-offset)), note=note)
