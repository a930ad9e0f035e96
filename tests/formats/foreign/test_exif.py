"""EXIF and XMP of photographs."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from aerotri.conventions import InputError
from aerotri.formats.foreign.exif import EXIF_IFD, GPS_IFD, read_exif

XMP = b"""<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:Description drone-dji:RtkFlag="50" drone-dji:RtkStdLon="0.01116"
 drone-dji:RtkStdLat="0.01234" drone-dji:RtkStdHgt="0.02622"/></x:xmpmeta>"""


def photograph(path, own=None, gps=None, size=(80, 60), plain=None, **options):
    image = Image.new("RGB", size)
    exif = image.getexif()
    for tag, value in (plain or {271: "DJI ", 272: "FC\0"}).items():
        exif[tag] = value
    exif.get_ifd(EXIF_IFD).update(own or {})
    exif.get_ifd(GPS_IFD).update(gps or {})
    image.save(path, exif=exif, **options)
    return read_exif(path)


def test_position_and_camera(tmp_path):
    """Degrees, minutes and seconds of the southern and western hemisphere, below the sea, and a pixel of 35 mm film."""
    gps = {1: "S", 2: (46.0, 50.0, 33.3855), 3: "W", 4: (91.0, 59.0, 40.4156), 5: b"\x01", 6: 12.5}
    tags = photograph(tmp_path / "a.jpg", {37386: 3.61, 41989: 20}, gps)
    assert (tags.make, tags.model, tags.size_px) == ("DJI", "FC", (80, 60))
    np.testing.assert_allclose(tags.lon_lat_height, [-91.99455989, -46.84260708, -12.5], atol=1e-8)
    assert not tags.ellipsoidal
    assert tags.focal_length_mm == pytest.approx(3.61)
    assert tags.pixel_um == pytest.approx(1e3 * 36.0 * 3.61 / 20.0 / 80.0)
    assert np.isnan(tags.sigma_m).all()


def test_time(tmp_path):
    """When the photograph was taken, with the fraction of a second where it is told; nothing where it is no time."""
    whole = photograph(tmp_path / "a.jpg", {36867: "2016:06:23 16:31:59"}).time
    assert whole % 86400.0 == 16 * 3600 + 31 * 60 + 59
    assert photograph(tmp_path / "b.jpg", {36867: "2016:06:23 16:31:59", 37521: "25"}).time == whole + 0.25
    assert np.isnan(photograph(tmp_path / "c.jpg", {36867: "0000:00:00 00:00:00"}).time)
    assert np.isnan(photograph(tmp_path / "d.jpg").time)


def test_pixel_of_the_focal_plane_belongs_to_the_size_as_taken(tmp_path):
    """3.3 µm, of a photograph reduced to half."""
    own = {37386: 35.0, 41989: 35, 41486: 1.0 / 3.3e-4, 41488: 3, 40962: 160, 40963: 120}
    assert photograph(tmp_path / "a.jpg", own).pixel_um == pytest.approx(6.6, rel=1e-4)


@pytest.mark.parametrize(("reference", "height", "ellipsoidal"), [(0, 7.0, False), (2, 7.0, True), (3, -7.0, True)])
def test_height_references(tmp_path, reference, height, ellipsoidal):
    gps = {1: "N", 2: (10.0, 0.0, 0.0), 3: "E", 4: (20.0, 0.0, 0.0), 5: bytes([reference]), 6: 7.0}
    tags = photograph(tmp_path / "a.jpg", {}, gps)
    assert tags.lon_lat_height.tolist() == [20.0, 10.0, height]
    assert tags.ellipsoidal is ellipsoidal


def test_standard_deviations(tmp_path):
    gps = {1: "N", 2: (10.0, 0.0, 0.0), 3: "E", 4: (20.0, 0.0, 0.0), 5: b"\x00", 6: 7.0, 31: 4.0}
    assert photograph(tmp_path / "a.jpg", {}, gps).sigma_m.tolist() == [4.0, 4.0, 6.0]
    assert photograph(tmp_path / "b.jpg", {}, gps, xmp=XMP).sigma_m.tolist() == [0.01116, 0.01234, 0.02622]


@pytest.mark.parametrize(
    "gps",
    [
        {1: "N", 2: (0.0, 0.0, 0.0), 3: "E", 4: (0.0, 0.0, 0.0), 6: 7.0},
        {1: "N", 2: (95.0, 0.0, 0.0), 3: "E", 4: (1.0, 0.0, 0.0), 6: 7.0},
        {1: "N", 2: (10.0, 0.0, 0.0), 6: 7.0},
    ],
    ids=["null island", "beyond the pole", "no longitude"],
)
def test_positions_that_are_none(tmp_path, gps):
    assert np.isnan(photograph(tmp_path / "a.jpg", {}, gps).lon_lat_height).all()


@pytest.mark.parametrize(
    "altitude", [{}, {6: IFDRational(0, 0)}, {5: b"\x02"}], ids=["none", "no number", "reference alone"]
)
def test_longitude_and_latitude_without_a_height(tmp_path, altitude):
    tags = photograph(tmp_path / "a.jpg", {}, {1: "N", 2: (10.0, 0.0, 0.0), 3: "W", 4: (1.0, 30.0, 0.0), **altitude})
    np.testing.assert_array_equal(tags.lon_lat_height, [-1.5, 10.0, np.nan])
    assert not tags.ellipsoidal


def test_files_without_tags_and_no_files(tmp_path):
    """A TIFF of four 16 bit bands is beyond Pillow; what is no image is refused with its name."""
    from aerotri.rasters.images import create_image

    with create_image(tmp_path / "a.tif", 20, 10, 4, "uint16") as writer:
        writer.write(0, np.zeros((4, 10, 20), np.uint16))
    tags = read_exif(tmp_path / "a.tif")
    assert tags.size_px == (20, 10)
    assert tags.focal_length_mm is None
    (tmp_path / "b.jpg").write_bytes(b"no photograph")
    with pytest.raises(InputError, match=r"b\.jpg"):
        read_exif(tmp_path / "b.jpg")


def test_real_photograph(shared_data):
    """data/brighton: what `exiftool` says of DJI_0018.JPG (46°50'33.3855" N, 91°59'40.4156" W, 198.309 m)."""
    tags = read_exif(shared_data("brighton") / "images" / "DJI_0018.JPG")
    assert (tags.model, tags.size_px, tags.focal_length_mm) == ("FC300S", (2800, 1575), 3.61)
    np.testing.assert_allclose(tags.lon_lat_height, [-91.994559889, 46.842607083, 198.309], atol=2e-9)


@pytest.mark.parametrize(
    ("flag", "more", "quality", "ellipsoidal", "sigma"),
    [
        (50, "", "fixed", True, (0.01116, 0.01234, 0.02622)),
        (34, "", "float", True, (0.01116, 0.01234, 0.02622)),
        (16, "", "single point", False, (1.5, 1.5, 3.0)),
        (0, "", "single point", False, (1.5, 1.5, 3.0)),
        (16, ' drone-dji:AltitudeType="RtkAlt"', "single point", True, (1.5, 1.5, 3.0)),
        (50, ' drone-dji:AltitudeType="GpsFusionAlt"', "fixed", False, (0.01116, 0.01234, 0.02622)),
    ],
)
def test_solution_of_rtk(tmp_path, flag, more, quality, ellipsoidal, sigma):
    """σ of XMP for what is solved, that of code alone for a single point; heights of RTK count from the ellipsoid."""
    xmp = XMP.replace(b'RtkFlag="50"', f'RtkFlag="{flag}"{more}'.encode())
    gps = {1: "N", 2: (10.0, 0.0, 0.0), 3: "E", 4: (20.0, 0.0, 0.0), 5: b"\x00", 6: 512.0}
    tags = photograph(tmp_path / "a.jpg", {}, gps, xmp=xmp)
    assert (tags.quality, tags.ellipsoidal) == (quality, ellipsoidal)
    assert tuple(tags.sigma_m) == sigma
