"""Rotations and image coordinates as the package has them.

Angles are ω, φ, κ in radians; the columns of a rotation matrix are the axes of the camera (x right, y up, z towards
the viewer) in the object frame. Image coordinates are mm from the image centre, x right, y up; pixels count to the
right and down from the upper left corner of the image.

>>> import numpy as np
>>> from aerotri import geometry
>>> rotation = geometry.rotation_from_angles(np.radians([0.0, 0.0, 90.0]))
>>> bool(np.allclose(rotation[:, 0], [0.0, 1.0, 0.0]))
True
>>> float(np.degrees(geometry.angles_from_rotation(rotation))[2].round(6))
90.0
>>> geometry.px_from_mm(np.array([[0.0, 0.0]]), (4000, 3000), 0.004).tolist()
[[2000.0, 1500.0]]
"""

from aerotri.conventions import mm_from_px, px_from_mm
from aerotri.functional_model.rotation import angles_from_rotation, rotation_from_angles

__all__ = ["angles_from_rotation", "mm_from_px", "px_from_mm", "rotation_from_angles"]
