"""The last line of a command: where its result is."""

from pathlib import Path

from aerotri.commands.console import written


def test_a_page_is_named_where_one_was_written(tmp_path):
    target = tmp_path / "two flights"
    target.mkdir()
    assert written(target, "change.html") == f"Written to {target}"
    (target / "change.html").write_text("", encoding="utf-8")
    assert written(target, "change.html") == f"Written to {target}, page: {target / 'change.html'}"
    assert written(Path("out"), "dsm.html") == "Written to out"
