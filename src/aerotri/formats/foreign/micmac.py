"""MicMac's folder of orientations: ``Ori-NAME/Orientation-IMAGE.xml`` and the calibrations ``AutoCal….xml`` they name.

[L] MicMac's example files, whose verification points these formulas meet to 1e-11 px, and iTowns' reader. The rows L1
to L3 are the rotation x right, y down, z forwards → object. An object point lies at p = PP + F·(x/z, y/z) pixels before
the lens. ModRad adds (p − CDist)·(c1·r² + c2·r⁴ + …), r from CDist in pixels; ModPhgrStd further, with x, y from CDist,
P1·(2x² + r²) + 2·P2·xy + b1·x + b2·y to the column and P2·(2y² + r²) + 2·P1·xy to the row.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path, PurePosixPath
from xml.etree.ElementTree import Element

import numpy as np

from aerotri.conventions import FilePath, InputError
from aerotri.formats.assembly.parts import Reading
from aerotri.formats.foreign.colmap_rigs import COLMAP_FROM_CAMERA
from aerotri.formats.foreign.lens_fit import fitted_lens, format_grid_px
from aerotri.formats.foreign.reconstruction import PixelCamera, Reconstruction, check_names, rotation_matrix
from aerotri.formats.text.notes import assumed, left_behind
from aerotri.formats.text.tables import LARGEST_NUMBER, SMALLEST_POSITIVE
from aerotri.formats.text.text_lines import all_numbers
from aerotri.formats.text.xml_text import read_xml, text_of

BEGIN, END = "Orientation-", ".xml"
CONVENTION = "eConvApero_DistM2C"
REMEDY = "export the orientations of MicMac again"
MODELS = "calibrate with a radial model or with Fraser's: RadialStd, RadialBasic, FraserBasic, Fraser"
UNCHANGED = {"I00": (0.0, 0.0), "V10": (1.0, 0.0), "V01": (0.0, 1.0)}
TERMS = ("k1", "k2", "k3", "k4", "p1", "p2", "b1", "b2")
CLOSE_PX = 0.001
"""Distance of the nearest lens from MicMac's over the format that needs no words [C]."""
OFF_PX = 0.1
"""Distance of a file's own verification points that tells another calibration [C]: MicMac's tolerance is 0.001 px."""
FARTHEST_PX = 1e6


@dataclass(frozen=True)
class _Node:
    """element : of the file at path. where : in words."""

    element: Element
    path: Path

    def error(self, message: str, remedy: str = REMEDY) -> InputError:
        return InputError(f"<{self.element.tag[:40]}> {message}", remedy, self.path)

    def text(self, tag: str) -> str:
        return text_of(self.element.find(tag))

    def child(self, tag: str) -> _Node:
        found = self.element.find(tag)
        if found is None:
            raise self.error(f"has no <{tag}>")
        return _Node(found, self.path)

    def children(self, tag: str) -> Iterator[_Node]:
        return (_Node(found, self.path) for found in self.element.findall(tag))

    def numbers(self, tag: str, count: int, default: tuple[float, ...] | None = None) -> np.ndarray:
        """(count,) numbers separated by blanks."""
        words = self.text(tag).split()
        if not words and default is not None:
            return np.array(default)
        values = np.array(words, float) if all_numbers(words) else np.zeros(0)
        if len(values) != count or not (np.abs(values) <= LARGEST_NUMBER).all():
            raise self.error(f"has no <{tag}> of {count} number{'s' if count > 1 else ''}")
        return values

    def refuse_other(self, tag: str, wanted: str, remedy: str) -> None:
        if self.text(tag) not in ("", wanted):
            raise self.error(f"{tag} '{self.text(tag)[:40]}' is not understood", remedy)


