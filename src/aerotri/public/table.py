"""A table of a result: Arrow underneath, pandas and geopandas where they are installed."""

# pyright: reportUnknownParameterType=false
# (pyarrow has no types: what is annotated as its Table or Array is unknown to pyright)

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from aerotri.conventions import InputError
from aerotri.public.optional import optional_module

if TYPE_CHECKING:
    import pyarrow

SHOWN_ROWS = 10
"""Rows that a notebook shows; chosen [C]: as many as pandas shows of a long table."""
DECIMALS = {"m": 4, "mm": 4, "µm": 2, "°": 5, "mgon": 2}
"""Decimals that a notebook shows by unit; chosen [C]: a tenth of a millimetre on the ground, a tenth of a micrometre in
the image. Other numbers have four digits. The values themselves are not rounded."""


@dataclass(frozen=True, eq=False, repr=False)
class Table:
    """Named columns of equal length; the columns are those of the written file of the same name.

    Parameters
    ----------
    name : what the rows are, such as 'points'.
    arrow : the columns.
    units : unit of a column by its name, '' or missing where it has none.
    geometry : names of the columns with X, Y, Z of a row's place, None where rows have no place.
    crs : coordinate system of the geometry, 'local' or an EPSG code.

    Examples
    --------
    >>> import pyarrow as pa
    >>> table = Table("points", pa.table({"point": ["a", "b"], "Z": [1.0, 2.5]}), {"Z": "m"})
    >>> len(table), table.columns
    (2, ('point', 'Z'))
    >>> table["Z"].tolist()
    [1.0, 2.5]
    """

    name: str
    arrow: pyarrow.Table
    units: Mapping[str, str] = field(default_factory=dict)
    geometry: tuple[str, str, str] | None = None
    crs: str = "local"

    def __len__(self) -> int:
        return self.arrow.num_rows

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns."""
        return tuple(self.arrow.column_names)

    def __getitem__(self, column: str) -> np.ndarray:
        """(rows,) values of a column; NaN where a number is not known.

        Raises
        ------
        InputError
            For a column that the table does not have.
        """
        self._refuse_unknown(column)
        return self.arrow.column(column).to_numpy()

    @classmethod
    def of(cls, name: str, columns: Mapping[str, Any], units: Mapping[str, str] | None = None) -> Table:
        """A table of one's own.

        Parameters
        ----------
        name : what the rows are. columns : sequences or arrays of equal length by name. units : by column name.

        Returns
        -------
        Table

        Raises
        ------
        InputError
            When the columns have different lengths.

        Examples
        --------
        >>> Table.of("layouts", {"layout": ["corners", "dense"], "sigma": [0.08, 0.02]}, {"sigma": "m"})
        <aerotri.Table 'layouts': 2 rows of layout, sigma>
        """
        import pyarrow as pa

        lists = {key: np.asarray(values).tolist() for key, values in columns.items()}
        lengths = {key: len(values) for key, values in lists.items()}
        if len(set(lengths.values())) > 1:
            said = ", ".join(f"{key} {count}" for key, count in lengths.items())
            raise InputError(f"columns of '{name}' have different lengths: {said}", "give a value for every row")
        return cls(name, pa.table({key: pa.array(values, from_pandas=True) for key, values in lists.items()}),
                   dict(units or {}))  # fmt: skip

    def select(self, *columns: str) -> Table:
        """The table with these columns only, in this order.

        Raises
        ------
        InputError
            For a column that the table does not have.
        """
        for column in columns:
            self._refuse_unknown(column)
        return self._with(self.arrow.select(list(columns)))

    def where(self, keep: np.ndarray | Sequence[bool]) -> Table:
        """The rows for which `keep` is true.

        Parameters
        ----------
        keep : (rows,) bool.

        Examples
        --------
        >>> table = Table.of("points", {"point": ["a", "b"], "rays": [2, 5]})
        >>> table.where(table["rays"] > 2)["point"].tolist()
        ['b']
        """
        return self._with(self.arrow.take(np.flatnonzero(np.asarray(keep, dtype=bool))))

    def sorted(self, column: str, descending: bool = False) -> Table:
        """The rows in the order of a column.

        Raises
        ------
        InputError
            For a column that the table does not have.
        """
        self._refuse_unknown(column)
        return self._with(self.arrow.sort_by([(column, "descending" if descending else "ascending")]))

    def _with(self, arrow: pyarrow.Table) -> Table:
        kept = self.geometry is not None and set(self.geometry) <= set(arrow.column_names)
        return Table(self.name, arrow, self.units, self.geometry if kept else None, self.crs)

    def _refuse_unknown(self, column: str) -> None:
        if column not in self.arrow.column_names:
            raise InputError(f"the table '{self.name}' has no column '{column}'", f"it has {', '.join(self.columns)}")

    def row(self, name: str) -> dict[str, Any]:
        """The row of a name in the first column, as a dictionary.

        Raises
        ------
        InputError
            When no row has that name.
        """
        found = np.flatnonzero(self[self.columns[0]] == name)
        if not len(found):
            raise InputError(f"the table '{self.name}' has no row '{name}'", f"look at column '{self.columns[0]}'")
        return {column: self.arrow.column(column)[int(found[0])].as_py() for column in self.columns}

    def to_arrow(self) -> pyarrow.Table:
        """The columns as a `pyarrow.Table`."""
        return self.arrow

    def to_pandas(self) -> Any:
        """The table as a `pandas.DataFrame`.

        Raises
        ------
        InputError
            When pandas is not installed.
        """
        optional_module("pandas", "to_arrow() needs nothing more")
        return self.arrow.to_pandas()

    def to_geopandas(self) -> Any:
        """The table as a `geopandas.GeoDataFrame` with points in the coordinate system of the block.

        Raises
        ------
        InputError
            When the rows have no place, or geopandas is not installed.
        """
        if self.geometry is None:
            raise InputError(f"the rows of '{self.name}' have no place", "take to_pandas() or to_arrow()")
        module: ModuleType = optional_module("geopandas", "to_arrow() needs nothing more")
        x, y, z = (self[column] for column in self.geometry)
        places = module.points_from_xy(x, y, z)
        return module.GeoDataFrame(self.to_pandas(), geometry=places, crs=None if self.crs == "local" else self.crs)

    def __repr__(self) -> str:
        return f"<aerotri.Table '{self.name}': {len(self)} rows of {', '.join(self.columns)}>"

    def _repr_html_(self) -> str:
        return self.html()

    def html(self) -> str:
        """The first rows, as a notebook shows them."""
        shown = self.arrow.slice(0, SHOWN_ROWS)
        units = [self.units.get(column, "") for column in self.columns]
        columns = list(zip(self.columns, units, strict=True))
        head = "".join(f"<th>{escape(column)}{f' [{escape(unit)}]' if unit else ''}</th>" for column, unit in columns)
        rows = "".join(
            "<tr>" + "".join(f"<td>{escape(_cell(row[column], unit))}</td>" for column, unit in columns) + "</tr>"
            for row in shown.to_pylist()
        )
        more = len(self) - shown.num_rows
        caption = f"{escape(self.name)}: {len(self)} rows" + (f", the first {shown.num_rows} shown" if more > 0 else "")
        return f"<table><caption>{caption}</caption><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"


def _cell(value: Any, unit: str) -> str:
    """A value as a reader wants it: lengths and angles with the decimals that mean something, others with four digits
    and more where they are large.
    """
    if value is None or (isinstance(value, float) and np.isnan(value)):
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if not isinstance(value, float) or not np.isfinite(value):
        return str(value)
    if unit in DECIMALS:
        return f"{value:.{DECIMALS[unit]}f}"
    return f"{value:.4g}" if abs(value) < 1e4 else f"{value:.1f}"
