"""MicMac's orientations: positions by its formulas against those of the block, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import aerotri
from aerotri.conventions import InputError, px_from_mm
from aerotri.formats.convert import detect_format
from aerotri.formats.foreign.micmac import read_micmac
from aerotri.functional_model.additional_parameters import lens
from aerotri.functional_model.rotation import rotation_from_angles
from formats.foreign.metashape_sample import ANGLES, CENTRES, Sample

SIZE, FOCAL, PP = (4000, 3000), 2400.5, (2011.2, 1493.7)
RADIAL = (-1.1e-8, 2.3e-15, -1.9e-22)
FRASER = {"P1": 2.1e-7, "P2": -1.3e-7, "b1": 6.6e-4, "b2": -2.2e-4}
POINTS = Sample().points
MICMAC_FROM_CAMERA = np.diag([1.0, -1.0, -1.0])


def measured(k: int, centre: tuple[float, float], fraser: bool) -> np.ndarray:
    """(n, 2) column and row of the points in a photograph, one point after the other."""
    found = []
    p1, p2, b1, b2 = FRASER.values() if fraser else (0, 0, 0, 0)
    for point in POINTS:
        x, y, z = MICMAC_FROM_CAMERA @ rotation_from_angles(ANGLES)[k].T @ (point - CENTRES[k])
        column, row = PP[0] + FOCAL * x / z, PP[1] + FOCAL * y / z
        dx, dy = column - centre[0], row - centre[1]
        r2 = dx**2 + dy**2
        scale = sum(c * r2 ** (n + 1) for n, c in enumerate(RADIAL))
        column += dx * scale + p1 * (2 * dx**2 + r2) + 2 * p2 * dx * dy + b1 * dx + b2 * dy
        row += dy * scale + p2 * (2 * dy**2 + r2) + 2 * p1 * dx * dy
        found.append((column, row))
    return np.array(found)


def calibration(centre: tuple[float, float] = PP, fraser: bool = True) -> str:
    radial = f"<CDist>{centre[0]} {centre[1]}</CDist>" + "".join(f"<CoeffDist>{c}</CoeffDist>" for c in RADIAL)
    terms = "".join(f"<{key}>{value}</{key}>" for key, value in FRASER.items())
    model = (
        f"<ModPhgrStd><RadialePart>{radial}</RadialePart>{terms}</ModPhgrStd>"
        if fraser
        else f"<ModRad>{radial}</ModRad>"
    )
    return (
        f"<KnownConv>eConvApero_DistM2C</KnownConv><PP>{PP[0]} {PP[1]}</PP><F>{FOCAL}</F>"
        f"<SzIm>{SIZE[0]} {SIZE[1]}</SzIm><CalibDistortion>{model}</CalibDistortion>"
    )


def orientation(k: int, inside: str, verified: np.ndarray) -> str:
    """The file of a photograph; `inside` names or holds the calibration."""
    rows = rotation_from_angles(ANGLES)[k] @ MICMAC_FROM_CAMERA
    matrix = "".join(f"<L{n}>{' '.join(map(repr, row))}</L{n}>" for n, row in enumerate(rows.tolist(), 1))
    points = "".join(
        f"<Appuis><Num>{n}</Num><Im>{px[0]} {px[1]}</Im><Ter>{xyz[0]} {xyz[1]} {xyz[2]}</Ter></Appuis>"
        for n, (px, xyz) in enumerate(zip(verified.tolist(), POINTS.tolist(), strict=True))
        if n < 10
    )
    return (
        "<ExportAPERO><OrientationConique><OrIntImaM2C><I00>0 0</I00><V10>1 0</V10><V01>0 1</V01></OrIntImaM2C>"
        f"<TypeProj>eProjStenope</TypeProj>{inside}<Externe><Centre>{' '.join(map(repr, CENTRES[k].tolist()))}</Centre>"
        f"<ParamRotation><CodageMatr>{matrix}</CodageMatr></ParamRotation></Externe><Verif>{points}</Verif>"
        "<ConvOri><KnownConv>eConvApero_DistM2C</KnownConv></ConvOri></OrientationConique></ExportAPERO>"
    )


def files(centre: tuple[float, float] = PP, fraser: bool = True, inline: bool = False) -> dict[str, bytes]:
    """Content by path of a folder of three photographs."""
    name = "AutoCal_Foc-9600_Cam-X.xml"
    inside = (
        f"<Interne>{calibration(centre, fraser)}</Interne>" if inline else f"<FileInterne>Ori-Site/{name}</FileInterne>"
    )
    found = {
        f"Ori-Site/Orientation-DJI_{k}.JPG.xml": orientation(k, inside, measured(k, centre, fraser)) for k in range(3)
    }
    if not inline:
        whole = calibration(centre, fraser)
        found[f"Ori-Site/{name}"] = (
            f"<ExportAPERO><CalibrationInternConique>{whole}</CalibrationInternConique></ExportAPERO>"
        )
    return {path: f'<?xml version="1.0" ?>\n{text}\n'.encode() for path, text in found.items()}


def written(folder: Path, content: dict[str, bytes]) -> Path:
    (folder / "Ori-Site").mkdir()
    for path, raw in content.items():
        (folder / path).write_bytes(raw)
    return folder / "Ori-Site"


@pytest.mark.parametrize(
    ("centre", "fraser", "inline", "close"),
    [
        (PP, True, False, 0.01),  # MicMac's affinity acts on the ideal position, ours on the distorted one
        (PP, False, False, 1e-6),
        (PP, False, True, 1e-6),
        ((2013.0, 1491.0), False, False, 0.05),
    ],
)
def test_positions(tmp_path, centre, fraser, inline, close):
    path = written(tmp_path, files(centre, fraser, inline))
    assert detect_format(path) == "micmac"
    reading = aerotri.read(path, pixel_um=4.0)
    block, camera = reading.block, reading.block.cameras[0]
    assert block.images.names.tolist() == ["DJI_0.JPG", "DJI_1.JPG", "DJI_2.JPG"]
    assert len(block.cameras) == 1
    assert len(block.points) == 0
    assert any("the nearest lens of MicMac's" in text for text in reading.messages) == (close > 1e-6)
    for k in range(3):
        rotation = rotation_from_angles(block.images.angles[k : k + 1])[0]
        x, y, z = rotation.T @ (POINTS - block.images.centre[k]).T
        at = lens.bend(x / -z, y / -z, lens.vector_of(camera)) * camera.focal_length_mm + camera.principal_point_mm
        px, wanted = px_from_mm(at, camera.size_px, camera.pixel_mm), measured(k, centre, fraser)
        seen = (wanted > 0).all(axis=1) & (wanted < SIZE).all(axis=1)
        assert seen.sum() > 5
        np.testing.assert_allclose(px[seen], wanted[seen], atol=close)
    assert any("--image-points" in text for text in reading.messages)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("<TypeProj>eProjStenope", "<TypeProj>eProjOrthographique", "is not understood"),
        ("DistM2C</KnownConv></ConvOri>", "DistC2M</KnownConv></ConvOri>", "its convention is 'eConvApero_DistC2M'"),
        ("<V10>1 0", "<V10>0 1", "turns or scales the image"),
        ("Cam-X.xml</FileInterne>", "Cam-Y.xml</FileInterne>", "which is not beside it"),
        ("<L1>", "<L1>2 ", "no <L1> of 3 numbers"),
        (f"<F>{FOCAL}</F>", "<F>2300</F>", "its verification points lie up to"),
        ("ModPhgrStd", "ModFish", "its lens ModFish is not understood"),
        ("</CalibDistortion>", "</CalibDistortion><CalibDistortion><ModRad/></CalibDistortion>", "several distortions"),
    ],
)
def test_what_is_refused(tmp_path, old, new, says):
    content = {name: raw.replace(old.encode(), new.encode()) for name, raw in files().items()}
    assert content != files()
    with pytest.raises(InputError, match=says) as caught:
        read_micmac(written(tmp_path, content))
    assert caught.value.file
    assert caught.value.remedy
