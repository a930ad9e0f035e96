"""Image points sorted into numbered files as they come, to be read again file by file."""

# pyright: reportUnknownParameterType=false
# (pyarrow has no types: what is annotated as its Table or Array is unknown to pyright)

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, BinaryIO, Self

import numpy as np

from aerotri.observations import ImagePoints

if TYPE_CHECKING:
    import pyarrow as pa

MOST_OPEN = 500
"""Files open at a time: systems allow a thousand or more."""
COLUMNS = ("row", "image", "x", "y", "sx", "sy")


@dataclass(frozen=True, eq=False)
class NamedRays:
    """Some image points of a block.

    Parameters
    ----------
    row : (m,) of the table of all. rays : `point` is the index into the names.
    names : (P,) of their points, a pyarrow string array, in order of first appearance.
    """

    row: np.ndarray
    rays: ImagePoints
    names: pa.StringArray

    def take(self, rows: np.ndarray) -> NamedRays:
        """Some of them; the names stay."""
        r = self.rays
        return NamedRays(self.row[rows], ImagePoints(r.image[rows], r.point[rows], r.xy[rows], r.sigma[rows]),
                         self.names)  # fmt: skip


class RayFiles:
    """Files of image points by number; they are removed with the folder in which they are.

    Parameters
    ----------
    folder : that exists. name : what the files are called before their number.
    """

    def __init__(self, folder: Path, name: str):
        self._folder, self._name = folder, name
        self._open: OrderedDict[int, tuple[Any, BinaryIO]] = OrderedDict()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        while self._open:
            self._close_oldest()

    def append(self, number: np.ndarray, rays: NamedRays) -> None:
        """Every image point to the file of its number, (m,) int."""
        order = np.argsort(number, kind="stable")
        table = _arrow(rays.take(order))
        there, first, count = np.unique(number[order], return_index=True, return_counts=True)
        for one, begin, length in zip(there.tolist(), first, count, strict=True):
            self._writer(one, table.schema).write_table(table.slice(begin, length))

    def read(self, number: int) -> NamedRays:
        """The image points of a file in the order of the table of all; none where there is no file.

        The files have to be whole: the context in which they were written is over.
        """
        import pyarrow as pa

        path = self._path(number)
        if not path.exists():
            nothing, index = np.zeros((0, 2)), np.zeros(0, np.int64)
            return NamedRays(index, ImagePoints(index, index, nothing, nothing), pa.array([], pa.string()))
        tables, size = [], path.stat().st_size
        with path.open("rb") as file:
            while file.tell() < size:
                with pa.ipc.open_stream(file) as stream:
                    tables.append(stream.read_all())
        table = pa.concat_tables(tables)
        row, image, x, y, sx, sy = (table.column(name).to_numpy() for name in COLUMNS)
        order = np.argsort(row, kind="stable")
        point = table.column("point").take(order).combine_chunks().dictionary_encode()
        rays = ImagePoints(
            image[order].astype(np.int64), point.indices.to_numpy().astype(np.int64),
            np.column_stack([x, y])[order], np.column_stack([sx, sy])[order],
        )  # fmt: skip
        return NamedRays(row[order], rays, point.dictionary)

    def drop(self, number: int) -> None:
        """Remove a file."""
        self._path(number).unlink(missing_ok=True)

    def _path(self, number: int) -> Path:
        return self._folder / f"{self._name}_{number}"

    def _writer(self, number: int, schema: Any) -> Any:
        """Of a file that may have been closed before: it then holds one stream after the other."""
        import pyarrow as pa

        if number not in self._open:
            if len(self._open) >= MOST_OPEN:
                self._close_oldest()
            file = self._path(number).open("ab")
            self._open[number] = pa.ipc.new_stream(file, schema), file
        self._open.move_to_end(number)
        return self._open[number][0]

    def _close_oldest(self) -> None:
        _, (writer, file) = self._open.popitem(last=False)
        writer.close()
        file.close()


def _arrow(rays: NamedRays) -> Any:
    import pyarrow as pa

    r = rays.rays
    values = (rays.row, r.image.astype(np.int32), *r.xy.T, *r.sigma.T)
    columns = {name: pa.array(one) for name, one in zip(COLUMNS, values, strict=True)}
    return pa.table(columns | {"point": rays.names.take(pa.array(r.point))})
