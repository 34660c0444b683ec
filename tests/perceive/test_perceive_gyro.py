from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navfw.errors import InputError
from navfw.perceive import GyroRecord, load_gyro_record


def write(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "gyro.csv"
    path.write_text(text)
    return path


@given(st.floats(0.0, 8.0), st.floats(0.01, 2.0), st.floats(-3, 3), st.floats(-1, 1))
def test_linear_rates_are_integrated_exactly(
    begin: float, length: float, rate: float, rise: float
) -> None:
    times = np.linspace(0.0, 10.0, 501)
    rates = np.zeros((501, 3))
    rates[:, 2] = rate + rise * times
    rotation_vector = GyroRecord(times=times, rates=rates, longest_gap=0.05).rotation_between(
        begin, begin + length
    )
    assert rotation_vector is not None
    expected = rate * length + rise * ((begin + length) ** 2 - begin**2) / 2
    assert rotation_vector == pytest.approx([0.0, 0.0, expected], abs=1e-9)


def test_columns_by_name_in_any_order(tmp_path: Path) -> None:
    gyro = load_gyro_record(
        write(tmp_path, "# phone\nyaw [rad/s], time (s), Pitch rate\n0.5,0,0.1\n0.5,0.1,0.1\n")
    )
    assert gyro.measured == {"yaw_rate", "pitch_rate"}
    assert gyro.rotation_between(0.0, 0.1) == pytest.approx([0.0, 0.01, 0.05])


def test_without_header(tmp_path: Path) -> None:
    gyro = load_gyro_record(write(tmp_path, "0,0.5\n0.1,0.5\n0.2,0.5\n"))
    assert gyro.measured == {"yaw_rate"}
    assert gyro.rotation_between(0.0, 0.2) == pytest.approx([0.0, 0.0, 0.1])


def test_units_and_other_columns_by_the_header(tmp_path: Path) -> None:
    header = "frame,time_ms,accel_x,gyro_x_deg_s,gyro_y_mdps,angular_velocity.z [mrad/s]\n"
    gyro = load_gyro_record(write(tmp_path, header + "0,0,9,2,3000,40\n1,100,9,2,3000,40\n"))
    expected = 0.1 * np.array([np.radians(2.0), np.radians(3.0), 0.04])
    assert gyro.rotation_between(0.0, 0.1) == pytest.approx(expected)
    assert gyro.notes == (
        "gyro columns not used: frame, accel_x",
        "the gyro's axes x, y, z are taken as ahead, left, up",
    )


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_separators(tmp_path: Path, separator: str) -> None:
    rows = [["Time (s)", '"Gyroscope z (rad/s)"'], ["0", "0.5"], ["1", "0.5"]]
    gyro = load_gyro_record(write(tmp_path, "\n".join(map(separator.join, rows))))
    assert gyro.rotation_between(0.0, 1.0) == pytest.approx([0.0, 0.0, 0.5])


@pytest.mark.parametrize("unit", ["deg/s", "°/s", "dps", "degrees/s", "deg/sec"])
def test_spellings_of_a_unit(tmp_path: Path, unit: str) -> None:
    gyro = load_gyro_record(write(tmp_path, f"t,yaw_rate [{unit}]\n0,90\n1,90\n"))
    assert gyro.rotation_between(0.0, 1.0) == pytest.approx([0.0, 0.0, np.pi / 2])


def test_offset_of_pitch_rate_is_told_from_pitching(tmp_path: Path) -> None:
    times = np.arange(0.0, 30.0, 0.05)
    pitching = 0.3 * np.sin(2.0 * times)
    rows = [f"{t:.2f},0.2,{0.07 + p:.6f}" for t, p in zip(times, pitching, strict=True)]
    gyro = load_gyro_record(write(tmp_path, "time,yaw_rate,pitch_rate\n" + "\n".join(rows)))
    assert gyro.notes[0].startswith("the gyro's pitch rate has an offset of 0.07")
    assert gyro.rates[:, 1] == pytest.approx(pitching, abs=0.01)
    # a turn to the left is not taken for an offset
    assert gyro.rates[:, 2] == pytest.approx(0.2)


def test_gaps_and_missing_numbers(tmp_path: Path) -> None:
    lines = [f"{0.01 * k:.2f},{'nan' if 300 <= k < 340 else 0.2}" for k in range(1000)]
    lines[700] = "7.00,"
    gyro = load_gyro_record(write(tmp_path, "\n".join(lines)))
    assert gyro.notes == ("41 of 1000 gyro samples are not numbers",)
    assert gyro.rotation_between(2.9, 3.1) is None
    assert gyro.rotation_between(3.1, 3.2) is None
    assert gyro.rotation_between(6.95, 7.05) == pytest.approx(
        [0.0, 0.0, 0.02]
    )  # one sample is no gap
    assert gyro.rotation_between(9.5, 10.5) is None
    assert gyro.rotation_between(-1.0, 0.5) is None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0,0\n1,0\n0.5,0\n", r"gyro\.csv:3: time 0\.500000 s does not come after 1\.0"),
        ("time,yaw\n0,0\n1,abc\n", r"gyro\.csv:3: yaw_rate: 'abc' is not a number"),
        ("time,yow_rate\n", r"gyro\.csv:1: unknown column 'yow_rate': did you mean 'yaw_rate'"),
        ("time,pitch\n0,0\n", r"gyro\.csv:1: has no column 'yaw_rate'"),
        ("0,90\n1,90\n", "are these degrees per second"),
        ("0,0\n1\n", r"gyro\.csv:2: has 1 values, not 2"),
        ("0\n1\n", "has 1 columns and no header"),
        ("time,gyro_z,yaw\n0,0,0\n", r"gyro\.csv:1: has several columns of 'yaw_rate'"),
        ("time,yaw_rate [turns]\n0,0\n", r"gyro\.csv:1: unknown unit in 'yaw_rate \[turns\]'; kn"),
        ("0,0\n5,0\n10,0\n", "samples are 5 s apart; .* name it in the header: time_ms"),
        ("", "has no usable gyro sample"),
        ("0,nan\n1,nan\n", "has no usable gyro sample"),
    ],
)
def test_what_is_wrong_is_said_with_its_line(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        load_gyro_record(write(tmp_path, text))


def test_files_that_are_none(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no such file"):
        load_gyro_record(tmp_path / "nowhere.csv")
    (tmp_path / "gyro.csv").write_bytes(bytes(range(128, 256)))
    with pytest.raises(InputError, match="expected UTF-8 text"):
        load_gyro_record(tmp_path / "gyro.csv")
