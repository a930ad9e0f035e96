"""All files that the program reads and writes."""

from __future__ import annotations

from functools import cache

from aerotri.reference.accuracy_files import accuracy_files
from aerotri.reference.adjust_contents import adjust_contents
from aerotri.reference.adjust_tables import adjust_tables
from aerotri.reference.block_files import block_files
from aerotri.reference.block_tables import block_table_files
from aerotri.reference.change_files import change_files
from aerotri.reference.export_files import export_files
from aerotri.reference.halves_files import halves_files
from aerotri.reference.image_error_files import image_error_files
from aerotri.reference.ortho_files import ortho_files
from aerotri.reference.plan_files import plan_files
from aerotri.reference.printed import printed_contents
from aerotri.reference.records import DescribedFile
from aerotri.reference.terrain_files import terrain_files
from aerotri.reference.volume_files import volume_files


@cache
def described_files() -> tuple[DescribedFile, ...]:
    """Every file with its columns or keys: the tables of a block first, then what commands write and print."""
    return (
        *block_table_files(),
        *adjust_contents(),
        *adjust_tables(),
        *halves_files(),
        *export_files(),
        *accuracy_files(),
        *image_error_files(),
        *terrain_files(),
        *volume_files(),
        *ortho_files(),
        *change_files(),
        *plan_files(),
        *block_files(),
        *printed_contents(),
    )
