"""The adjustment as a whole on simulated blocks: start values, robustness, defects, what is left out, reopening."""

from dataclasses import replace

import numpy as np
import pytest

from aerotri.adjustment.start_values import resect, start_values
from aerotri.adjustment.track import headings, strips_of_track
from aerotri.conventions import InputError
from aerotri.formats.results.solution import read_solution, write_solution
from aerotri.functional_model.rotation import rotation_from_angles
from aerotri.observations import Control, Prior
from aerotri.observations.block import Constraints, Edits
from aerotri.pipeline import AdjustmentFailedError, adjust, adjust_keeping_system, reopen
from small_blocks import small_block, small_spec, with_adjustment

DENSE_CONTROL = {"control": {"distance_bases": 0.9, "sigma_m": [0.03, 0.03, 0.05], "check_points": 5}}


def without_start(block, keep=()):
    images = block.images
    centre, angles = np.full_like(images.centre, np.nan), np.full_like(images.angles, np.nan)
    keep = list(keep)
    centre[keep], angles[keep] = images.centre[keep], images.angles[keep]
    return replace(block, images=replace(images, centre=centre, angles=angles))


def test_start_from_control_alone_and_growth():
    """Some photographs see four control points, the rest are resected from intersected points."""
    block, truth = small_block(11, **DENSE_CONTROL)
    bare = without_start(block)
    start = start_values(bare)
    assert np.isfinite(start.centre).all()
    np.testing.assert_allclose(start.centre + start.origin, truth.centre, atol=3.0)
    result, expected = adjust(bare), adjust(block)
    np.testing.assert_allclose(result.outcome.vtpv, expected.outcome.vtpv, rtol=1e-9)


def test_start_grows_from_two_oriented_photographs():
    block, _ = small_block(12)
    grown = adjust(without_start(block, keep=(0, 1)))
    np.testing.assert_allclose(grown.outcome.vtpv, adjust(block).outcome.vtpv, rtol=1e-9)


def test_start_survives_gross_errors():
    """Five per cent of the rays off by up to 0.2 mm: the orientation still starts within metres."""
    block, truth = small_block(13, **DENSE_CONTROL, gross_errors={"fraction": 0.05, "range_sigma": [10.0, 100.0]})
    start = start_values(without_start(block))
    np.testing.assert_allclose(start.centre + start.origin, truth.centre, atol=8.0)


def test_resection_single_photograph():
    rng = np.random.default_rng(5)
    rotation = rotation_from_angles(np.radians([2.0, -1.0, 77.0]))
    centre = np.array([500.0, -300.0, 1200.0])
    points = np.column_stack([rng.uniform(100, 900, 12), rng.uniform(-700, 100, 12), rng.uniform(0, 80, 12)])
    u = (points - centre) @ rotation
    tangent = -u[:, :2] / u[:, 2:]
    tangent[3] += 0.05
    pose = resect(points, tangent, 1e-4)
    assert pose is not None
    np.testing.assert_allclose(pose[1], centre, atol=1e-3)
    np.testing.assert_allclose(pose[0], rotation, atol=1e-6)


def test_no_start_values_is_refused():
    with pytest.raises(InputError, match="no photograph has start values"):
        adjust(with_adjustment(without_start(small_block(12)[0]), start="strips"))


def test_no_control_names_the_datum():
    block = replace(small_block(14)[0], control=Control.empty())
    with pytest.raises(
        AdjustmentFailedError, match="no control: the datum is free in X, Y, Z, ω, φ, κ, scale"
    ) as failure:
        adjust(block)
    assert failure.value.outcome.status == "rank deficient"


def test_two_control_points_leave_a_rotation():
    block = small_block(14)[0]
    control = block.control
    two = np.flatnonzero(~control.is_check)[:2]
    few = Control(control.point[two], control.xyz[two], control.sigma[two], control.is_check[two])
    with pytest.raises(AdjustmentFailedError, match=r"too little control: the datum is free in a combination of .*ω"):
        adjust(replace(block, control=few))


