"""A small block as text that tests change, and whether two blocks say the same."""

from __future__ import annotations

import numpy as np

from aerotri.observations import Block

BLOCK_TOML = """\
name = "small"
image_unit = "mm"

[camera.cam]
size_px = [10000, 8000]
pixel_um = 10.0
focal_length_mm = 100.0

[stochastic]
image_sigma_um = 2.0
default_control_sigma_m = [0.1, 0.2, 0.3]

[adjustment]
robust = "off"
"""
FILM_TOML = BLOCK_TOML.replace('"mm"', '"px"').replace(
    "[stochastic]",
    """interior_orientation = "affine"
[camera.cam.fiducials]
F1 = [-49.0, 39.0]
F2 = [49.0, 39.0]
F3 = [49.0, -39.0]
F4 = [-49.0, -39.0]
[stochastic]""",
)
IMAGES = """\
image,camera,strip,day,X0,Y0,Z0,omega,phi,kappa
a,cam,1,mon,1,2,1000,0,0,90
b,cam,1,tue,101,2,1000,,,
"""
IMAGE_POINTS = """\
image,point,x,y
a,p1,10.5,-3.25
a,p2,1,2
b,p1,-10.5,3.25
b,p2,-3,-4
"""
CONTROL = """\
point,X,Y,Z,sX,sY,sZ,role
p1,500000.5,5700000.25,100,0.02,0.02,0.04,control
p9,,,120,,,,check
"""
GNSS = """\
image,X,Y,Z,sX,sY,sZ,omega,phi,kappa,s_omega,s_phi,s_kappa,time
a,1.5,2.5,1001,0.05,0.05,0.1,0.1,0.2,90,0.01,0.01,0.02,17.5
b,101.5,2.5,1001,0.05,0.05,0.1,,,,,,,18.5
"""
SMALL = {
    "block.toml": BLOCK_TOML,
    "images.csv": IMAGES,
    "image_points.csv": IMAGE_POINTS,
    "control.csv": CONTROL,
    "gnss_ins.csv": GNSS,
}


def assert_same_block(found: Block, expected: Block, angle_tolerance: float = 1e-12) -> None:
    """Everything equal to the bit, but for angles, whose unit in the file is another one."""
    assert found.name == expected.name
    assert (found.crs, found.rotation) == (expected.crs, expected.rotation)
    assert found.cameras == expected.cameras
    assert found.settings == expected.settings
    assert found.points.tolist() == expected.points.tolist()
    a, b = found.images, expected.images
    assert a.names.tolist() == b.names.tolist()
    assert a.strip.tolist() == b.strip.tolist()
    assert {k: v.tolist() for k, v in a.columns.items()} == {k: v.tolist() for k, v in b.columns.items()}
    np.testing.assert_array_equal(a.camera, b.camera)
    np.testing.assert_array_equal(a.centre, b.centre)
    np.testing.assert_allclose(a.angles, b.angles, rtol=angle_tolerance, atol=0)
    for name in ("image", "point", "xy", "sigma"):
        np.testing.assert_array_equal(getattr(found.image_points, name), getattr(expected.image_points, name))
    for name in ("edits", "constraints", "fiducials"):
        assert_same_record(getattr(found, name), getattr(expected, name))
    for name in ("point", "xyz", "sigma", "is_check"):
        np.testing.assert_array_equal(getattr(found.control, name), getattr(expected.control, name))
    assert (found.gnss_ins is None) == (expected.gnss_ins is None)
    if found.gnss_ins is not None and expected.gnss_ins is not None:
        for name in ("image", "xyz", "sigma", "time"):
            np.testing.assert_array_equal(getattr(found.gnss_ins, name), getattr(expected.gnss_ins, name))
        for name in ("angles", "angles_sigma"):
            one, other = getattr(found.gnss_ins, name), getattr(expected.gnss_ins, name)
            np.testing.assert_allclose(one, other, rtol=angle_tolerance, atol=0)


def assert_same_record(found, expected) -> None:
    """Two records of arrays, or nothing twice."""
    assert (found is None) == (expected is None)
    for name in () if expected is None else expected.__dataclass_fields__:
        one, other = getattr(found, name), getattr(expected, name)
        if isinstance(other, tuple):
            assert [part.tolist() for part in one] == [part.tolist() for part in other]
        else:
            np.testing.assert_array_equal(one, other)


def damaged(data, raw: bytes) -> bytes:
    """Bytes with some cut off, changed, put in or removed, drawn from hypothesis' `data`."""
    from hypothesis import strategies as st

    found = bytearray(raw)
    bits = [b",", b'"', b"\n", b"\r", b"#", b" ", b"=", b"\xff", b"-", b"9", b"e", b"\x00", b".", b"-99", b"nan", b"\t"]
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, max(len(found) - 1, 0)))
        kind = data.draw(st.sampled_from(["cut", "change", "insert", "remove", "line"]))
        some = data.draw(st.sampled_from(bits))
        if kind == "cut":
            del found[at:]
        elif kind == "remove":
            del found[at : at + data.draw(st.integers(1, 9))]
        elif kind == "insert":
            found[at:at] = some
        elif kind == "line":
            found[at:at] = found[at : at + data.draw(st.integers(1, 60))]
        else:
            found[at : at + 1] = some
    return bytes(found)
