"""A trajectory at the times of photographs: interpolated, moved to the camera, and given to the photograph it means."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from gnss_files import START, WEEK, cameras, grafnav, mrk, places, rtklib
from pyproj import Transformer

import aerotri
from aerotri.conventions import InputError
from aerotri.coordinates.ellipsoid import metres_of_units
from aerotri.formats.assembly.by_stamps import named_by_stamps
from aerotri.formats.assembly.interpolation import interpolated
from aerotri.formats.assembly.kinds import ReadingOptions, read_position_list
from aerotri.formats.assembly.timed import Trajectory
from aerotri.formats.foreign.gnss_time import WEEK_S
from places import SHARED_DATA

EPOCHS = np.arange(0.0, 60.0, 0.2)
TAKEN = 4.03 + 2.21 * np.arange(22)
"""s after the first epoch; none falls on one."""
TAKEN[11:] += 3.4
CRS = "EPSG:25832"
NAMES = np.array([f"DJI_20221106125411_{k:04d}_V.JPG" for k in range(1, len(TAKEN) + 1)])
CLOCK = WEEK * WEEK_S + START + 7 * 3600.0 - 0.4
"""The camera's clock in a time zone, s; EXIF cuts the fraction off."""


def exif(taken):
    return np.floor(taken + CLOCK)


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """The files of a flight, in a folder of the drone."""
    folder = tmp_path_factory.mktemp("flight")
    files = {
        "flight.pos": rtklib(EPOCHS), "flight.txt": grafnav(EPOCHS), "flight.MRK": mrk(TAKEN, error=0.0),
        "single.MRK": mrk(TAKEN, code=16), "late.MRK": mrk(TAKEN, error=18.0), "events.pos": rtklib(TAKEN),
        "nothing": "", "photographs.txt": "".join(f"{name} 0 0 0 0 0 0\n" for name in NAMES),
    }  # fmt: skip
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    (folder / "nothing").unlink()
    return SimpleNamespace(**{name.replace(".", "_"): folder / name for name in files}, folder=folder)


def read(flown, positions, time_stamps=None, **more):
    stated = {"camera_name": "P1", "camera_size": (8192, 5460), "pixel_um": 4.4, "focal_length_mm": 35.0, "crs": CRS}
    return aerotri.read(flown.photographs_txt, positions=positions, time_stamps=time_stamps, **(stated | more))


def truth(taken=TAKEN):
    x, y = Transformer.from_crs("EPSG:4258", CRS, always_xy=True).transform(*cameras(taken)[:, :2].T)
    return np.column_stack([x, y, cameras(taken)[:, 2]])


@pytest.mark.parametrize("file", ["flight_pos", "flight_txt"])
def test_positions_of_the_camera(flown, file):
    """Interpolated between epochs and moved to the camera they are right to 2 mm, and the heights' system is said."""
    found = read(flown, getattr(flown, file), flown.flight_MRK)
    observed = found.block.gnss_ins
    assert observed is not None
    assert observed.image.tolist() == list(range(len(TAKEN)))
    np.testing.assert_allclose(observed.xyz, truth(), atol=2e-3)
    assert (observed.sigma > 0.009).all()
    assert (observed.sigma < 0.04).all()
    np.testing.assert_allclose(np.diff(observed.time), np.diff(TAKEN), atol=1e-5)
    said = " ".join(found.messages)
    assert "22 fixed" in said
    assert "mm east, north, up" in said
    assert "names no system of heights" in said
    assert "datum of EPSG:25832" in said


def test_time_stamps_alone(flown):
    """A fixed solution of the drone is used as it is; one of code alone gets the σ that it has, whatever is stated."""
    observed = read(flown, flown.flight_MRK).block.gnss_ins
    np.testing.assert_allclose(observed.xyz, truth(), atol=2e-3)
    np.testing.assert_allclose(observed.sigma, np.broadcast_to([0.012, 0.013, 0.027], observed.sigma.shape))
    found = read(flown, flown.single_MRK)
    assert (found.block.gnss_ins.sigma == [1.5, 1.5, 3.0]).all()
    assert any("single point positions" in text for text in found.messages)


