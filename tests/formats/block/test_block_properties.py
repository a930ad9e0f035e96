"""Any valid block comes back as it was; anything else is an InputError, never another exception."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from format_samples import SMALL, assert_same_block
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from aerotri.conventions import InputError
from aerotri.formats.block.folder import read_block, write_block
from aerotri.formats.block.writer import IMAGE_FIELDS
from aerotri.observations import (
    AdjustmentSettings,
    Block,
    Camera,
    Control,
    GnssIns,
    GnssSettings,
    ImagePoints,
    Images,
    InsSettings,
    Prior,
    Settings,
)

QUICK = settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
letters = st.characters(exclude_categories=("Cc", "Cs"))
names = st.text(letters, min_size=1, max_size=12).filter(lambda name: name == name.strip(" \t\n\r\v\f"))
lengths = st.floats(-1e7, 1e7, allow_nan=False)
positive = st.floats(1e-6, 1e6)
priors = st.one_of(st.builds(Prior, lengths, st.none() | positive), st.builds(lambda v: Prior(v, fixed=True), lengths))


def some(elements, **options):
    """Distinct names."""
    return st.lists(elements, unique=True, **options)


@st.composite
def cameras(draw, name: str) -> Camera:
    focal = draw(st.floats(0.1, 1e4))
    kind = draw(st.sampled_from(["fixed", "free", "weighted"]))
    sigma = draw(positive) if kind == "weighted" else None
    return Camera(
        name=name,
        model=draw(st.sampled_from(["frame", "ultracam_d", "dmc"])),
        size_px=(draw(st.integers(1, 100_000)), draw(st.integers(1, 100_000))),
        pixel_um=draw(st.floats(0.1, 1000.0)),
        interior={
            "focal_length_mm": Prior(focal, sigma, kind == "fixed"),
            "x0_mm": draw(priors),
            "y0_mm": draw(priors),
        },
        brown={k: draw(priors) for k in sorted(draw(st.sets(st.sampled_from(["K1", "K2", "P1", "b2"]))))},
        lens={k: draw(priors) for k in sorted(draw(st.sets(st.sampled_from(["k1", "k2"]))))},
        flight_axis=draw(st.none() | st.sampled_from(["+x", "-x", "+y", "-y"])),
    )


@st.composite
def blocks(draw) -> Block:
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    models = tuple(draw(cameras(name)) for name in draw(some(names, min_size=1, max_size=2)))
    image_names = draw(some(names, min_size=1, max_size=4))
    point_names = draw(some(names, min_size=1, max_size=5))
    n, points = len(image_names), len(point_names)
    camera = rng.integers(0, len(models), n)
    measured = rng.random((points, n)) < 0.6
    measured[0, 0] = True
    point, image = np.nonzero(measured)
    order = rng.permutation(len(point))
    point, image = point[order], image[order]
    used = list(dict.fromkeys(point.tolist()))
    not_measured = [i for i in range(points) if i not in used]
    canonical = np.array(used + not_measured)
    place = np.argsort(canonical)
    half = np.array([models[c].half_format_mm for c in camera])[image]
    sigma = np.full((len(point), 2), 0.003) if rng.random() < 0.5 else rng.uniform(1e-4, 1e-2, (len(point), 2))
    control = np.array(not_measured + used[:1], dtype=int)
    xyz = np.where(rng.random((len(control), 3)) < 0.3, np.nan, rng.uniform(-1e7, 1e7, (len(control), 3)))
    xyz[:, 2] = np.where(np.isnan(xyz).all(axis=1), 17.0, xyz[:, 2])
    start = np.where(rng.random((n, 1)) < 0.5, np.nan, rng.uniform(-1e7, 1e7, (n, 3)))
    angles = np.where(rng.random((n, 1)) < 0.5, np.nan, rng.uniform(-3, 3, (n, 3)))
    column = draw(names.filter(lambda name: name not in IMAGE_FIELDS and not name.startswith("x_")))
    return Block(
        name=draw(st.text(letters)),
        crs=draw(st.sampled_from(["local", "EPSG:25832", "EPSG:25832+7837"])),
        rotation=draw(st.sampled_from(["omega-phi-kappa", "phi-omega-kappa"])),
        cameras=models,
        images=Images(
            names=np.array(image_names),
            camera=camera,
            strip=np.array(draw(st.lists(names | st.just(""), min_size=n, max_size=n))),
            centre=start,
            angles=angles,
            columns={column: np.array(draw(st.lists(names, min_size=n, max_size=n)))},
        ),
        points=np.array(point_names)[canonical],
        image_points=ImagePoints(image, place[point], rng.uniform(-1, 1, (len(point), 2)) * half, sigma),
        control=Control(
            place[control],
            xyz,
            np.where(np.isnan(xyz), np.nan, rng.uniform(0.001, 1, xyz.shape)),
            rng.random(len(control)) < 0.5,
        ),
        gnss_ins=draw(st.none() | st.just(_gnss(rng, n))),
        settings=draw(block_settings(image_names, point_names, column)),
    )


def _gnss(rng: np.random.Generator, n: int) -> GnssIns:
    values = rng.uniform(-1e6, 1e6, (n, 3))
    sigma = rng.uniform(0.01, 1, (n, 3))
    without = rng.random((n, 1)) < 0.3
    angles = np.where(without, np.nan, values / 1e6)
    time = np.where(rng.random(n) < 0.5, np.nan, values[:, 0])
    return GnssIns(rng.permutation(n), values, sigma, angles, np.where(without, np.nan, sigma), time)


@st.composite
def block_settings(draw, image_names, point_names, column) -> Settings:
    three = st.tuples(lengths, lengths, lengths)
    elements = st.sampled_from(["X0", "Y0", "Z0", "omega", "phi", "kappa"])
    return Settings(
        adjustment=AdjustmentSettings(
            additional_parameters=draw(st.sampled_from([(), (("bluh", ("1", "2", "12")), ("brown", ("K1", "P2")))])),
            parameter_groups=draw(st.sampled_from(["camera", "block", "strip", column])),
            t_limit=draw(st.floats(0, 10)),
            robust=draw(st.sampled_from(["off", "huber", "danish", "cauchy", "adaptive", "data-snooping"])),
            datum=draw(st.sampled_from(["control", "minimal", "inner", "fixed"])),
            datum_points=tuple(draw(some(st.sampled_from(point_names)))),
            datum_fixed=tuple(draw(st.lists(st.tuples(st.sampled_from(image_names), elements), max_size=3))),
            alpha=draw(st.floats(1e-9, 0.5)),
            max_iterations=draw(st.integers(1, 100)),
        ),
        gnss=GnssSettings(
            shift=draw(st.sampled_from(["off", "block", "strip"])),
            lever_arm_m=draw(three),
            lever_arm_sigma_m=draw(st.none() | st.just((0.1, 0.2, 1e-9))),
            correlated=draw(st.sampled_from(["off", "on"])),
            correlation_time_s=draw(st.none() | st.just(31.5)),
            correlated_sigma_m=draw(st.none() | st.just((0.1, 0.2, 0.0))),
            noise_factor=draw(st.none() | st.just((1.0, 1.0)) | st.just((0.5, 2.0))),
        ),
        ins=InsSettings(draw(st.sampled_from(["off", "camera"])), draw(st.sampled_from(["off", "strip"]))),
        image_sigma_um=3.0,
        earth_curvature=draw(st.sampled_from(["off", "on"])),
    )


@QUICK
@given(block=blocks(), tables=st.sampled_from(["csv", "parquet"]))
def test_valid_blocks_come_back(block, tables):
    with tempfile.TemporaryDirectory() as folder:
        write_block(block, Path(folder) / "block", tables=tables)
        assert_same_block(read_block(Path(folder) / "block"), block)


@st.composite
def damage(draw) -> dict[str, bytes]:
    """The small block with one file cut, or some bytes of it changed, removed or put in."""
    name = draw(st.sampled_from(sorted(SMALL)))
    data = bytearray(SMALL[name].encode())
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, max(len(data) - 1, 0)))
        kind = draw(st.sampled_from(["cut", "change", "insert", "remove"]))
        some_bytes = draw(
            st.sampled_from([b",", b'"', b"\n", b"\r", b"#", b"[", b"=", b"\xff", b"-", b"9", b"e", b"\x00"])
        )
        if kind == "cut":
            del data[at:]
        elif kind == "remove":
            del data[at : at + 1]
        elif kind == "insert":
            data[at:at] = some_bytes
        else:
            data[at : at + 1] = some_bytes
    return {name: bytes(data)}


def _error_of(folder: Path) -> InputError | None:
    try:
        read_block(folder)
    except InputError as error:
        return error
    return None


def _read_or_input_error(changes: dict[str, bytes]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        for name, content in SMALL.items():
            (Path(folder) / name).write_bytes(changes.get(name, content.encode()))
        error = _error_of(Path(folder))
        assert error is None or (error.message and error.remedy)


@settings(QUICK, max_examples=400)
@given(changes=damage())
def test_damaged_blocks_give_an_input_error_or_a_block(changes):
    _read_or_input_error(changes)


@QUICK
@given(name=st.sampled_from(sorted(SMALL)), content=st.binary(max_size=200))
@example(name="image_points.csv", content=b'image,point,x,y\na,"\n')
@example(name="image_points.csv", content=b'"')
@example(name="images.csv", content=b"\x00")
@example(name="block.toml", content=b"\x00")
def test_any_bytes_give_an_input_error_or_a_block(name, content):
    _read_or_input_error({name: content})


@QUICK
@given(data=st.data())
def test_damaged_parquet_gives_an_input_error_or_a_block(data):
    with tempfile.TemporaryDirectory() as folder:
        source, place = Path(folder) / "source", Path(folder) / "block"
        source.mkdir()
        for name, content in SMALL.items():
            (source / name).write_text(content)
        write_block(read_block(source), place, tables="parquet")
        path = place / data.draw(st.sampled_from(["images.parquet", "image_points.parquet", "control.parquet"]))
        raw = bytearray(path.read_bytes())
        at = data.draw(st.integers(0, len(raw) - 1))
        if data.draw(st.booleans()):
            raw = raw[:at]
        else:
            raw[at] ^= data.draw(st.integers(1, 255))
        path.write_bytes(bytes(raw))
        error = _error_of(place)
        assert error is None or (error.message and error.remedy)
