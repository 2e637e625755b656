"""The guide's snippets run as they stand."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SNIPPETS = [
    pytest.param(code, id=f"{path.stem}: {section}")
    for path in sorted(ROOT.glob("*/guide/*.md"))
    for section, body in re.findall(
        r"^## (.*?)\n(.*?)(?=^## |\Z)", path.read_text("utf-8"), re.S | re.M
    )
    for code in re.findall(r"```python\n(.*?)```", body, re.S)
]


@pytest.mark.parametrize("code", SNIPPETS)
def test_a_snippet_runs(code, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    exec(compile(code, "snippet", "exec"), {})


def test_there_are_snippets():
    assert len(SNIPPETS) >= 10