def test_events_are_positions_in_the_order_of_photographs(flown):
    found = read(flown, flown.events_pos)
    antenna = places(TAKEN)
    x, y = Transformer.from_crs("EPSG:4258", CRS, always_xy=True).transform(*antenna[:, :2].T)
    np.testing.assert_allclose(found.block.gnss_ins.xyz, np.column_stack([x, y, antenna[:, 2]]), atol=1e-3)
    assert any("lever" in text for text in found.messages)


@pytest.mark.parametrize(
    ("positions", "stamps", "words"),
    [
        ("flight_pos", "", "--time-stamps"),
        ("flight_pos", "late_MRK", "clock"),
        ("flight_pos", "flight_txt", "no file of time stamps"),
        ("flight_MRK", "flight_MRK", "is no trajectory"),
        ("", "flight_MRK", "no trajectory"),
        ("nothing", "flight_MRK", "no such file"),
    ],
)
def test_what_does_not_belong_together_is_refused(flown, positions, stamps, words):
    with pytest.raises(InputError, match=words):
        read(flown, getattr(flown, positions, None), getattr(flown, stamps, None))


def test_another_day_is_refused_with_both_times(flown, tmp_path):
    path = tmp_path / "other.MRK"
    path.write_text(flown.flight_MRK.read_text().replace("[2235]", "[2236]"))
    with pytest.raises(InputError, match=r"covers no time stamp .*2022-11-06.*2022-11-13"):
        read(flown, flown.flight_pos, path)


def test_datum_of_older_surveys_is_refused(flown):
    with pytest.raises(InputError, match="different datums"):
        read(flown, flown.flight_pos, flown.flight_MRK, crs="EPSG:31468")


def listed(flown):
    return read_position_list(str(flown.flight_pos), ReadingOptions(), str(flown.flight_MRK))


def stamps_of(flown, names, time):
    """Which time stamp every photograph got, −1 for none, and what was said."""
    whole = listed(flown)
    found = named_by_stamps(whole, names, time)
    by_name = dict(zip(found.images.tolist(), found.xyz, strict=True))
    index = [int(np.argmin(np.abs(whole.xyz - by_name[n]).sum(axis=1))) if n in by_name else -1 for n in names.tolist()]
    return index, " ".join(found.messages)


def test_numbers_in_names(flown):
    """Photographs 1, 2 and 9 are missing, one has no time stamp: all others have their own."""
    keep = np.setdiff1d(np.arange(22), [0, 1, 8])
    names = np.append(NAMES[keep], "DJI_20221106125411_0023_V.JPG")
    index, said = stamps_of(flown, names, np.append(exif(TAKEN)[keep], exif(TAKEN[-1] + 2.2)))
    assert index == [*keep.tolist(), -1]
    assert "no time stamp: DJI_20221106125411_0023_V.JPG" in said
    assert "no photograph: number 1, number 2, number 9" in said


def test_renumbered_photographs_go_by_their_times(flown):
    """Two were deleted and the rest numbered anew: numbers would shift them, times do not."""
    keep = np.setdiff1d(np.arange(22), [0, 8])
    names = np.array([f"IMG_{k + 1:04d}.JPG" for k in range(len(keep))])
    index, said = stamps_of(flown, names, exif(TAKEN)[keep])
    assert index == keep.tolist()
    assert "matched by their times" in said
    assert "number 1, number 9" in said


def test_cameras_of_one_exposure_share_a_time_stamp(flown):
    names = np.array([n.replace("_V", letter) for n in NAMES for letter in ("_W", "_T")])
    index, _ = stamps_of(flown, names, np.full(44, np.nan))
    assert index == np.repeat(np.arange(22), 2).tolist()


def test_one_time_that_is_off_is_named(flown):
    time = exif(TAKEN)
    time[4] += 60.0
    index, said = stamps_of(flown, NAMES, time)
    assert index[4] == -1
    assert index[5] == 5
    assert NAMES[4] in said


def test_names_without_numbers_need_as_many_time_stamps(flown):
    names = np.array([f"photo_{chr(97 + k)}" for k in range(22)])
    index, said = stamps_of(flown, names, np.full(22, np.nan))
    assert index == list(range(22))
    assert "in the order of their names" in said
    with pytest.raises(InputError, match="22 time stamps for 21 photographs"):
        named_by_stamps(listed(flown), names[:-1], np.full(21, np.nan))


