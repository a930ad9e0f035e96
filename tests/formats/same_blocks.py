"""Whether two blocks say the same."""

from __future__ import annotations

import numpy as np

from aerotri.observations import Block


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
    for name in ("point", "xyz", "sigma", "is_check"):
        np.testing.assert_array_equal(getattr(found.control, name), getattr(expected.control, name))
    assert (found.gnss_ins is None) == (expected.gnss_ins is None)
    if found.gnss_ins is not None and expected.gnss_ins is not None:
        for name in ("image", "xyz", "sigma", "time"):
            np.testing.assert_array_equal(getattr(found.gnss_ins, name), getattr(expected.gnss_ins, name))
        for name in ("angles", "angles_sigma"):
            one, other = getattr(found.gnss_ins, name), getattr(expected.gnss_ins, name)
            np.testing.assert_allclose(one, other, rtol=angle_tolerance, atol=0)
