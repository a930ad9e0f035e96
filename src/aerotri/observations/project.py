"""Who a block belongs to and what it is for."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from pathlib import PurePosixPath


@dataclass(frozen=True)
class Project:
    """What `[project]` of block.toml says; '' where nothing is given.

    Parameters
    ----------
    title : of the project.
    client : who ordered the work.
    operator : who computes.
    company : of the operator.
    survey_date : day of the survey, YYYY-MM-DD.
    notes : anything else that belongs on the report.
    logo : name of a picture in the block folder. logo_content : its bytes.
    """

    title: str = ""
    client: str = ""
    operator: str = ""
    company: str = ""
    survey_date: str = ""
    notes: str = ""
    logo: str = ""
    logo_content: bytes = field(default=b"", repr=False)

    @property
    def logo_ending(self) -> str:
        """'.png', '.jpg' or '.svg'; '' without a logo."""
        ending = PurePosixPath(self.logo).suffix.lower()
        return ".jpg" if ending == ".jpeg" else ending

    def as_dict(self) -> dict[str, str]:
        """All entries by name."""
        return {one.name: str(getattr(self, one.name)) for one in fields(self) if one.name != "logo_content"}

    def given(self) -> dict[str, str]:
        """The entries that say something, by name."""
        return {name: text for name, text in self.as_dict().items() if text}