def test_photographs_in_gaps_and_outside_get_no_position(flown, tmp_path):
    """Their names and the reason are said; the others keep theirs, and σ grows in a short gap."""
    rows = flown.flight_pos.read_text().splitlines()
    first = len(rows) - len(EPOCHS)
    gone = ((EPOCHS > 12.0) & (EPOCHS < 16.0)) | ((EPOCHS > 20.0) & (EPOCHS < 26.0)) | (EPOCHS < 5.0)
    path = tmp_path / "gaps.pos"
    path.write_text("\n".join([*rows[:first], *(row for row, out in zip(rows[first:], gone, strict=True) if not out)]))
    found = read(flown, path, flown.flight_MRK)
    observed, said = found.block.gnss_ins, " ".join(found.messages)
    without = np.flatnonzero((TAKEN < 5.0) | ((TAKEN > 20.0) & (TAKEN < 26.0)))
    assert observed.image.tolist() == np.setdiff1d(np.arange(22), without).tolist()
    assert f"{NAMES[0]} (1.0 s before the first epoch)" in said
    assert "in a gap of 6.0 s" in said
    in_gap = int(np.flatnonzero((TAKEN[observed.image] > 12.5) & (TAKEN[observed.image] < 15.5))[0])
    apart = np.abs(observed.xyz - truth()[observed.image])
    assert observed.sigma[in_gap, 0] > 1.3 * np.median(observed.sigma[:, 0])
    assert (apart < 3.0 * observed.sigma).all()


def test_error_of_interpolation_is_that_of_epochs_left_out():
    """Of a path that shakes by centimetres at 2 Hz, seen at 5 Hz: the stated error is the true one within a third."""
    rng = np.random.default_rng(1)
    time, base = np.arange(0.0, 120.0, 0.04), places(np.zeros(1))[0]
    phase = rng.uniform(0.0, 2 * np.pi, 3)
    shake = 0.03 * np.sin(2 * np.pi * 1.0 * time[:, None] + phase) + rng.normal(0.0, 1e-3, (len(time), 3))
    place = base + (shake + np.outer(time, [5.0, 3.0, 0.1])) / metres_of_units(base[None])
    epochs = np.arange(0, len(time), 5)
    path = Trajectory(None, time[epochs], place[epochs], np.full((len(epochs), 3), 1e-3), np.full(len(epochs), "fixed"))
    between = np.setdiff1d(np.arange(100, len(time) - 100), epochs)
    found = interpolated(path, time[between])
    error = (found.place - place[between]) * metres_of_units(base[None])
    ratio = np.sqrt(np.mean(error**2, axis=0) / np.mean(found.sigma**2 + 1e-6, axis=0))
    assert (ratio > 0.5).all()
    assert (ratio < 1.33).all()


def test_real_flight():
    """Epochs of a real flight left out: errors are as large as their σ says; all time stamps get a position."""
    folder = SHARED_DATA / "ppk"
    if not folder.is_dir():
        pytest.skip(f"{folder} is not there")
    from aerotri.formats.foreign.grafnav import read_grafnav

    path = read_grafnav(folder / "m300_grafnav_5hz.txt")
    keep = np.arange(0, len(path), 3)
    left = np.setdiff1d(np.arange(4000, 9000, 7), keep)
    found = interpolated(path.at(keep), path.time[left])
    error = (found.place - path.place[left]) * metres_of_units(path.place[left])
    assert np.sqrt(np.mean(error**2, axis=0)).max() < 0.02
    ratio = np.sqrt(np.mean(error**2, axis=0) / np.mean(found.error**2, axis=0))
    assert (ratio > 0.5).all()
    assert (ratio < 1.5).all()
    whole = read_position_list(
        str(folder / "m300_grafnav_5hz.txt"), ReadingOptions(), str(folder / "m300_timestamp.mrk")
    )
    assert len(whole.images) == 586
    assert np.isfinite(whole.xyz).all()
    assert whole.sigma.max() < 0.02


