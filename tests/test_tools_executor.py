"""Every tool that repeats something by seeds lets it be computed elsewhere."""

import ast

import pytest

from places import PROJECT

TOOLS = PROJECT / "tools"
NUMBERS = {"--seeds", "--runs", "--blocks", "--flights", "--cameras"}
"""Options that say how often something is repeated."""
OTHERS = {"prove/kill_workers.py": "runs the executors themselves, and kills their workers"}


def repeating():
    """Tools with such an option that is a number."""
    for path in sorted(TOOLS.rglob("*.py")):
        for call in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not (isinstance(call, ast.Call) and getattr(call.func, "attr", "") == "add_argument"):
                continue
            words = [one.value for one in call.args if isinstance(one, ast.Constant)]
            is_number = any(one.arg == "type" and getattr(one.value, "id", "") == "int" for one in call.keywords)
            if is_number and NUMBERS.intersection(words) and path.relative_to(TOOLS).as_posix() not in OTHERS:
                yield path.relative_to(TOOLS).as_posix()
                break


def test_there_are_such_tools():
    assert len(list(repeating())) > 20


@pytest.mark.parametrize("tool", [*repeating(), "prove/leave_one_out.py", "prove/real_check_points.py"])
def test_it_has_an_executor(tool):
    called = {
        getattr(call.func, "id", "")
        for call in ast.walk(ast.parse((TOOLS / tool).read_text(encoding="utf-8")))
        if isinstance(call, ast.Call)
    }
    assert {"add_executor", "runs_of"} <= called, f"{tool} repeats runs without --executor: see runs_elsewhere.py"
