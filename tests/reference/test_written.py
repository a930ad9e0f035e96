"""What commands write and print against the reference, in both directions."""

from __future__ import annotations

import json

import jsonschema
import laspy
import pyarrow.parquet as pq
import pytest

from aerotri.cli.app import app
from aerotri.reference.command_lines import command_lines
from aerotri.reference.files import described_files
from aerotri.reference.schemas import json_files, schema_of

FILES = {described.label: described for described in described_files()}
CLOUDS = [one for one in described_files() if one.form == "cloud"]
TABLES = [one for one in described_files() if one.form == "table"]
JSON_FILES = [one for one in json_files() if one.place != "printed"]
PRINTED_CONTENT = {
    "adjust": "adjustment.json (result of adjust)", "deform": "deform.json (folder of deform)",
    "demcor": "NAME_demcor.json (folder of demcor)", "imgeo": "imgeo.json (folder of imgeo)",
    "crosscheck": "crosscheck.json (folder of crosscheck)", "dtm": "dtm.json (folder of dtm)",
    "dsm": "dsm.json (folder of dsm)",
    "halves": "halves.json (folder of halves)", "ortho": "ortho.json (folder of ortho)",
    "change": "change.json (folder of change)", "accuracy": "accuracy.json (folder of accuracy)",
    "plan": "plan.json (folder of plan)",
    "compare": "compare.json (folder of compare)", "volume": "volume.json (folder of volume)",
    "tiepoints": "tiepoints.json (block of tiepoints)", "run": "run.json (folder of run)",
}  # fmt: skip
"""Commands that print the content of a file."""
PRINTED_OTHERWISE = {"change": ("core_points", "cloud_change.json (folder of change)")}
"""What else a command prints, and a key that only this has."""
NEVER_HERE = {
    "gnss_ins.csv (block folder)", "fiducials.csv (block folder)", "edits.csv (block folder)",
    "constraints.csv (block folder)", "compare_parameters.csv (result of adjust)",
    "compare_parameters.json (result of adjust)",
}  # fmt: skip
"""Files that the small blocks of these tests do not lead to: `test_block_tables` holds the tables of a block against
their readers, and the two others come from the function that writes them for compare-parameters."""


def rows_of(path):
    """The header of a table; a CSV file may begin with comments."""
    if path.suffix == ".parquet":
        return tuple(pq.read_schema(path).names)
    lines = [line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    return tuple(lines[0].split(","))


def found(written, described):
    return [folder / described.name for folder in written.places[described.place] if (folder / described.name).exists()]


@pytest.mark.parametrize("described", TABLES, ids=lambda one: one.label)
def test_columns(written, described):
    """Every column that is written is described, in its order, and every described one is written somewhere."""
    paths = found(written, described)
    if described.label in NEVER_HERE and not paths:
        return
    assert paths
    required = {one.name for one in described.items if not one.optional}
    seen = set()
    for path in paths:
        header = rows_of(path)
        assert [name for name in described.columns if name in header] == list(header), path
        seen |= set(header)
    assert required <= seen


@pytest.mark.parametrize("described", CLOUDS, ids=lambda one: one.label)
def test_dimensions_of_clouds(written, described):
    paths = found(written, described)
    assert paths
    for path in paths:
        with laspy.open(path) as cloud:
            assert tuple(cloud.header.point_format.extra_dimension_names) == described.columns


@pytest.mark.parametrize("described", JSON_FILES, ids=lambda one: one.label)
def test_json_files(written, described):
    """Every JSON file fits its schema, which allows no key that is not described."""
    paths = found(written, described)
    assert paths or described.label in NEVER_HERE
    for path in paths:
        jsonschema.validate(json.loads(path.read_text(encoding="utf-8")), schema_of(described))


def test_printed_json(written):
    """So does what commands print with --json, of every command that there is."""
    for command, contents in written.printed.items():
        own = f"aerotri {command} --json (printed)"
        described = FILES[own if own in FILES else PRINTED_CONTENT[command]]
        key, other = PRINTED_OTHERWISE.get(command, ("", ""))
        for content in contents:
            is_other = isinstance(content, dict) and key in content
            jsonschema.validate(content, schema_of(FILES[other] if is_other else described))
    assert {one.name for one in described_files() if one.place == "printed"} <= {
        f"aerotri {command} --json" for command in written.printed
    }


def test_every_command_has_a_reference_of_what_it_prints():
    """Commands with --json that a later version adds are found here."""
    printing = {one.name for one in command_lines(app) if any("--json" in option.names for option in one.options)}
    own = {
        one.name.removeprefix("aerotri ").removesuffix(" --json") for one in described_files() if one.place == "printed"
    }
    assert printing == own | set(PRINTED_CONTENT)


def test_every_file_is_described(written):
    """Nothing is written that the reference does not name, and what it says is always written is there."""
    for place, folders in written.places.items():
        described = {one.name: one for one in described_files() if one.place == place}
        if place == "block folder":
            continue
        for folder in folders:
            names = {path.name for path in folder.iterdir() if not path.name.startswith(".")}
            unknown = {name for name in names if not _is_described(name, place, described)}
            assert not unknown, (place, unknown)
            always = {name for name, one in described.items() if not one.when and name.split(".")[0].isalpha()}
            always -= {name for name in always if name.split(".")[0].isupper()}
            assert always <= names, (place, always - names)


def _is_described(name, place, described):
    if place.startswith("block of") and name in {one.name for one in FILES.values() if one.place.startswith("block")}:
        return True
    stem, _, ending = name.rpartition(".")
    patterns = {one for one in described if one.split(".")[0].isupper() and one.endswith(f".{ending}")}
    return name in described or name == "block.toml" or bool(patterns) or f"{stem}.png" in described or (
        ending == "svg" and any(one.endswith(".png") for one in described)
    )  # fmt: skip


def test_schema_refuses_a_stranger(written):
    """A key that is not described, one that is missing, and a wrong type are all found."""
    described = FILES["volume.json (folder of volume)"]
    content = json.loads(found(written, described)[0].read_text(encoding="utf-8"))
    schema = schema_of(described)
    for wrong in (
        content | {"stranger": 1},
        {name: value for name, value in content.items() if name != "net_m3"},
        content | {"net_m3": "much"},
        content | {"boundary": content["boundary"] | {"stranger": 1}},
    ):
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(wrong, schema)
