"""A bag as a source of ``navfw perceive``: the same percepts as of its images and tables."""

import csv
import json
import math
import os
from pathlib import Path
from typing import Any

import pytest
from bag_samples import KINDS, imu, packed_image, write_bag
from cli_calls import output

DATA = os.environ.get("NAVFW_DATA", "")
"""The folder of recordings that are not part of the repository."""


@pytest.mark.skipif(not DATA, reason="NAVFW_DATA names no folder of recordings")
@pytest.mark.parametrize("kind", KINDS)
def test_a_recorded_car_is_perceived_from_a_bag_as_from_its_folder(
    kind: str, tmp_path: Path
) -> None:
    recording = Path(DATA) / "car_gyro_lab"
    readings = (recording / "readings.csv").read_text(encoding="utf-8").splitlines()
    rows = list(csv.DictReader(readings))[530:600]
    start = float(rows[0]["time_s"])
    images = tmp_path / "images"
    images.mkdir()
    sent, times, gyro = [], ["time,file"], ["time,gyro_x [deg/s],gyro_y [deg/s],gyro_z [deg/s]"]
    for row in rows:
        time = round(float(row["time_s"]) - start, 3)
        file = recording / "images" / f"{row['frame']}_cam_image_array_.jpg"
        rates = [row[f"gyro_{axis}_deg_s"] for axis in "xyz"]
        (images / file.name).write_bytes(file.read_bytes())
        times.append(f"{time},{file.name}")
        gyro.append(",".join([str(time), *rates]))
        way = [float(row[f"accel_{axis}"]) for axis in "xyz"]
        sent.append(packed_image("/camera/compressed", time, file.read_bytes()))
        sent.append(imu(time, [math.radians(float(rate)) for rate in rates], way))
    for name, lines in (("times.csv", times), ("gyro.csv", gyro)):
        (tmp_path / name).write_text("\n".join(lines))
    bag = write_bag(tmp_path / f"car.{kind}", sent)
    of_folder = output(
        "perceive", images, "--times", tmp_path / "times.csv", "--gyro", tmp_path / "gyro.csv",
        "--hfov", "91", "--json", "--quiet",
    )  # fmt: skip
    of_bag = output("perceive", bag, "--hfov", "91", "--json", "--quiet")
    assert percepts(of_bag) == percepts(of_folder)


def percepts(printed: str) -> list[dict[str, Any]]:
    """The results, without the images' names."""
    return [{k: v for k, v in pair.items() if k != "frames"} for pair in json.loads(printed)]
