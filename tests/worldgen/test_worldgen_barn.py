"""Reference paths of the BARN benchmark."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from navfw.errors import ConfigError
from navfw.worldgen import reference_length


def test_the_reference_path_runs_from_the_start_over_its_cells_to_the_goal(tmp_path: Path) -> None:
    # straight ahead: column 16 at x = -2.175, rows 0 and 29 at y = 5.075 and 9.425
    np.save(tmp_path / "path_7.npy", np.array([[16, 0], [16, 29]]))
    ends = np.hypot(0.075, 5.075 - 3.0) + np.hypot(0.075, 13.0 - 9.425)
    expected = pytest.approx(ends + 29 * 0.15, abs=1e-3)
    assert reference_length(tmp_path / "world_7.world") == expected


def test_worlds_without_a_reference_path_have_none(tmp_path: Path) -> None:
    assert reference_length(tmp_path / "world_7.world") is None
    assert reference_length(tmp_path / "depot.world") is None


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (np.zeros((3, 3)), "expected cells"),
        (np.array(["a"]), "expected cells"),
        (np.array([[np.nan, 1.0]]), "not finite"),
        (np.array([{}], dtype=object), "no NumPy array"),
    ],
)
def test_a_file_that_holds_no_path_is_refused(
    tmp_path: Path, content: np.ndarray, told: str
) -> None:
    np.save(tmp_path / "path_7.npy", content, allow_pickle=True)
    with pytest.raises(ConfigError, match=told) as error:
        reference_length(tmp_path / "world_7.world")
    assert "path_7.npy" in str(error.value)


def test_a_damaged_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "path_7.npy").write_bytes(b"\x93NUMPY\x01\x00")
    with pytest.raises(ConfigError, match="no NumPy array"):
        reference_length(tmp_path / "world_7.world")
