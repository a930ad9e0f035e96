"""[project] of block.toml: title, client and the like, as they stand on reports."""

from __future__ import annotations

import re
from datetime import date

from pydantic import field_validator

from aerotri.formats.block.settings_types import Section
from aerotri.formats.text.described_key import key
from aerotri.formats.text.tables import CONTROL_CHARACTERS
from aerotri.observations.project import Project

LONGEST = 200
LONGEST_NOTES = 4000
DAY = re.compile(r"[0-9]{4}-[0-9]{2}-[0-9]{2}")


class ProjectModel(Section):
    """What stands at the head of the report."""

    title: str = key("", "Title of the project.")
    client: str = key("", "Who ordered the work.")
    operator: str = key("", "Who computes.")
    company: str = key("", "Company of the operator.")
    survey_date: str = key("", "Day of the survey as YYYY-MM-DD.")
    notes: str = key("", "Anything else that belongs on the report; line breaks are kept.")

    logo: str = key("", "Picture in the block folder, PNG, JPEG or SVG, for the head of reports.")

    @field_validator("title", "client", "operator", "company", "logo")
    @classmethod
    def _one_line(cls, text: str) -> str:
        if re.search(CONTROL_CHARACTERS, text):
            raise ValueError("should be one line without control characters")
        if len(text) > LONGEST:
            raise ValueError(f"should have at most {LONGEST} characters")
        return text

    @field_validator("notes")
    @classmethod
    def _lines(cls, text: str) -> str:
        if re.search(CONTROL_CHARACTERS, text.replace("\n", "").replace("\r", "").replace("\t", "")):
            raise ValueError("should have no control characters but line breaks")
        if len(text) > LONGEST_NOTES:
            raise ValueError(f"should have at most {LONGEST_NOTES} characters")
        return text

    @field_validator("survey_date")
    @classmethod
    def _day(cls, text: str) -> str:
        try:
            known = not text or (DAY.fullmatch(text) is not None and bool(date.fromisoformat(text)))
        except ValueError:
            known = False
        if not known:
            raise ValueError("should be a day as YYYY-MM-DD, in quotes")
        return text

    def project(self) -> Project:
        """The record."""
        return Project(**self.model_dump())


class ProjectFileModel(Section):
    """[project] of block.toml in a file of its own."""

    project: ProjectModel = key(..., "Title, client and the like.")
