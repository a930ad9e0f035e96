"""Photographs of a rolling shutter, corrected: ground is measured in them as if a row were exposed like all others."""

from __future__ import annotations

import numpy as np
import pytest

import aerotri

pytestmark = pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")

PLAN = {
    "name": "rolling",
    "camera": {
        "cam": {
            "size_px": [480, 360], "pixel_um": 20.0, "focal_length_mm": 8.8, "flight_axis": "+y",
            "rolling_shutter": {"readout_ms": 60.0},
        }
    },
    "flight": {
        "gsd_m": 0.2, "strips": 2, "images_per_strip": 4, "end_lap": 0.7, "side_lap": 0.6, "speed_m_s": 12.0,
        "cross_strips": [{"position": 0.5, "images": 3}],
    },
    "terrain": {"kind": "undulating", "relief_rms_m": 0.5, "wavelength_m": 40.0},
    "tie_points": {"per_image": 60, "probability": 0.9, "sigma_um": 2.0},
    "control": {"distance_bases": 1.0, "sigma_m": [0.01, 0.01, 0.01]},
    "gnss": {"sigma_m": [0.02, 0.02, 0.02]},
}  # fmt: skip
AREA = (-20.0, -20.0, 20.0, 20.0)
INTERVAL_M = 5.0


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """Rendered photographs of a readout that moves the last row by some 3.6 px, and their adjustment."""
    folder = tmp_path_factory.mktemp("rolling")
    flight = aerotri.simulate(PLAN, seed=2)
    flight.save(folder / "flown", photographs=True)
    result = aerotri.adjust(flight.block, parameters="none")
    assert result.adjusted.outcome.status == "converged"
    return folder, flight, result


def terrain(result, photographs, **options):
    return aerotri.terrain(result, photographs, interval=INTERVAL_M, area=AREA, **options)


def test_the_same_ground_is_measured_in_corrected_photographs(flown):
    """Rows minded while matching, or resampled away before: one surface; left in, it is another."""
    folder, _, result = flown
    photographs = folder / "flown" / "photographs"
    own = terrain(result, photographs)
    free = aerotri.ideal_photographs(result, photographs, folder / "ideal")
    assert len(free.photographs) == len(result.adjusted.block.images)
    ideal = terrain(result, free.folder, ideal=True)
    left_in = terrain(result, photographs, ideal=True)
    sigma = float(np.nanmedian(own.dsm.sigma))
    found, wrong = aerotri.compare(ideal, own), aerotri.compare(left_in, own)
    assert found.coverage > 0.9
    assert abs(found.bias) < sigma
    assert found.rmse < 3.0 * sigma
    assert wrong.rmse > 3.0 * found.rmse


def test_other_processes_make_the_same_photographs(flown):
    """Every photograph has a map of its own, which goes to the process with it."""
    folder, _, result = flown
    photographs = sorted((folder / "flown" / "photographs").glob("*.tif"))[:2]
    own = aerotri.ideal_photographs(result, photographs, folder / "own")
    apart = aerotri.ideal_photographs(result, photographs, folder / "apart", executor="processes:2")
    for name in own.photographs["written"]:
        assert (own.folder / name).read_bytes() == (apart.folder / name).read_bytes()
    left = [[one["relief_rms_px"] for one in found.summary["photographs"]] for found in (own, apart)]
    assert left[0] == left[1]
