"""Additional parameters: one contract for all families, then what each family promises."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerotri.conventions import InputError
from aerotri.functional_model.additional_parameters import (
    FAMILIES,
    brown,
    describe,
    dmc,
    format_parameters,
    is_item,
    mark_of,
    parameter_set,
    parameter_sets,
    parse_parameters,
    text_of,
    ultracam_d,
)
from aerotri.functional_model.additional_parameters.registry import LINEAR_FAMILIES, default_items, sizes_of
from aerotri.observations import Camera
from family_cameras import INTERIOR, camera_for, inner_points


def full_set(family: str, flight_axis: str = "+y"):
    return parameter_set(family, default_items(family), camera_for(family, flight_axis))


def all_sets(family: str, flight_axis: str = "+y"):
    """Sets that hold every item of a family between them; items that exclude each other apart."""
    camera, items = camera_for(family, flight_axis), LINEAR_FAMILIES[family].items
    choices = [items] if family != "dmc" else [dmc.FAMILY.all_items, ("79", "80")]
    return [parameter_set(family, choice, camera) for choice in choices]


@pytest.mark.parametrize("family", LINEAR_FAMILIES)
@pytest.mark.parametrize("flight_axis", ["+x", "-x", "+y", "-y"])
def test_partials_are_the_derivatives(family, flight_axis):
    for chosen in all_sets(family, flight_axis):
        x, y = inner_points(chosen.camera)
        assert len(x) > 200
        analytic, h = chosen.partials(x, y), 1e-5
        numeric = np.stack(
            [
                (chosen.basis(x + h, y) - chosen.basis(x - h, y)) / (2 * h),
                (chosen.basis(x, y + h) - chosen.basis(x, y - h)) / (2 * h),
            ],
            axis=-1,
        )
        scale = np.abs(analytic).max(axis=(0, 1, 3))[:, None] + 1e-12
        np.testing.assert_allclose(analytic / scale, numeric / scale, atol=1e-7)


@pytest.mark.parametrize("family", LINEAR_FAMILIES)
def test_contract(family):
    own = LINEAR_FAMILIES[family]
    assert set(own.mark) <= set("PLDC")
    assert len(own.reference) > 10
    assert len(set(own.items)) == len(own.items)
    assert set(default_items(family)) <= set(own.items)
    assert all(own.text(item) for item in own.items)
    assert {item for chosen in all_sets(family) for item in chosen.items} == set(own.items)
    for chosen in all_sets(family):
        x, y = inner_points(chosen.camera, 30)
        basis = chosen.basis(x, y)
        assert chosen.names == tuple(f"{family}.{item}" for item in chosen.items)
        assert basis.shape == (len(x), 2, len(chosen.items))
        assert np.abs(basis).max(axis=(0, 1)).min() > 0.0 or len(chosen.items) > 2 * len(x)
        assert np.isfinite(chosen.basis(np.zeros(1), np.zeros(1))).all()
        assert chosen.basis(np.zeros(0), np.zeros(0)).shape == (0, 2, len(chosen.items))
        for k in (0, len(chosen.items) // 2, len(chosen.items) - 1):
            alone = parameter_set(family, [chosen.items[k]], chosen.camera)
            np.testing.assert_array_equal(alone.basis(x, y)[:, :, 0], basis[:, :, k])


@pytest.mark.parametrize("family", LINEAR_FAMILIES)
def test_terms(family):
    """Partials only on request; every second item gives the same columns; few act where a family is local."""
    chosen = full_set(family)
    x, y = inner_points(chosen.camera, 60)
    terms = chosen.terms(x, y)
    assert terms.partial is None
    with_partials = chosen.terms(x, y, partials=True)
    np.testing.assert_array_equal(with_partials.value, terms.value)
    assert with_partials.partial is not None
    assert with_partials.partial.shape == (*terms.value.shape, 2)
    acting = {"ultracam_d": 4, "dmc": 5, "grid": 8, "collocation": 8}.get(family, len(chosen.items))
    assert terms.index.shape == (len(x), acting)
    assert terms.value.shape == (len(x), 2, acting)
    some = parameter_set(family, chosen.items[::2], chosen.camera)
    np.testing.assert_array_equal(some.basis(x, y), chosen.basis(x, y)[:, :, ::2])
    np.testing.assert_array_equal(some.partials(x, y), chosen.partials(x, y)[:, :, ::2])
    assert parameter_set(family, [], chosen.camera).basis(x, y).shape == (len(x), 2, 0)


@pytest.mark.parametrize("family", ["bluh", "ebner", "gruen", "fourier", "legendre", "chebyshev"])
def test_many_points_are_filled_piece_by_piece(family):
    """9000 points take three pieces; the last is not full."""
    chosen = full_set(family)
    x, y = inner_points(chosen.camera)
    again = np.arange(9000) % len(x)
    np.testing.assert_allclose(chosen.basis(x[again], y[again]), chosen.basis(x, y)[again], rtol=1e-12, atol=1e-9)


def test_bluh_by_hand():
    """Table 1 of paper 003 at x = 30, y = −40 mm of a film camera, where s = 1 and r = 50 mm."""
    film = Camera("film", "frame", (23000, 23000), 10.0, INTERIOR)
    basis = parameter_set("bluh", [str(k) for k in range(1, 13)], film).basis(np.array([30.0]), np.array([-40.0]))[0]
    b = np.arctan2(-40.0, 30.0)
    expected = np.array(
        [
            (40.0, -30.0),
            (-30.0, -40.0),
            (-30 * np.cos(2 * b), 40 * np.cos(2 * b)),
            (-30 * np.sin(2 * b), 40 * np.sin(2 * b)),
            (-30 * 0.6, 40 * 0.6),
            (-30 * -0.8, 40 * -0.8),
            (-40 * 50 * 0.6, -30 * 50 * 0.6),
            (-40 * 50 * -0.8, -30 * 50 * -0.8),
            (-30 * (2500.0 - 16384.0), 40 * (2500.0 - 16384.0)),
            (-30 * np.sin(50 * 0.049087), 40 * np.sin(50 * 0.049087)),
            (-30 * np.sin(50 * 0.098174), 40 * np.sin(50 * 0.098174)),
            (-30 * np.sin(4 * b), 40 * np.sin(4 * b)),
        ]
    ).T
    np.testing.assert_allclose(basis, expected, rtol=3e-5)


def test_bluh_is_normalised_to_the_film_format():
    """The same relative place gives the same relative displacement, whatever the format."""
    film, small = (Camera("c", "frame", (n, n), 10.0, INTERIOR) for n in (23000, 5000))
    items = LINEAR_FAMILIES["bluh"].items
    one = parameter_set("bluh", items, film).basis(np.array([46.0]), np.array([23.0])) / 115.0
    other = parameter_set("bluh", items, small).basis(np.array([10.0]), np.array([5.0])) / 25.0
    np.testing.assert_allclose(one, other, rtol=1e-12)


def test_bluh_is_single_valued_across_the_axes():
    """A plain arctan(y/x) would make 6 and 8 jump at x = 0."""
    chosen = full_set("bluh")
    y = np.array([20.0, -20.0])
    left, right = chosen.basis(np.full(2, -1e-9), y), chosen.basis(np.full(2, 1e-9), y)
    scale = np.abs(chosen.basis(*inner_points(chosen.camera))).max(axis=(0, 1))
    np.testing.assert_allclose(left / scale, right / scale, atol=1e-7)


def test_bluh_and_brown_identities():
    """[D, models.md 2] P1 = 3x·(x, y) + pattern 8; P2 = 3y·(x, y) − pattern 7; K1 ↔ −P9 plus a scale (s = 1)."""
    film = Camera("film", "frame", (23000, 23000), 10.0, INTERIOR)
    chosen = parameter_set("bluh", LINEAR_FAMILIES["bluh"].items, film)
    x, y = inner_points(film)
    bluh = {item: chosen.basis(x, y)[:, :, k] for k, item in enumerate(chosen.items)}
    correction = dict(zip(brown.ITEMS, np.moveaxis(-brown.basis(x, y), 2, 0), strict=True))
    xy = np.column_stack([x, y])
    np.testing.assert_allclose(correction["P1"], 3 * x[:, None] * xy + bluh["8"], rtol=1e-10, atol=1e-9)
    np.testing.assert_allclose(correction["P2"], 3 * y[:, None] * xy - bluh["7"], rtol=1e-10, atol=1e-9)
    np.testing.assert_allclose(correction["K1"], -bluh["9"] + 16384.0 * xy, rtol=1e-10, atol=1e-6)


def orientation_columns(x, y, f):
    """The six directions in which a change of orientation moves image points over flat ground."""
    dx = [np.ones_like(x), np.zeros_like(x), x, -y, f + x * x / f, x * y / f]
    dy = [np.zeros_like(x), np.ones_like(x), y, x, x * y / f, f + y * y / f]
    return np.stack([np.stack(dx, -1), np.stack(dy, -1)], axis=1)


def test_bluh_5_and_6_are_weak_by_nature():
    """models.md 2: the six orientation directions take 92–97 % of their variance."""
    chosen = full_set("bluh")
    half = chosen.camera.half_format_mm
    x, y = (g.ravel() for g in np.meshgrid(np.linspace(-half[0], half[0], 41), np.linspace(-half[1], half[1], 41)))
    orientation = orientation_columns(x, y, 101.4).reshape(-1, 6)
    basis = chosen.basis(x, y).reshape(-1, 12)
    left = basis - orientation @ np.linalg.lstsq(orientation, basis, rcond=None)[0]
    taken = 1.0 - np.sum(left**2, axis=0) / np.sum(basis**2, axis=0)
    assert 0.92 <= taken[4] <= 0.97
    assert 0.92 <= taken[5] <= 0.97
    assert (np.delete(taken, [4, 5, 8]) < 0.92).all()


@pytest.mark.parametrize(
    ("size", "pixel_um", "f", "expected"),
    [
        ((23000, 23000), 10.0, 153.0, (0.80, 0.59, 0.60, 0.00)),
        ((11500, 7500), 9.0, 101.4, (0.81, 0.63, 0.58, 0.56)),
        ((13824, 7680), 12.0, 120.0, (0.82, 0.64, 0.57, 0.68)),
    ],
)
def test_bluh_correlations(size, pixel_um, f, expected):
    """models.md 2: (1,4) .80, (9,10) .6, (2,3) .6, (4,12) up to .68.

    They are the cosines between the patterns over an evenly covered format, less what the orientation of a photograph
    over flat ground takes: film, UltraCamD, DMC.
    """
    camera = Camera("c", "frame", size, pixel_um, INTERIOR)
    half = camera.half_format_mm
    x, y = (g.ravel() for g in np.meshgrid(np.linspace(-half[0], half[0], 61), np.linspace(-half[1], half[1], 61)))
    basis = parameter_set("bluh", LINEAR_FAMILIES["bluh"].items, camera).basis(x, y).reshape(-1, 12)
    orientation = orientation_columns(x, y, f).reshape(-1, 6)
    left = basis - orientation @ np.linalg.lstsq(orientation, basis, rcond=None)[0]
    left /= np.linalg.norm(left, axis=0)
    cosines = [left[:, i - 1] @ left[:, j - 1] for i, j in ((1, 4), (9, 10), (2, 3), (4, 12))]
    np.testing.assert_allclose(cosines, expected, atol=0.012)


def test_ultracam_tiles_single_points():
    """Tile and patterns of single pixels, by hand: tile centres at columns 2004, 5750, 9496, rows 1336, 3750, 6164."""
    chosen = full_set("ultracam_d")
    column, row = np.array([100.0, 5750.0, 3876.0, 3878.0, 11400.0]), np.array([200.0, 3750.0, 2542.0, 2544.0, 7400.0])
    x, y = (column - 5750.0) * 0.009, (3750.0 - row) * 0.009
    tiles = ultracam_d.tile_of(chosen.camera, x, y)
    np.testing.assert_array_equal(tiles, [0, 4, 0, 4, 8])
    basis = chosen.basis(x, y)
    np.testing.assert_array_equal(basis[1], 0.0)
    np.testing.assert_array_equal(basis[3], 0.0)
    dx, dy = (100.0 - 2004.0) * 0.009, (1336.0 - 200.0) * 0.009
    item = {name: k for k, name in enumerate(chosen.items)}
    np.testing.assert_allclose(basis[0][:, item["42"]], [dx, dy], atol=1e-12)
    np.testing.assert_allclose(basis[0][:, item["50"]], [1.0, 0.0])
    np.testing.assert_allclose(basis[0][:, item["58"]], [0.0, 1.0])
    np.testing.assert_allclose(basis[0][:, item["66"]], [-dy, dx], atol=1e-12)
    assert np.count_nonzero(basis[0].any(axis=0)) == 4
    last = [k for k in range(32) if basis[4][:, k].any()]
    assert [chosen.items[k] for k in last] == ["49", "57", "65", "73"]


def test_ultracam_flight_axis_turns_the_sensor():
    """A point in the upper left tile of the native frame, seen in an image turned by 90°: patterns turn with it."""
    native, turned = full_set("ultracam_d", "+y"), full_set("ultracam_d", "+x")
    at = np.array([[-40.0], [20.0]])
    turn = ultracam_d.native_from_image(turned.camera)
    image = turn.T @ at
    expected = np.einsum("ia,nak->nik", turn.T, native.basis(*at))
    np.testing.assert_allclose(turned.basis(*image), expected, atol=1e-12)


def test_ultracam_rank_of_one_photograph():
    """models.md 3 [D]: nine tiles × 4 patterns and 6 orientation columns over flat ground have rank 38."""
    camera = camera_for("ultracam_d")
    half = camera.half_format_mm
    x, y = (g.ravel() for g in np.meshgrid(np.linspace(-half[0], half[0], 60), np.linspace(-half[1], half[1], 60)))
    tile = ultracam_d.tile_of(camera, x, y)
    offset = np.column_stack([x, y]) - ultracam_d.tile_centres_mm(camera)[tile]
    columns = []
    for k in range(9):
        own = (tile == k).astype(float)
        zero = np.zeros_like(own)
        columns += [
            np.concatenate([own * offset[:, 0], own * offset[:, 1]]),
            np.concatenate([own, zero]),
            np.concatenate([zero, own]),
            np.concatenate([-own * offset[:, 1], own * offset[:, 0]]),
        ]
    orientation = orientation_columns(x, y, 101.4)
    design = np.column_stack([*columns, *[np.concatenate([o[:, 0], o[:, 1]]) for o in np.moveaxis(orientation, 2, 0)]])
    assert np.linalg.matrix_rank(design / np.linalg.norm(design, axis=0), tol=1e-9) == 38


def test_parse_parameters():
    assert parse_parameters("none") == ()
    assert parse_parameters("bluh:1-3+12,ultracam_d:42") == (("bluh", ("1", "2", "3", "12")), ("ultracam_d", ("42",)))
    assert parse_parameters(["brown:K1+P1", "brown:K2"]) == (("brown", ("K1", "K2", "P1")),)
    assert parse_parameters("bluh:all") == parse_parameters("bluh:1-12") == parse_parameters("bluh")


@pytest.mark.parametrize("spec", ["blu:1", "bluh:0", "bluh:1-13", "bluh:+", "bluh:1--3", "brown:K9", "bluh:", ":1"])
def test_parse_parameters_refuses(spec):
    if spec == "bluh:":
        assert parse_parameters(spec) == parse_parameters("bluh:all")
        return
    with pytest.raises(InputError):
        parse_parameters(spec)


@pytest.mark.parametrize(
    ("spec", "counts"),
    [
        ("dmc", {"dmc": 17}),
        ("dmc:30-41+79+80", {"dmc": 14}),
        ("ebner:all,gruen:all", {"ebner": 12, "gruen": 44}),
        ("fourier:1x1", {"fourier": 16}),
        ("fourier", {"fourier": 16}),
        ("fourier:2x1+xc0p2", {"fourier": 29}),
        ("legendre", {"legendre": 12}),
        ("legendre:2x2", {"legendre": 12}),
        ("legendre:4x4", {"legendre": 44}),
        ("legendre:5x5,chebyshev:2x3", {"legendre": 66, "chebyshev": 18}),
        ("collocation", {"collocation": 494}),
        ("collocation:13x9,grid:2x2", {"collocation": 234, "grid": 8}),
    ],
)
def test_parse_parameters_of_families_with_sizes(spec, counts):
    """Counts of models.md 4."""
    assert {family: len(items) for family, items in parse_parameters(spec)} == counts


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ("dmc:74+80", "dmc.80 stands for the sum"),
        ("dmc:30-41+74-77,dmc:80", "dmc.80 stands for the sum"),
        ("dmc:42", "it has 29-41\\+74-77\\+79-80"),
        ("bluh:2-1", "a range goes upwards"),
        ("bluh:1-99999999999", "the range '1-99999999999' is longer than any set of parameters — it has 1-12"),
        ("bluh:1-5000", "is longer than any set"),
        pytest.param("bluh:1-" + "9" * 5000, "is longer than any set", id="more digits than an integer takes"),
        ("bluh:00000000000000000001-13", "no parameter '13'"),
        ("bluh:2x2", "'bluh' has no parameter '2x2'"),
        ("legendre:1x1", "choose from 2x2 to 6x6"),
        ("fourier:7x1", "choose from 1x1 to 6x6"),
        ("fourier:xc7p0", "as in fourier:1x1"),
        ("collocation:5x5+7x7", "choose one grid"),
        ("collocation:100000x100000", "'collocation' has no parameter"),
        ("grid:5x5_x_5_0", "'grid' has no parameter '5x5_x_5_0'"),
    ],
)
def test_parse_parameters_says_what_is_wrong(spec, message):
    with pytest.raises(InputError, match=message):
        parse_parameters(spec)


@pytest.mark.parametrize(
    "spec",
    [
        ["bluh:1-12", "ultracam_d:42-73", "brown:K1+K2+P1"],
        ["bluh:1-3+5+11-12"],
        ["dmc:30-41+74-77+79"],
        ["gruen:all", "ebner:1-4"],
        ["fourier:2x1", "legendre:4x4", "chebyshev:2x3"],
        ["collocation:19x13", "grid:5x4"],
        ["grid:5x4_x_0_0+5x4_y_4_3"],
        ["legendre:affinity+ax0y2"],
        ["lens:all"],
    ],
)
def test_format_parameters_by_example(spec):
    assert format_parameters(parse_parameters(spec)) == spec


def test_format_parameters_of_nothing():
    assert format_parameters(()) == []
    assert parse_parameters([]) == ()


@st.composite
def choices(draw):
    """Any legal choice, items in the family's order."""
    chosen = []
    for family in draw(st.lists(st.sampled_from(sorted(FAMILIES)), max_size=4, unique=True)):
        known = default_items(family) if family == "dmc" else FAMILIES[family].items
        sizes = sizes_of(family)
        if sizes is not None and draw(st.booleans()):
            known = sizes.items(draw(st.sampled_from([(2, 2), (3, 2), (2, 5), (6, 6)])))
        some = draw(st.one_of(st.just(set(known)), st.sets(st.sampled_from(known), min_size=1, max_size=9)))
        chosen.append((family, tuple(item for item in known if item in some)))
    return tuple(chosen)