def test_height_control_only_names_what_is_free():
    block = small_block(14)[0]
    xyz = block.control.xyz.copy()
    xyz[:, :2] = np.nan
    with pytest.raises(AdjustmentFailedError, match="the datum is free in X, Y, κ") as failure:
        adjust(replace(block, control=replace(block.control, xyz=xyz)))
    assert "scale" not in failure.value.outcome.message.split("κ")[1][:4]


def test_parameters_that_cannot_be_told_apart_are_named():
    """[D] K1 ↔ −P9 plus a scale: with the principal distance known they differ by next to nothing, free by nothing."""
    block = small_block(15, "brown:K1,bluh:9")[0]
    camera = block.cameras[0]

    def with_focal_length(prior):
        return replace(block, cameras=(replace(camera, interior={**camera.interior, "focal_length_mm": prior}),))

    result = adjust(with_focal_length(Prior(101.4, 0.005)))
    row = list(result.parameters.names).index("bluh.9")
    assert result.parameters.max_correlation_with[row] == "brown.K1"
    assert any("bluh.9 and brown.K1 cannot be told apart" in w for w in result.outcome.warnings)
    with pytest.raises(AdjustmentFailedError, match=r"changed the principal distance from 101\.4"):
        adjust(with_focal_length(Prior(101.4)))


def test_tile_without_rays_is_named():
    block = small_block(16, "ultracam_d:42-73")[0]
    rays = block.image_points
    in_corner = (rays.xy[:, 0] < -10) & (rays.xy[:, 1] > 8)
    keep = ~in_corner
    block = replace(
        block,
        image_points=replace(
            rays, image=rays.image[keep], point=rays.point[keep], xy=rays.xy[keep], sigma=rays.sigma[keep]
        ),
    )
    with pytest.raises(AdjustmentFailedError, match=r"no ray depends on ultracam_d\.42"):
        adjust(block)


def test_what_is_left_out_is_said_and_marked():
    block = small_block(17)[0]
    rays = block.image_points
    lonely = np.setdiff1d(rays.point, block.control.point)[0]
    first = np.flatnonzero(rays.point == lonely)[0]
    keep = (rays.point != lonely) | (np.arange(len(rays)) == first)
    block = replace(
        block,
        image_points=replace(
            rays, image=rays.image[keep], point=rays.point[keep], xy=rays.xy[keep], sigma=rays.sigma[keep]
        ),
    )
    result = adjust(block)
    left_out = np.flatnonzero(rays.point[keep] == lonely)
    assert any(str(block.points[lonely]) in warning for warning in result.outcome.warnings)
    assert result.rays.status[left_out] == [1]
    assert np.isnan(result.rays.v[left_out]).all()
    assert np.isnan(result.points.xyz[lonely]).all()


def test_huber_resists_gross_errors():
    clean, _ = small_block(18)
    foul, truth = small_block(18, gross_errors={"fraction": 0.05, "range_sigma": [10.0, 100.0]})
    robust = with_adjustment(foul, robust="huber")
    reference, plain, huber = adjust(clean), adjust(foul), adjust(robust)
    sigma = reference.images.sigma[:, :3]

    def off(result):
        return np.abs((result.images.centre - reference.images.centre) / sigma).max()

    assert huber.outcome.status == "converged"
    assert off(huber) < 3.0 < off(plain)
    wrong = np.asarray(truth.gross_errors)
    assert np.median(huber.rays.weight[wrong]) < 0.3
    good = np.setdiff1d(np.arange(len(foul.image_points)), wrong)
    assert np.nanmean(huber.rays.weight[good]) > 0.9
    redundancy = huber.outcome.redundancy
    assert abs(sum(g.redundancy for g in huber.groups) - redundancy) < 1e-6 * redundancy


def test_huber_changes_nothing_on_clean_observations_but_the_tails():
    block, _ = small_block(19)
    plain, robust = adjust(block), adjust(with_adjustment(block, robust="huber"))
    shift = np.abs(plain.images.centre - robust.images.centre) / plain.images.sigma[:, :3]
    assert shift.max() < 0.6
    assert 0.9 < robust.outcome.sigma0 / plain.outcome.sigma0 <= 1.001