@dataclass(frozen=True, eq=False)
class _Calibration:
    """Principal point, focal length, format in pixels; the distortion's centre, radial coefficients and further terms.

    Parameters
    ----------
    further : P1, P2, b1, b2. radius_px : from the principal point, within which the lens is defined.
    """

    pp: np.ndarray
    focal: float
    size: tuple[int, int]
    centre: np.ndarray
    radial: np.ndarray
    further: np.ndarray
    radius_px: float

    @property
    def values(self) -> np.ndarray:
        return np.concatenate([self.pp, [self.focal, *self.size], self.centre, self.further, self.radial])

    def measured(self, ideal: np.ndarray) -> np.ndarray:
        """(n, 2) pixels of tangents x/z, y/z, as MicMac computes them."""
        at = self.pp + self.focal * ideal
        x, y = (at - self.centre).T
        p1, p2, b1, b2 = self.further
        r2 = x * x + y * y
        factor = np.polynomial.polynomial.polyval(r2, [0.0, *self.radial])
        across = x * factor + p1 * (2.0 * x * x + r2) + 2.0 * p2 * x * y + b1 * x + b2 * y
        down = y * factor + p2 * (2.0 * y * y + r2) + 2.0 * p1 * x * y
        return at + np.column_stack([across, down])

    def camera(self) -> tuple[PixelCamera, str]:
        """The camera with the nearest lens, and what that leaves, in words; '' for nothing to speak of."""
        places = format_grid_px(self.size) - self.pp
        near = np.hypot(*places.T) <= self.radius_px
        ideal = places[near if near.sum() > len(TERMS) else slice(None)] / self.focal
        bent = (self.measured(ideal) - self.pp) / self.focal
        centred = np.array_equal(self.pp, self.centre)
        further = TERMS[4:] if self.further.any() or not centred else ()
        names = (*TERMS[: min(4, len(self.radial))], *further)
        best = fitted_lens(ideal, bent, names, False, self.focal)
        lens = best.values(names)
        focal = (self.focal * (1.0 + lens.pop("b1", 0.0)), self.focal)
        found = PixelCamera(self.size, focal, (float(self.pp[0]), float(self.pp[1])), lens, centre_known=True)
        return found, best.text if best.max_px > CLOSE_PX else ""


def is_micmac(path: Path) -> bool:
    """Whether a folder holds orientations of MicMac."""
    return path.is_dir() and next(path.glob(f"{BEGIN}*{END}"), None) is not None


def read_micmac(path: FilePath, pixel_um: float = 1.0) -> Reading:
    """Cameras and orientations of a folder ``Ori-NAME``; image points are not in it.

    Parameters
    ----------
    pixel_um : size of a pixel.

    Raises
    ------
    InputError
        With the file: a convention or a lens that is not understood, verification points that contradict it.
    """
    folder = Path(path)
    files = sorted(folder.glob(f"{BEGIN}*{END}"))
    if not files:
        raise InputError(f"holds no {BEGIN}…{END}", "give the folder Ori-… of MicMac", folder)
    names = [file.name.removeprefix(BEGIN).removesuffix(END) for file in files]
    check_names(names, "photograph", folder, "rename the photograph")
    calibrations: dict[str, _Calibration] = {}
    camera, centre, rotation = [], [], []
    for file in files:
        node = _orientation(file)
        label = _with_calibration(node, folder, calibrations)
        camera.append(list(calibrations).index(label))
        pose = _pose(node)
        _verify(node, calibrations[label], *pose)
        centre.append(pose[0])
        rotation.append(pose[1] @ COLMAP_FROM_CAMERA)
    ours, said = [], []
    for label, calibration in calibrations.items():
        found, text = calibration.camera()
        found.refuse_impossible(InputError(f"calibration '{label[:60]}' has values that no camera has", REMEDY, folder))
        ours.append(found.camera(label, pixel_um))
        said += [assumed(f"camera '{label[:60]}': the nearest lens of MicMac's is taken, {text}")] if text else []
    nothing = np.zeros(0, np.int64)
    reading = Reconstruction(
        tuple(ours),
        names,
        np.array(camera, np.int64),
        np.array(centre),
        np.array(rotation),
        [],
        np.zeros((0, 3)),
        nothing,
        nothing,
        np.zeros((0, 2)),
    ).reading(folder.name.removeprefix("Ori-"))
    said.append(left_behind("MicMac's tie points (Homol) are not read: image points come from --image-points"))
    return replace(reading, messages=(*said, "coordinates are local"))


def _orientation(file: Path) -> _Node:
    root = _Node(read_xml(file), file)
    node = root if root.element.tag == "OrientationConique" else root.child("OrientationConique")
    node.refuse_other("TypeProj", "eProjStenope", "give central projections")
    conventions = [node.text("ConvOri/KnownConv"), node.text("Externe/KnownConv")]
    other = [text for text in conventions if text not in ("", CONVENTION)]
    if other or not any(conventions):
        raise node.error(f"its convention is '{''.join(other)[:40]}', not {CONVENTION}")
    _refuse_affinity(node, "OrIntImaM2C")
    return node


