"""What CITATION.cff says is what the package says."""

import re
import tomllib

from places import PROJECT


def test_citation_names_the_version_and_licence_of_the_package():
    text = (PROJECT / "CITATION.cff").read_text(encoding="utf-8")
    said = dict(re.findall(r"^([a-z-]+): *(.+)$", text, re.MULTILINE))
    project = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert said["version"] == project["version"]
    assert said["license"] == project["license"]
    assert said["cff-version"] == "1.2.0"
    assert {"message", "title", "type"} <= said.keys()
    assert "  - name: The aerotri developers" in text
