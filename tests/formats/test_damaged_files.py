"""Whatever happened to a file, its reader gives an `InputError` with a remedy, or what the file still says."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

import numpy as np
import pytest
from format_samples import FILM_TOML, SMALL, damaged
from gnss_files import grafnav, mrk, rtklib
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from aerotri.conventions import InputError
from aerotri.formats.assembly.kinds import CONTROL, ORIENTATIONS, POSITIONS, RAYS, kind_of
from aerotri.formats.block.folder import read_block
from aerotri.formats.block.settings import read_cameras_toml
from aerotri.formats.foreign.bingo import is_bingo, read_bingo
from aerotri.formats.foreign.blocks_exchange import read_blocks_exchange
from aerotri.formats.foreign.bundler import is_bundler, read_bundler
from aerotri.formats.foreign.dji_mrk import read_dji_mrk
from aerotri.formats.foreign.grafnav import read_grafnav
from aerotri.formats.foreign.ign import read_ign_app, read_ign_camera, read_ign_mes, read_ign_opk
from aerotri.formats.foreign.metashape import read_metashape
from aerotri.formats.foreign.named_lists import read_control_list, read_named_orientations, read_positions
from aerotri.formats.foreign.odm import read_odm_gcp, read_odm_geo
from aerotri.formats.foreign.opensfm import read_opensfm
from aerotri.formats.foreign.opensfm_gcp import read_opensfm_gcp
from aerotri.formats.foreign.orientation_list import read_orientation_list, read_ortho_camera
from aerotri.formats.foreign.patb import read_patb_con, read_patb_im, read_patb_ori
from aerotri.formats.foreign.pix4d import read_pix4d_eo, read_pix4d_gcp, read_pix4d_geo, read_pix4d_offset
from aerotri.formats.foreign.pix4d_params import read_pix4d_camera
from aerotri.formats.foreign.rtklib import read_rtklib
from formats.assembly.test_project import CAMERAS_TOML
from formats.block.test_block_extras import CONSTRAINTS, EDITS, MARKS, PIXELS
from formats.foreign.blocks_exchange_sample import BlocksExchange
from formats.foreign.test_bingo import SMALL as BINGO
from formats.foreign.test_bundler import BUNDLE
from formats.foreign.test_ign import APP, CAMERA, MES, OPK
from formats.foreign.test_opensfm import CONTENT, TRACKS
from formats.foreign.test_opensfm_gcp import GCP as GCP_JSON
from formats.foreign.test_orientation_lists import EO, NAMED, PLAIN, YAML, rows
from formats.foreign.test_patb import CON, IM, ORI
from formats.foreign.test_pix4d_params import CAM
from formats.foreign.test_point_lists import GCP, GEO, NATIVE, ODM_GCP, ODM_GEO, POSITIONS_LIST

QUICK = settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
READERS = {
    "bingo": (read_bingo, BINGO),
    "blocks exchange": (read_blocks_exchange, BlocksExchange("local").text()),
    "bundler": (read_bundler, BUNDLE),
    "cameras.toml": (read_cameras_toml, CAMERAS_TOML),
    "dji mrk": (read_dji_mrk, mrk(np.arange(3.0))),
    "grafnav": (read_grafnav, grafnav(np.arange(3.0), minutes=True)),
    "ign app": (read_ign_app, APP),
    "ign camera": (lambda path: read_ign_camera(path, 4.0), CAMERA),
    "ign mes": (read_ign_mes, MES),
    "ign opk": (read_ign_opk, OPK),
    "metashape": (read_metashape, rows("\t")),
    "named control": (read_control_list, NATIVE),
    "named orientations": (read_named_orientations, NAMED),
    "named positions": (read_positions, POSITIONS_LIST),
    "odm gcp": (read_odm_gcp, ODM_GCP),
    "odm geo": (read_odm_geo, ODM_GEO),
    "opensfm": (read_opensfm, json.dumps(CONTENT)),
    "opensfm gcp": (read_opensfm_gcp, json.dumps(GCP_JSON)),
    "ortho camera": (read_ortho_camera, YAML),
    "patb con": (read_patb_con, CON),
    "patb im": (read_patb_im, IM),
    "patb ori": (read_patb_ori, ORI),
    "pix4d eo": (read_pix4d_eo, EO),
    "pix4d gcp": (read_pix4d_gcp, GCP),
    "pix4d geo": (read_pix4d_geo, GEO),
    "pix4d offset": (read_pix4d_offset, "1 2 3\n"),
    "pix4d camera": (lambda path: read_pix4d_camera(path, 4.0), CAM),
    "rtklib": (read_rtklib, rtklib(np.arange(3.0), "dms", "UTC")),
    "plain": (read_orientation_list, PLAIN),
}


def _check(reader, path) -> None:
    """The reader reads, or gives an error of one printable line with a remedy."""
    error = None
    try:
        reader(path)
    except InputError as found:
        error = found
    assert error is None or (error.message and error.remedy and str(error).isprintable())


def _read_or_input_error(reader, raw: bytes) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "file"
        path.write_bytes(raw)
        _check(reader, path)
        for kinds in (RAYS, ORIENTATIONS, POSITIONS, CONTROL):
            kind_of(path, kinds)
        is_bundler(path)
        is_bingo(path)


@pytest.mark.parametrize("name", READERS)
@QUICK
@given(data=st.data())
def test_damaged_files(name, data):
    reader, text = READERS[name]
    _read_or_input_error(reader, damaged(data, text.encode()))


@pytest.mark.parametrize("name", READERS)
@settings(QUICK, max_examples=25)
@given(raw=st.binary(max_size=80))
@example(raw=b"")
@example(raw=b"\x00")
@example(raw=b"\n\n")
@example(raw=b"\xef\xbb\xbf")
@example(raw=b"# only a comment")
@example(raw=b"a b\n-99\n")
@example(raw=b"1 1\n1 1 1\n-99\n\x85\xe2\x80\xa8")
def test_any_bytes(name, raw):
    _read_or_input_error(READERS[name][0], raw)


@pytest.mark.parametrize("name", READERS)
def test_files_that_are_none(name, tmp_path):
    for path in (tmp_path / "missing", tmp_path):
        with pytest.raises(InputError):
            READERS[name][0](path)


@QUICK
@given(data=st.data())
def test_damaged_tracks(data):
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "reconstruction.json").write_text(json.dumps(CONTENT))
        (Path(folder) / "tracks.csv").write_bytes(damaged(data, TRACKS.encode()))
        _check(read_opensfm, folder)


FILM = SMALL | {
    "block.toml": FILM_TOML.replace("[10000, 8000]", "[10000, 10000]"),
    "image_points.csv": PIXELS,
    "fiducials.csv": MARKS,
    "edits.csv": EDITS.replace("a,p2,off", "b,p1,off"),
    "constraints.csv": CONSTRAINTS,
}


@settings(QUICK, max_examples=200)
@given(name=st.sampled_from(["block.toml", "fiducials.csv", "edits.csv", "constraints.csv"]), data=st.data())
def test_damaged_blocks_of_scanned_film(name, data):
    with tempfile.TemporaryDirectory() as folder:
        for other, text in FILM.items():
            (Path(folder) / other).write_bytes(damaged(data, text.encode()) if other == name else text.encode())
        _check(read_block, folder)


def test_the_film_sample_is_good(tmp_path):
    for name, text in FILM.items():
        (tmp_path / name).write_text(text)
    assert len(read_block(tmp_path).interior_fits) == 2
