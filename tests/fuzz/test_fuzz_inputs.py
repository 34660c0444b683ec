"""Mutated inputs of all kinds end with success or a message that names the file, in bounds."""

from dataclasses import replace
from pathlib import Path

import pytest
from fuzz_cases import PLACED, Tried, Workshop, fuzz, table
from fuzz_targets import TARGETS, outcome_of


def check(done: list[Tried]) -> None:
    print(table(done))
    assert [tried for tried in done if tried.defect] == []


@pytest.mark.thorough
def test_a_damaged_input_is_read_or_refused() -> None:
    done = fuzz(100, seed=7)
    assert {tried.kind for tried in done} == set(TARGETS)
    assert sum(tried.code == 0 for tried in done) > 6
    check(done)


@pytest.mark.slow
def test_a_damaged_input_is_read_or_refused_in_20_000_cases() -> None:
    check(fuzz(20_000, seed=1))


def test_a_case_is_repeated_by_its_number(tmp_path: Path) -> None:
    shops = [Workshop(tmp_path / name, seed=3) for name in "ab"]
    for number in (1, 2, 5):
        kinds = [shop.write(number)[0] for shop in shops]
        assert kinds[0] == kinds[1]
        files = [tmp_path / name / kinds[0] / TARGETS[kinds[0]].file for name in "ab"]
        assert files[0].read_bytes() == files[1].read_bytes()


def test_a_defect_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(folder: Path) -> object:
        raise LookupError(folder.name)

    monkeypatch.setitem(TARGETS, "obj", replace(TARGETS["obj"], read=broken))
    shop = Workshop(tmp_path, seed=0)
    number = next(n for n in range(100) if shop.write(n)[0] == "obj")
    tried = shop.attempt(number)
    assert tried.code == -1
    assert "LookupError: obj" in tried.defect


@pytest.mark.parametrize("place", PLACED)
@pytest.mark.parametrize("kind", ["rules", "journal", "sdf"])
def test_whatever_is_in_the_place_of_a_file_is_refused(
    kind: str, place: str, tmp_path: Path
) -> None:
    folder, _ = Workshop(tmp_path, seed=0).sample(kind)
    file = folder / TARGETS[kind].file
    file.unlink()
    PLACED[place](file)
    assert outcome_of(TARGETS[kind], folder)[0] == 2