def test_reopened_result_equals_the_one_in_memory(tmp_path):
    from aerotri.formats.block.folder import read_block, write_block

    for k, settings in enumerate(({}, {"datum": "inner"}, {"robust": "huber"})):
        block = with_adjustment(small_block(20, "bluh:1-4")[0], **settings)
        adjustment = adjust_keeping_system(block)
        folder = tmp_path / str(k)
        write_block(block, folder / "block")
        write_solution(folder / "solution.npz", adjustment.system, adjustment.solution, adjustment.result)
        again = reopen(read_block(folder / "block"), read_solution(folder / "solution.npz")).result
        kept = adjustment.result
        for name in ("images.covariance", "points.covariance", "parameters.covariance", "rays.r"):
            record, attribute = name.split(".")
            a, b = (np.asarray(getattr(getattr(r, record), attribute)) for r in (kept, again))
            scale = np.nanmax(np.abs(a))
            np.testing.assert_allclose(b / scale, a / scale, rtol=1e-10, atol=1e-10, err_msg=name)
        np.testing.assert_allclose(again.outcome.sigma0, kept.outcome.sigma0, rtol=1e-10)
        np.testing.assert_array_equal(again.points.xyz, kept.points.xyz)


def test_damaged_solution_is_refused(tmp_path):
    path = tmp_path / "solution.npz"
    with pytest.raises(InputError, match="is missing"):
        read_solution(path)
    path.write_bytes(b"PK\x03\x04 nonsense")
    with pytest.raises(InputError, match="cannot be read"):
        read_solution(path)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"robust": "tukey"}, "robust"),
        ({"datum": "fixed"}, "datum_fixed"),
        ({"datum": "fixed", "datum_fixed": (("nobody", "X0"),)}, "nobody"),
        ({"datum": "inner", "datum_points": ("nowhere",)}, "nowhere"),
    ],
)
def test_settings_not_honoured_are_refused(settings, words):
    with pytest.raises(InputError, match=words):
        adjust(with_adjustment(small_block(21)[0], **settings))


def test_control_in_one_corner_is_said():
    block = small_block(22)[0]
    corner = np.argsort(np.abs(block.control.xyz[:, :2] - block.control.xyz[0, :2]).sum(axis=1))[:4]
    is_check = np.ones(len(block.control), bool)
    is_check[corner] = False
    result = adjust(replace(block, control=replace(block.control, is_check=is_check)))
    assert any("of the block's area" in warning for warning in result.outcome.warnings)
    far = np.nanargmax(result.check.sigma[:, 2])
    assert result.check.sigma[far, 2] > 2.5 * np.nanmin(result.check.sigma[:, 2])


def test_points_at_infinity_are_named():
    """Two rays that do not meet under a real angle: the point is left out, and named."""
    block = small_block(23)[0]
    rays = block.image_points
    count = np.bincount(rays.point, minlength=len(block.points))
    chosen = np.setdiff1d(np.flatnonzero(count == 2), block.control.point)[0]
    one, two = np.flatnonzero(rays.point == chosen)
    start = start_values(block)
    direction = start.rotation[rays.image[one]] @ np.array([*rays.xy[one], -101.4])
    seen = start.rotation[rays.image[two]].T @ direction
    xy = rays.xy.copy()
    xy[two] = -101.4 * seen[:2] / seen[2]
    result = adjust(replace(block, image_points=replace(rays, xy=xy)))
    assert any("do not intersect" in w and str(block.points[chosen]) in w for w in result.outcome.warnings)
    assert (result.rays.status[[one, two]] == 3).all()


@pytest.mark.parametrize("axis", ["+y", "-y", "+x", None])
def test_start_from_centres_alone(axis):
    """No angles: vertical photographs along the track, crab of 2°, tilts of 1°, 5 % gross errors; axis also unknown."""
    block, truth = small_block(24, gross_errors={"fraction": 0.05, "range_sigma": [10.0, 100.0]})
    images, camera = block.images, block.cameras[0]
    turn = {"+y": 0, "-y": 180, "+x": -90, None: 0}[axis]
    angle = np.radians(turn)
    rotate = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    size = camera.size_px[::-1] if axis == "+x" else camera.size_px
    bare = replace(
        block,
        cameras=(replace(camera, model="frame", flight_axis=axis, size_px=size),),
        images=replace(images, angles=np.full_like(images.angles, np.nan), strip=np.full_like(images.strip, "")),
        image_points=replace(block.image_points, xy=block.image_points.xy @ rotate.T),
    )
    start = start_values(bare)
    np.testing.assert_allclose(start.centre + start.origin, truth.centre, atol=12.0)
    result = adjust(with_adjustment(bare, robust="huber"))
    assert result.outcome.status == "converged"
    np.testing.assert_allclose(result.images.centre, truth.centre, atol=1.0)
    # one strip name for each line of flight, and the crossing one
    assert len(np.unique(strips_of_track(truth.centre, bare.images.strip))) == 4


