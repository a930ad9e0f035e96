"""[camera.NAME.rolling_shutter] of block.toml: read, written and read again, refused with a line where it is wrong."""

from __future__ import annotations

import pytest

from aerotri.conventions import InputError
from aerotri.formats.block.folder import read_block, write_block
from aerotri.observations import Prior, RollingShutter
from rolling_blocks import rolling_block

TABLE = "[camera.cam.rolling_shutter]\n"


@pytest.fixture
def folder(tmp_path):
    """A block without a rolling shutter; the table of it is appended by each test."""
    from dataclasses import replace

    block = rolling_block(1)[0]
    write_block(replace(block, cameras=(replace(block.cameras[0], rolling_shutter=None),)), tmp_path / "block")
    return tmp_path / "block"


def with_table(folder, text):
    """The block with lines of the table."""
    path = folder / "block.toml"
    path.write_text(path.read_text() + "\n" + TABLE + text + "\n")
    return folder


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("readout_ms = { value = 33.0, sigma = 5.0 }", RollingShutter(Prior(33.0, 5.0))),
        ("readout_ms = { fixed = false }", RollingShutter(Prior())),
        ('readout_ms = { value = 20, fixed = true }\nrow_direction = "left"\nspeed_m_s = 7.5\ntest = "off"',
         RollingShutter(Prior(20.0, fixed=True), "left", speed_m_s=7.5, test="off")),
        ('readout_ms = { value = 20 }\nmotion = "photograph"\nmotion_sigma_m_s = 0.5',
         RollingShutter(Prior(20.0), motion="photograph", motion_sigma_m_s=0.5)),
        ("", None),
    ],
)  # fmt: skip
def test_read_and_written(folder, tmp_path, text, expected):
    """What stands there is in the record, and the same after it is written."""
    block = read_block(with_table(folder, text))
    assert block.cameras[0].rolling_shutter == expected
    write_block(block, tmp_path / "again")
    assert read_block(tmp_path / "again").cameras[0].rolling_shutter == expected


def test_rates_of_rotation_in_degrees(folder, tmp_path):
    """Degrees in the file, radians in the record."""
    text = 'readout_ms = { value = 20 }\nrotation = "photograph"\nrotation_sigma_deg_s = 3.0'
    block = read_block(with_table(folder, text))
    assert block.cameras[0].rolling_shutter.rotation_sigma == pytest.approx(0.0523598776)
    write_block(block, tmp_path / "again")
    assert "rotation_sigma_deg_s = 3" in (tmp_path / "again" / "block.toml").read_text()


def test_times_that_are_none_are_refused(folder):
    """A clock time where seconds are needed: line and remedy."""
    path = with_table(folder, "readout_ms = { value = 30.0 }") / "images.csv"
    lines = path.read_text().splitlines()
    rows = [f"{line},{'12:00:01' if k == 3 else k}" for k, line in enumerate(lines[1:])]
    path.write_text("\n".join([f"{lines[0]},time", *rows]) + "\n")
    with pytest.raises(InputError, match="12:00:01") as raised:
        read_block(folder)
    assert (raised.value.file.name, raised.value.line) == ("images.csv", 5)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ('row_direction = "up"', "readout_ms is missing"),
        ('readout_ms = { value = 30.0 }\nrow_direction = "along"', "row_direction"),
        ("readout_ms = { value = 30.0 }\nreadout = 3", "unknown key"),
        ("readout_ms = { value = 30.0, sigma = -1.0 }", "sigma"),
        ("readout_ms = { value = 30.0 }\nspeed_m_s = 0.0", "speed_m_s"),
    ],
)
def test_refused_with_the_line(folder, text, match):
    """File, line and remedy."""
    with pytest.raises(InputError, match=match) as raised:
        read_block(with_table(folder, text))
    assert raised.value.file.name == "block.toml"
    assert raised.value.line
    assert raised.value.remedy
