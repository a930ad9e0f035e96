"""The page on architecture names every room that the import contract has, in its order."""

import re
import tomllib

from places import PROJECT


def rooms_of_the_contract() -> list[str]:
    contracts = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]
    layers = next(contract["layers"] for contract in contracts["contracts"] if contract["type"] == "layers")
    return [room.strip().removeprefix("aerotri.") for layer in layers for room in layer.split("|")]


def test_rooms_are_on_the_page_in_their_order():
    page = (PROJECT / "docs" / "develop" / "architecture.md").read_text(encoding="utf-8")
    table = re.search(r"^\| room \|.*?\n\n", page, re.MULTILINE | re.DOTALL)
    assert table is not None
    named = [room for row in table[0].strip().splitlines() for room in re.findall(r"`(\w+)`", row.split("|")[1])]
    rooms = rooms_of_the_contract()
    assert len(rooms) > 20
    assert [room for room in named if room in rooms] == rooms