def test_track_with_named_strips_and_single_photographs():
    centre = np.array([[0.0, 0, 0], [10, 0, 0], [20, 0, 0], [20, 30, 0], [10, 30, 0], [0, 30, 0], [80, 80, 0]])
    np.testing.assert_array_equal(strips_of_track(centre, np.full(7, "")), [0, 0, 0, 1, 1, 1, 2])
    named = np.array(["b", "b", "b", "a", "a", "a", "c"])
    np.testing.assert_array_equal(strips_of_track(centre, named), [1, 1, 1, 0, 0, 0, 2])
    heading = headings(centre, strips_of_track(centre, named))
    np.testing.assert_allclose(heading, [0, 0, 0, np.pi, np.pi, np.pi, np.pi])


def edits(block, *rows):
    image = {str(n): k for k, n in enumerate(block.images.names)}
    point = {str(n): k for k, n in enumerate(block.points)}
    columns = list(zip(*rows, strict=True))
    return Edits(
        np.array([image.get(i, -1) for i in columns[0]]), np.array([point[p] for p in columns[1]]),
        np.array(columns[2], dtype=object), np.array([""] * len(rows), dtype=object),
    )  # fmt: skip


def test_edits_switch_rays_and_control():
    block = small_block(25)[0]
    rays = block.image_points
    tie = int(np.setdiff1d(np.argsort(-np.bincount(rays.point)), block.control.point, assume_unique=True)[0])
    photo = block.images.names[rays.image[rays.point == tie][0]]
    names = [str(block.points[p]) for p in block.control.point]
    control, check = np.flatnonzero(~block.control.is_check), np.flatnonzero(block.control.is_check)
    made = edits(
        block,
        (photo, str(block.points[tie]), "off"),
        ("", names[control[0]], "off"),
        ("", names[control[1]], "check"),
        ("", names[check[0]], "control"),
    )
    plain, edited = adjust(block), adjust(replace(block, edits=made))
    assert (edited.rays.status == 2).sum() == 1
    assert edited.points.rays[tie] == plain.points.rays[tie] - 1
    assert edited.points.rays[block.control.point[control[0]]] == plain.points.rays[block.control.point[control[0]]]
    kept = [str(block.points[p]) for p in edited.control.point]
    assert names[control[1]] not in kept
    assert names[check[0]] in kept
    row = [str(block.points[p]) for p in edited.control.point].index(names[control[0]])
    assert np.isnan(edited.control.difference[row]).all()
    assert edited.outcome.observations == plain.outcome.observations - 2 - 3


def test_conditions_hold_what_they_say():
    """Two far points tied to a height difference within a millimetre: they end up so, and with smaller σ."""
    block, truth = small_block(26, "bluh:1-2")
    often = np.setdiff1d(np.argsort(-np.bincount(block.image_points.point)), block.control.point, assume_unique=True)
    a, b = int(often[0]), int(often[5])
    value = truth.points[b, 2] - truth.points[a, 2]
    given = Constraints(
        np.array(["height_difference"], object), (np.array([a, b]),), np.array([value]), np.array([0.001])
    )
    plain, tied = adjust(block), adjust(replace(block, constraints=given))
    assert abs(tied.points.xyz[b, 2] - tied.points.xyz[a, 2] - value) < 0.002
    assert tied.outcome.observations == plain.outcome.observations + 1
    assert tied.outcome.unknowns == plain.outcome.unknowns
    assert (tied.points.sigma[[a, b], 2] < plain.points.sigma[[a, b], 2]).all()
    assert len(tied.parameters) == 2
    assert tied.groups[-1].name == "constraints"
    assert abs(sum(g.redundancy for g in tied.groups) - tied.outcome.redundancy) < 1e-6 * tied.outcome.redundancy


