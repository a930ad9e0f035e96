"""σ of image coordinates by camera: cameras with pixels of different sizes."""

from types import SimpleNamespace

import numpy as np
import pytest

from aerotri.statistics import image_sigma
from aerotri.statistics.image_sigma import image_sigma_of_cameras
from aerotri.volume.parts import matching_sigma_mm
from aerotri.volume.pickets import pickets_of_names
from aerotri.volume.settings import SigmaOptions

PIXEL_MM = np.array([3.76e-3, 9e-3, 5e-3])
SIGMA_PX, SIGMA0 = 0.5, 1.2


def calibration_of(share):
    """A share of 1000 rays is of the first camera, the others of the second; the third has none."""
    camera = (np.arange(1000) >= share * 1000).astype(int)
    sigma = np.repeat((SIGMA_PX * PIXEL_MM)[camera][:, None], 2, axis=1)
    rays = SimpleNamespace(image=camera, sigma=sigma)
    images = SimpleNamespace(names=np.array(["a", "b", "c"]), camera=np.arange(3))

    class Rays(SimpleNamespace):
        def __len__(self):
            return len(self.sigma)

    block = SimpleNamespace(image_points=Rays(**vars(rays)), images=images, cameras=[None] * 3)
    return SimpleNamespace(local=SimpleNamespace(block=block, outcome=SimpleNamespace(sigma0=SIGMA0)))


@pytest.fixture(autouse=True)
def no_field(monkeypatch):
    """Nothing but noise in the residuals."""
    monkeypatch.setattr(image_sigma, "noise_beside_field", lambda found: found.local.outcome.sigma0)


@pytest.mark.parametrize("share", [0.4, 0.6])
def test_every_camera_has_its_own_sigma(share):
    found = image_sigma_of_cameras(calibration_of(share))
    np.testing.assert_allclose(found[:2] / PIXEL_MM[:2], SIGMA0 * SIGMA_PX)
    # a camera without image points has that of all
    assert found[2] == found[int(share < 0.5)]


def test_rays_of_points_have_the_sigma_of_their_camera():
    calibration = calibration_of(0.6)
    sigma = matching_sigma_mm(calibration, SigmaOptions())
    pickets = pickets_of_names(calibration.local.block, np.zeros((2, 3)), [["a", "b"], ["b", "a"]], sigma)
    np.testing.assert_allclose(pickets.sigma_mm / PIXEL_MM[[0, 1, 1, 0]], SIGMA0 * SIGMA_PX)
    stated = matching_sigma_mm(calibration, SigmaOptions(matching_sigma_um=2.0))
    pickets = pickets_of_names(calibration.local.block, np.zeros((2, 3)), [["a", "b"], ["b", "a"]], stated)
    np.testing.assert_array_equal(pickets.sigma_mm, 2e-3)
