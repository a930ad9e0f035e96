"""A clock that is late against GNSS: found with a σ that holds, whether strips have names or not."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

import aerotri
from small_blocks import small_block

LATE_S = 0.05
FLIGHT = {
    "gsd_m": 0.1, "strips": 3, "images_per_strip": 6, "end_lap": 0.6, "side_lap": 0.4, "heading_deg": 30.0,
    "attitude_sigma_deg": [1.0, 1.0, 2.0], "position_sigma_m": [0.0, 0.0, 0.0],
}  # fmt: skip


def late_block(named: bool, seed: int = 1):
    """A block whose positions are those of a moment later, and how fast it was flown."""
    gnss = {"sigma_m": [0.02, 0.02, 0.04], "shift_sigma_m": [0.0, 0.0, 0.0], "lever_arm_m": [0.0, 0.0, 0.0]}
    ties = {"per_image": 25, "probability": 0.9, "sigma_um": 2.0}
    block, truth = small_block(seed, flight=FLIGHT, gnss=gnss, tie_points=ties)
    observed = block.gnss_ins
    assert observed is not None
    velocity = np.zeros_like(observed.xyz)
    for strip in np.unique(block.images.strip.astype(str)):
        own = np.flatnonzero(block.images.strip.astype(str) == strip)
        velocity[own] = np.gradient(truth.centre[own], observed.time[own], axis=0)
    images = block.images if named else replace(block.images, strip=np.full(len(block.images), ""))
    settings = replace(block.settings, gnss=replace(block.settings.gnss, time_offset="block", shift="off"))
    late = replace(observed, xyz=observed.xyz + LATE_S * velocity)
    speed = float(np.median(np.linalg.norm(velocity, axis=1)))
    return replace(block, images=images, gnss_ins=late, settings=settings), speed


@cache
def offset_of(named: bool, seed: int = 1):
    block, speed = late_block(named, seed)
    return *estimated(block), speed


def estimated(block):
    """The offset and its σ, s."""
    parameters = aerotri.adjust(block, parameters="none").parameters
    row = parameters["name"].tolist().index("gnss.time_offset")
    return float(parameters["value"][row]), float(parameters["sigma"][row])


def test_it_is_found():
    """Of three blocks errors are as large as σ, which is at most half more than that of one position over the speed."""
    found = np.array([offset_of(False, seed) for seed in range(1, 4)])
    normalised = (found[:, 0] - LATE_S) / found[:, 1]
    assert np.sqrt(np.mean(normalised**2)) < 2.33
    assert (found[:, 1] < 1.5 * 0.02 / found[:, 2]).all()


def test_names_of_strips_tell_nothing_else():
    """A way from one strip to the next is no velocity, though nothing names the strips."""
    np.testing.assert_allclose(offset_of(False), offset_of(True), rtol=1e-6)


def test_a_time_zone_changes_nothing():
    block, _ = late_block(True)
    assert block.gnss_ins is not None
    other = replace(block, gnss_ins=replace(block.gnss_ins, time=block.gnss_ins.time + 7200.0))
    np.testing.assert_allclose(estimated(other), offset_of(True)[:2], rtol=1e-6)