def photographs_in(folder, names, time):
    """Photographs of a folder, as far as their positions need them."""
    from aerotri.tie_points.photographs import PhotographSet

    n = len(names)
    nothing = np.full((n, 3), np.nan)
    return PhotographSet(
        tuple(folder / name for name in names), np.array(names), (), np.zeros(n, int), nothing, nothing,
        np.zeros(n, bool), time,
    )  # fmt: skip


def test_time_stamps_beside_the_photographs_of_two_flights(tmp_path):
    """Each flight has its folder, numbers from 1 and a .MRK of its own; one trajectory covers both."""
    from aerotri.tie_points.stated import GivenFiles, read_given, sources_of_photographs

    first, second = TAKEN[:9], TAKEN[12:20]
    for folder, taken in (("100_0001", first), ("100_0002", second)):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / f"{folder}_Timestamp.MRK").write_text(mrk(taken))
    (tmp_path / "flight.pos").write_text(rtklib(EPOCHS))
    names = [f"{folder}/DJI_{k:04d}.JPG" for folder, n in (("100_0001", 9), ("100_0002", 8)) for k in range(1, n + 1)]
    photographs = photographs_in(tmp_path, names, exif(np.concatenate([first, second])))
    files = GivenFiles(positions=str(tmp_path / "flight.pos"))
    found = read_given(files, 0.5, photographs).positions
    assert found is not None
    assert found.images.tolist() == names
    apart = (found.xyz - np.vstack([cameras(first), cameras(second)])) * metres_of_units(found.xyz)
    np.testing.assert_allclose(apart, 0.0, atol=2e-3)
    half = len(EPOCHS) // 2
    (tmp_path / "flight.pos").unlink()
    (tmp_path / "trajectories").mkdir()
    for number, part in enumerate((EPOCHS[:half], EPOCHS[half:])):
        (tmp_path / "trajectories" / f"{number}.pos").write_text(rtklib(part))
    files = GivenFiles(positions=str(tmp_path / "trajectories"))
    again = read_given(files, 0.5, photographs).positions
    assert again is not None
    near = np.isin(again.images, found.images)
    assert near.all()
    assert len(again.images) >= len(names) - 1
    (tmp_path / "trajectories" / "2.pos").write_text(rtklib(EPOCHS[half - 9 :]))
    with pytest.raises(InputError, match="covers a time that"):
        read_given(files, 0.5, photographs)
    (tmp_path / "trajectories" / "2.pos").unlink()
    sources = sources_of_photographs(photographs, tmp_path, files, None)
    assert [source.holds for source in sources] == ["photographs", "positions", "time stamps", "time stamps"]


def test_one_error_of_the_clock_is_no_error_of_numbers(tmp_path):
    """Numbers that fit by chance after one photograph was deleted do not shift the others: times say otherwise."""
    from aerotri.tie_points.stated import GivenFiles, read_given

    (tmp_path / "flight.MRK").write_text(mrk(TAKEN))
    (tmp_path / "flight.pos").write_text(rtklib(EPOCHS))
    names = [f"DJI_{k:04d}.JPG" for k in range(1, 22)]
    photographs = photographs_in(tmp_path, names, exif(TAKEN[1:]))
    found = read_given(GivenFiles(positions=str(tmp_path / "flight.pos")), 0.5, photographs).positions
    assert found is not None
    assert found.images.tolist() == names
    # by the camera's clock, so that photographs without a position have the same
    np.testing.assert_allclose(np.diff(found.time), np.diff(TAKEN[1:]), atol=1e-5)
    assert np.abs(found.time - exif(TAKEN[1:]) % 86400.0).max() < 1.0


def test_times_that_jump_about_do_not_outweigh_numbers_that_are_all_there(flown):
    """A camera that writes times up to six seconds late: numbers are believed where none is missing, and only then."""
    late = exif(TAKEN) + np.random.default_rng(3).integers(0, 7, len(TAKEN))
    index, said = stamps_of(flown, NAMES, late)
    assert index == list(range(22))
    assert "are believed" in said
    with pytest.raises(InputError, match="do not agree with the time stamps of their numbers"):
        stamps_of(flown, NAMES[:-2], late[:-2])
