"""Standard deviations that nothing on the ground has: refused with file and line, wherever they are stated."""

from __future__ import annotations

import pytest

import aerotri
from aerotri.conventions import InputError
from aerotri.formats.block.folder import read_block, write_block
from aerotri.formats.foreign.named_lists import read_control_list, read_positions
from aerotri.formats.foreign.odm import read_odm_geo
from aerotri.formats.foreign.pix4d import read_pix4d_gcp
from small_blocks import small_block

TINY, HUGE = "smaller than a nanometre", "larger than the earth"
ABSURD = [("1e-300", TINY), ("1e-10", TINY), ("2e7", HUGE)]


@pytest.mark.parametrize(("value", "why"), ABSURD)
@pytest.mark.parametrize(
    ("read", "header", "row"),
    [
        (read_control_list, "name,X,Y,Z,sX,sY,sZ", "P1,10,20,30,0.1,{},0.1"),
        (read_positions, "image,X,Y,Z,sX,sY,sZ", "P1,10,20,30,0.1,{},0.1"),
        (read_pix4d_gcp, "# points", "P1,10,20,30,{}"),
        (read_odm_geo, "EPSG:32632", "P1.jpg 500000 5300000 500 0 0 0 {} 0.1"),
    ],
    ids=["control", "positions", "pix4d", "odm"],
)
def test_lists(tmp_path, value, why, read, header, row):
    path = tmp_path / "list.txt"
    path.write_text(f"{header}\n{row.format(value)}\n")
    with pytest.raises(InputError, match=why) as refused:
        read(path)
    assert (refused.value.file, refused.value.line) == (path, 2)


@pytest.mark.parametrize(("value", "why"), ABSURD)
def test_tables_settings_and_options(tmp_path, value, why):
    write_block(small_block(31)[0], tmp_path / "block")
    table = tmp_path / "block" / "control.csv"
    lines = table.read_text().splitlines()
    cells = lines[1].split(",")
    cells[lines[0].split(",").index("sZ")] = value
    table.write_text("\n".join([lines[0], ",".join(cells), *lines[2:]]) + "\n")
    with pytest.raises(InputError, match=f"sZ of .* {why}") as refused:
        read_block(tmp_path / "block")
    assert (refused.value.file, refused.value.line) == (table, 2)
    table.write_text("\n".join(lines) + "\n")
    toml = tmp_path / "block" / "block.toml"
    toml.write_text(
        toml.read_text().replace("[stochastic]", f"[stochastic]\ndefault_control_sigma_m = [1, 1, {value}]")
    )
    with pytest.raises(InputError, match=why):
        read_block(tmp_path / "block")
    with pytest.raises(InputError, match=f"--positions-sigma-m: .* {why}"):
        aerotri.read(tmp_path / "block", positions_sigma_m=(0.1, 0.1, float(value)))


def test_no_error_and_a_nanometre_are_possible(tmp_path):
    (tmp_path / "a.csv").write_text("name,X,Y,Z,sX,sY,sZ\nP1,10,20,30,0,1e-9,9e6\n")
    assert read_control_list(tmp_path / "a.csv").sigma.tolist() == [[0.0, 1e-9, 9e6]]
