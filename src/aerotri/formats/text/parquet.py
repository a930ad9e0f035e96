"""Parquet files as tables of text and float64 columns, the same as a CSV table gives."""

# pyright: reportUnknownParameterType=false
# (pyarrow has no types: what is annotated as its Table or Array is unknown to pyright)

from __future__ import annotations

from collections.abc import Generator, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from aerotri.conventions import InputError, regular_file

if TYPE_CHECKING:
    import pyarrow as pa


def load_parquet(path: Path) -> pa.Table:
    """All columns of a Parquet file, of the types it has.

    Raises
    ------
    InputError
        When the file is not readable.
    """
    from pyarrow import parquet

    regular_file(path)
    with _told(path):
        return parquet.ParquetFile(path).read()


def batches(path: Path, rows: int) -> Iterator[pa.Table]:
    """The rows of a Parquet file, so many at a time; one table at least, which may have none.

    Raises
    ------
    InputError
        When the file is not readable.
    """
    import pyarrow as pa
    from pyarrow import parquet

    regular_file(path)
    with _told(path):
        # without a buffer a whole column of a row group is read at once
        file = parquet.ParquetFile(path, buffer_size=1 << 20, pre_buffer=False)
        if not file.metadata.num_rows:
            yield file.read()
        for batch in file.iter_batches(rows):
            yield pa.Table.from_batches([batch])


@contextmanager
def _told(path: Path) -> Generator[None]:
    import pyarrow as pa

    try:
        yield
    except InputError:
        raise
    except (pa.ArrowException, OSError, ValueError, TypeError, MemoryError) as error:
        short = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(f"cannot be read as Parquet: {short}", "write the table anew, or as CSV", path) from error


def with_kinds(table: pa.Table, text: list[str], numbers: list[str], path: Path) -> pa.Table:
    """The named columns as string (empty where null) and as float64.

    Raises
    ------
    InputError
        For a column of a type that is neither.
    """
    import pyarrow as pa
    from pyarrow import compute

    columns = {}
    for name in text:
        column = table.column(name)
        kind = column.type.value_type if pa.types.is_dictionary(column.type) else column.type
        if not _is_text(kind) and not pa.types.is_integer(kind) and not pa.types.is_null(kind):
            raise InputError(f"column '{name}' holds {kind}, not text", "write names as strings", path)
        columns[name] = compute.fill_null(column.cast(pa.string()), "")
        try:
            columns[name].validate(full=True)
        except pa.ArrowInvalid as error:
            raise InputError(f"column '{name}' is not UTF-8", "write the table anew", path) from error
    for name in numbers:
        kind = table.column(name).type
        if not (pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_null(kind)):
            raise InputError(f"column '{name}' holds {kind}, not numbers", "write numbers as float64", path)
        columns[name] = table.column(name).cast(pa.float64(), safe=False)
    return pa.table(columns) if columns else table.select([])


def _is_text(kind: pa.DataType) -> bool:
    import pyarrow as pa

    # pyarrow 15 has no string views yet
    is_view = hasattr(pa.types, "is_string_view") and pa.types.is_string_view(kind)
    return pa.types.is_string(kind) or pa.types.is_large_string(kind) or is_view