def _refuse_affinity(node: _Node, tag: str) -> None:
    if node.element.find(tag) is None:
        return
    inside = node.child(tag)
    inside = inside.child("Affinite") if inside.element.find("Affinite") is not None else inside
    if any(tuple(inside.numbers(key, 2, wanted)) != wanted for key, wanted in UNCHANGED.items()):
        raise node.error(f"{tag} turns or scales the image, which is not understood", "resample the photographs first")


def _with_calibration(node: _Node, folder: Path, known: dict[str, _Calibration]) -> str:
    """The label of a photograph's calibration, which is read where it is new."""
    stated = node.text("FileInterne").replace("\\", "/")
    if not stated:
        inside = _calibration(node.child("Interne"))
        same = (label for label, other in known.items() if np.array_equal(other.values, inside.values))
        label = next(same, f"camera {len(known) + 1}")
        known.setdefault(label, inside)
        return label
    where = PurePosixPath(stated)
    label = where.name.removesuffix(END)
    if label not in known:
        places = [folder / where.name, folder.parent / where.parent.name / where.name]
        found = next((place for place in places if place.is_file()), None)
        if found is None:
            message = f"names the calibration '{where.name[:80]}', which is not beside it"
            raise node.error(message, f"copy it into {folder}")
        root = _Node(read_xml(found), found)
        tag = "CalibrationInternConique"
        known[label] = _calibration(root if root.element.tag == tag else root.child(tag))
    return label


def _calibration(node: _Node) -> _Calibration:
    node.refuse_other("KnownConv", CONVENTION, REMEDY)
    _refuse_affinity(node, "OrIntGlob")
    focal, size = float(node.numbers("F", 1)[0]), node.numbers("SzIm", 2)
    pp, radius = node.numbers("PP", 2), float(node.numbers("RayonUtile", 1, (FARTHEST_PX,))[0])
    possible = SMALLEST_POSITIVE <= focal <= FARTHEST_PX and (np.abs(pp) <= FARTHEST_PX).all()
    if not possible or not ((size >= 1) & (size <= FARTHEST_PX) & (size == np.floor(size))).all():
        raise node.error("has values that no camera has")
    models = [_Node(model, node.path) for part in node.children("CalibDistortion") for model in part.element]
    if len(models) > 1:
        raise node.error("has several distortions one after the other, which are not understood", MODELS)
    make = partial(_Calibration, pp, focal, (int(size[0]), int(size[1])), radius_px=radius)
    tag = models[0].element.tag if models else "ModNoDist"
    if tag == "ModNoDist":
        return make(pp, np.zeros(0), np.zeros(4))
    if tag not in ("ModRad", "ModPhgrStd"):
        kind = models[0].text("TypeModele") or tag
        raise node.error(f"its lens {kind[:40]} is not understood", MODELS)
    part, further = models[0], np.zeros(4)
    if tag == "ModPhgrStd":
        further = np.concatenate([models[0].numbers(key, 1, (0.0,)) for key in ("P1", "P2", "b1", "b2")])
        part = models[0].child("RadialePart")
    return make(part.numbers("CDist", 2), _coefficients(part), further)


def _coefficients(part: _Node) -> np.ndarray:
    words = [text_of(found) for found in part.element.findall("CoeffDist")]
    words = [word for word in words if word]
    if not all_numbers(words) or not all(abs(float(word)) <= LARGEST_NUMBER for word in words):
        raise part.error("has a <CoeffDist> that is no number")
    return np.array(words, float)


def _pose(node: _Node) -> tuple[np.ndarray, np.ndarray]:
    """Projection centre, and rotation x right, y down, z forwards → object."""
    outer = node.child("Externe")
    rows = outer.child("ParamRotation").child("CodageMatr")
    matrix = np.concatenate([rows.numbers(f"L{k}", 3) for k in (1, 2, 3)])
    return outer.numbers("Centre", 3), rotation_matrix(matrix, rows.error("holds no rotation"))


def _verify(node: _Node, calibration: _Calibration, centre: np.ndarray, rotation: np.ndarray) -> None:
    """Refuse an orientation whose verification points lie elsewhere with its calibration."""
    points = [place for part in node.children("Verif") for place in part.children("Appuis")]
    if not points:
        return
    xyz = np.array([place.numbers("Ter", 3) for place in points])
    px = np.array([place.numbers("Im", 2) for place in points])
    with np.errstate(all="ignore"):
        x, y, z = rotation.T @ (xyz - centre).T
        off = np.hypot(*(calibration.measured(np.column_stack([x / z, y / z])) - px).T).max()
    if not off <= OFF_PX:
        raise node.error(
            f"its verification points lie up to {off:.2g} px beside", "give the calibration that belongs to it"
        )