def test_condition_on_a_point_that_is_not_adjusted_is_refused():
    block = small_block(26)[0]
    names = np.append(block.points, "nowhere")
    given = Constraints(
        np.array(["horizontal"], object), (np.array([0, len(names) - 1]),), np.array([np.nan]), np.array([0.01])
    )
    with pytest.raises(InputError, match="'nowhere', which is not adjusted"):
        adjust(replace(block, points=names, constraints=given))


@pytest.mark.parametrize(
    ("shift", "free"),
    # models.md 1: none with GNSS as it is, three with one shift, four with a shift of each of parallel strips
    [("off", 0), ("block", 3), ("strip", 4)],
)
def test_what_gnss_leaves_free(shift, free):
    flight = {**small_spec()["flight"], "cross_strips": []}
    block = small_block(27, flight=flight, gnss={"sigma_m": [0.05, 0.05, 0.08], "shift_sigma_m": [0.1, 0.1, 0.1]})[0]
    gnss = replace(block.settings.gnss, shift=shift)
    block = replace(block, settings=replace(block.settings, gnss=gnss))
    for datum in ("minimal", "inner"):
        adjustment = adjust_keeping_system(with_adjustment(block, datum=datum))
        # exactly parallel strips leave the roll free, strips flown by hand hold it a little
        expected = free if shift != "strip" else adjustment.system.unknowns.motions.count
        assert adjustment.system.unknowns.motions.count == expected in (free, 3)
        assert adjustment.system.unknowns.point_held.sum() == expected
        result = adjustment.result
        assert result.outcome.conditions == (expected if datum == "inner" else 0)
        assert abs(sum(g.redundancy for g in result.groups) - result.outcome.redundancy) < 1e-6 * 2000


def test_heights_that_hang_on_the_principal_distance_are_said():
    """GNSS alone over flat ground with a free principal distance: a good σ0, and heights that share one uncertainty."""
    block, truth = small_block(28, terrain={"kind": "flat", "height_m": 100.0}, gnss={"sigma_m": [0.03, 0.03, 0.05]})
    camera = block.cameras[0]
    free = replace(block, cameras=(replace(camera, interior={**camera.interior, "focal_length_mm": Prior(101.4)}),))
    alone = adjust(replace(free, control=replace(free.control, is_check=np.ones(len(free.control), bool))))
    said = [w for w in alone.outcome.warnings if "all heights share an uncertainty" in w]
    assert len(said) == 1
    assert "principal distance of ucd" in said[0]
    shared = float(said[0].split("uncertainty of ")[1].split(" m")[0])
    common = np.nanmean(alone.points.xyz[:, 2] - truth.points[:, 2])
    assert abs(common) < 3.3 * shared
    # the check points' own σ contain it
    assert (alone.check.sigma[:, 2] > 0.9 * shared).all()
    assert not any("all heights share" in w for w in adjust(block).outcome.warnings)


TAMPERED = {
    "status": np.array("accepted"),
    "estimator_code": np.array(7),
    "estimator_limit": np.array(np.nan),
    "held": np.array([[0, 5]]),
    "points": np.zeros((3, 3)),
    "shared_cofactor": np.zeros((1, 2)),
    "weight": np.array(["1"]),
    "rotation": None,
    "removals": np.array('[{"name": 1}]'),
    "components": np.array("[" * 5000),
}


@pytest.mark.parametrize("name", TAMPERED)
def test_tampered_solution_is_refused(name, tmp_path):
    """Whatever an adjustment cannot have written, in a file that is whole otherwise."""
    block = small_block(20)[0]
    adjustment = adjust_keeping_system(block)
    path = tmp_path / "solution.npz"
    write_solution(path, adjustment.system, adjustment.solution, adjustment.result)
    with np.load(path) as file:
        arrays = {key: file[key] for key in file.files}
    assert read_solution(path, block).status == "converged"
    np.savez(path, **(arrays | {name: 2.0 * arrays[name] if TAMPERED[name] is None else TAMPERED[name]}))
    with pytest.raises(InputError, match=r"^\S*solution\.npz: ") as caught:
        read_solution(path, block)
    assert caught.value.remedy
