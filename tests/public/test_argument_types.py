"""Arguments of another type than the function takes are input errors that name them."""

from __future__ import annotations

from collections.abc import Iterable, Sized
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import shapely

import aerotri
from aerotri import InputError
from aerotri.public.argument_types import with_checked_types

if TYPE_CHECKING:
    from aerotri.public.surfaces import SurfaceLike

WRONG = (3, None, [1, 2], {}, object(), np.zeros((3, 3)), float("nan"))


@pytest.fixture(scope="module")
def flat():
    return aerotri.Surface.of_array(np.full((9, 9), 1.0), left=0.0, top=9.0, cell=1.0)


@pytest.fixture(scope="module")
def calls(flat):
    """What is called with a wrong argument: how, the argument, and how its kind is called."""
    block = aerotri.simulate(aerotri.example_flight(), seed=1).block
    square = shapely.box(2, 2, 7, 7)
    return [
        (lambda wrong: aerotri.change(wrong, flat), "first", "a surface"),
        (lambda wrong: aerotri.change(flat, wrong), "second", "a surface"),
        (lambda wrong: aerotri.compare(wrong, flat), "test", "a surface"),
        (lambda wrong: aerotri.compare(flat, control=wrong), "control", "a surface"),
        (lambda wrong: aerotri.volume(wrong, square), "surface", "a surface"),
        (lambda wrong: aerotri.edit(wrong), "block", "a block"),
        (lambda wrong: aerotri.adjust(wrong), "block", "a block"),
        (lambda wrong: aerotri.check(wrong), "block", "a block"),
        (lambda wrong: aerotri.divide(wrong, "parts"), "block", "a block"),
        (lambda wrong: aerotri.divide(block, wrong), "folder", "the path"),
    ]


def test_wrong_types_are_named(calls):
    for call, name, kind in calls:
        for wrong in WRONG:
            with pytest.raises(InputError, match=f"^{name} is .* — give {kind}"):
                call(wrong)


def test_a_text_that_is_no_file_is_named(flat):
    for call in (lambda: aerotri.change("no/such.tif", flat), lambda: aerotri.compare(flat, "no/such.tif"),
                 lambda: aerotri.volume("no/such.tif"), lambda: aerotri.adjust("no/such.tif")):  # fmt: skip
        with pytest.raises(InputError, match=r"^no.such\.tif: "):
            call()


def test_other_arguments(flat):
    with pytest.raises(InputError, match=r"^stable is 3 — give a polygon of shapely or the path of a file or folder$"):
        aerotri.change(flat, flat, stable=3)  # pyright: ignore[reportArgumentType]
    with pytest.raises(InputError, match=r"^cell is 'wide' — give a number$"):
        aerotri.compare(flat, flat, cell="wide")  # pyright: ignore[reportArgumentType]
    block = aerotri.simulate(aerotri.example_flight(), seed=1).block
    with pytest.raises(InputError, match=r"^off is .* — give a list of names, or of pairs of names$"):
        aerotri.edit(block, off=3)  # pyright: ignore[reportArgumentType]
    with pytest.raises(InputError, match=r"^check is 'C05' — give a list of names$"):
        aerotri.edit(block, check="C05")
    with pytest.raises(InputError, match=r"^off is of the type list — give a list of names, or of pairs of names$"):
        aerotri.edit(block, off=[("a",)])  # pyright: ignore[reportArgumentType]
    with pytest.raises(InputError, match=r"^photographs is 3 — give the path of a file or folder or a list of files"):
        aerotri.dense_surface("result", 3)  # pyright: ignore[reportArgumentType]
    with pytest.raises(InputError, match=r"^area is 3 — give four numbers$"):
        aerotri.terrain("result", [], area=3)  # pyright: ignore[reportArgumentType]
    rays = block.image_points
    point, image = str(block.points[rays.point[0]]), str(block.images.names[rays.image[0]])
    for off in ([[point, image]], np.array([[point, image]])):
        assert aerotri.edit(block, off=off) is not None  # pyright: ignore[reportArgumentType]


def test_every_alternative_is_let_through():
    def taking(
        surface: SurfaceLike, cell: float | None = None, names: Iterable[str | tuple[str, str]] = (),
        other: Sized | None = None, **more: str,
    ) -> SurfaceLike:  # fmt: skip
        return surface

    checked: Any = with_checked_types(taking)
    for surface in ("a", Path("a"), SimpleNamespace(dsm=1, dtm=2)):
        for cell in (None, 1, 1.5, np.float32(2), np.int64(3), np.array(2.0)):
            for names in ((), ["a", ("b", "c")], np.array(["a"]), {"a"}, iter("a")):
                assert checked(surface, cell, names=names, other=object(), further=3) is surface
    with pytest.raises(TypeError, match="missing 1 required positional argument: 'surface'"):
        checked()