@given(choices())
def test_format_parameters_is_the_inverse_of_parse(chosen):
    texts = format_parameters(chosen)
    assert parse_parameters(texts) == parse_parameters(",".join(texts)) == chosen
    assert parse_parameters([f"{family}:{'+'.join(items)}" for family, items in chosen]) == chosen


def test_unknown_items_are_refused_by_parameter_set():
    with pytest.raises(InputError, match="no parameter '13'"):
        parameter_set("bluh", ["1", "13"], camera_for("bluh"))
    with pytest.raises(InputError, match="sum of"):
        parameter_set("dmc", ["74", "80"], camera_for("dmc"))


def test_parameter_sets_of_names():
    """What a result knows are names; the sets behind them, whatever the size of a grid."""
    camera = camera_for("ultracam_d")
    names = ["bluh.3", "bluh.1", "ultracam_d.42", "dmc.34", "brown.K1", "collocation.5x4_x_0_0", "gnss.shift_X"]
    sets = parameter_sets(names, camera)
    found = [name for chosen in sets for name in chosen.names]
    assert found == ["bluh.1", "bluh.3", "ultracam_d.42", "collocation.5x4_x_0_0"]


def test_is_item():
    assert is_item("bluh", "12")
    assert is_item("collocation", "5x4_y_4_3")
    assert is_item("brown", "K1")
    assert not is_item("bluh", "13")
    assert not is_item("collocation", "5x4_y_5_3")
    assert not is_item("collocation", "999x999_y_5_3")


def test_describe():
    lines = describe()
    assert {line.family for line in lines} == set(FAMILIES)
    assert all(line.text and line.reference and set(line.mark) <= set("PLDC") for line in lines)
    by_name = {(line.family, line.item): line for line in lines}
    assert by_name["bluh", "1"].text == "angular affinity"
    assert (by_name["dmc", "34"].mark, by_name["dmc", "79"].mark, by_name["dmc", "30"].mark) == ("P", "D", "PD")
    assert "494 parameters" in by_name["collocation", "19x13"].text
    assert len([line for line in lines if line.family == "collocation"]) == 1
    assert mark_of("bluh", "1") == "P"
    assert text_of("collocation", "5x4_y_4_3") == "dy at node 4, 3 of 5x4"
    assert text_of("bluh", "99") == ""


def test_family_of_another_camera_is_refused():
    with pytest.raises(InputError, match="camera model 'ultracam_d'"):
        parameter_set("ultracam_d", ["42"], camera_for("bluh"))


def test_all_families_are_listed():
    assert set(FAMILIES) == {
        "bluh", "ultracam_d", "dmc", "ebner", "gruen", "fourier", "legendre", "chebyshev", "grid", "collocation",
        "brown", "lens", "interior",
    }  # fmt: skip
