"""What is public stays, or was deprecated in an earlier version than that of its removal."""

import re
from pathlib import Path

import public_api
import pytest
from public_api import LIST, ROOT, listed, public


def versions() -> set[str]:
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    return set(re.findall(r"^## \[?(\d+\.\d+\.\d+)", text, re.MULTILINE))


def order(version: str) -> tuple[int, ...]:
    return tuple(map(int, version.split(".")))


def complaints() -> list[str]:
    """What is wrong with the list, a sentence each."""
    now, known = public(), listed()
    said = [f"{name} is not listed: run tests/helpers/public_api.py" for name in now - known.keys()]
    for name, mark in known.items():
        if mark is None and name not in now:
            said.append(f"{name} has gone without a deprecation: see tests/helpers/public_api.py")
        elif mark is not None and name in now:
            said.append(f"{name} is marked as removed, and still there")
        elif mark is not None and not (
            order(mark[1])[:2] < order(mark[0])[:2] and {*mark} <= versions()
        ):
            said.append(
                f"{name}: {' and '.join(mark)} are no two versions of CHANGELOG.md in order"
            )
    return said


def test_nothing_public_disappears_without_a_deprecation() -> None:
    assert complaints() == []
    names = listed()
    assert len(names) > 900
    assert {
        "name navfw.Stack",
        "option navfw run --seed",
        "exit code 130",
        "key of world: .walls[].height",
        "result command_hash",
        "plugin behavior: propose(self, context)",
        "channel /command navfw.Command",
        "ros topic imu",
    } <= {*names}, sorted(names)


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        ("name navfw.Gone\n", "navfw.Gone has gone without a deprecation"),
        ("name navfw.Gone  # removed in 9.1.0, deprecated in 9.0.0\n", "no two versions"),
        ("name navfw.Stack  # removed in 9.1.0, deprecated in 9.0.0\n", "and still there"),
    ],
)
def test_what_went_is_named(
    lines: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = LIST.read_text(encoding="utf-8").replace("name navfw.Stack\n", "")
    changed = tmp_path / "public-api.txt"
    changed.write_text(text + lines, encoding="utf-8")
    monkeypatch.setattr(public_api, "LIST", changed)
    assert any(said in complaint for complaint in complaints())
