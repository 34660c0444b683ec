"""Calibrations as other programs write them: Kalibr, EuRoC, VINS, ORB-SLAM, OpenCV, ROS."""

from pathlib import Path

import pytest
from cli_calls import put_file

from navfw.errors import InputError
from navfw.lenses import CameraCalibration, load_calibration

PINHOLE = [458.6, 457.2, 367.2, 248.3]
BENT = [-0.28, 0.07, 0.0002, 0.0001]
KALIBR = """cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.28, 0.07, 0.0002, 0.0001]
  distortion_model: radtan
  intrinsics: [458.6, 457.2, 367.2, 248.3]
  resolution: [752, 480]
  rostopic: /cam0/image_raw
"""
BOTH = KALIBR + KALIBR.replace("cam0", "cam1").replace("458.6", "500.0")
EUROC = """# General sensor definitions.
sensor_type: camera
T_BS:
  cols: 4
  rows: 4
  data: [0.01, -0.99, 0.004, -0.02,
         0.99, 0.01, 0.02, -0.06,
         -0.02, 0.003, 0.99, 0.009,
         0.0, 0.0, 0.0, 1.0]
rate_hz: 20
resolution: [752, 480]
camera_model: pinhole
intrinsics: [458.6, 457.2, 367.2, 248.3] #fu, fv, cu, cv
distortion_model: radial-tangential
distortion_coefficients: [-0.28, 0.07, 0.0002, 0.0001]
"""
VINS = """%YAML:1.0
---
model_type: PINHOLE
camera_name: camera
image_width: 752
image_height: 480
distortion_parameters:
   k1: -0.28
   k2: 7.0e-02
   p1: 0.0002
   p2: 0.0001
projection_parameters:
   fx: 458.6
   fy: 457.2
   cx: 367.2
   cy: 248.3
"""
ORB = """%YAML:1.0
File.version: "1.0"
Camera.type: "PinHole"
Camera1.fx: 458.6
Camera1.fy: 457.2
Camera1.cx: 367.2
Camera1.cy: 248.3
Camera1.k1: -0.28
Camera1.k2: 0.07
Camera1.p1: 0.0002
Camera1.p2: 0.0001
Camera.width: 752
Camera.height: 480
Camera.newWidth: 600
IMU.T_b_c1: !!opencv-matrix
   rows: 4
   cols: 4
   dt: f
   data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
"""
OPENVSLAM = """Camera:
  model: "perspective"
  fx: 458.6
  fy: 457.2
  cx: 367.2
  cy: 248.3
  k1: -0.28
  k2: 0.07
  p1: 0.0002
  p2: 0.0001
  cols: 752
  rows: 480
"""
XML = """<?xml version="1.0"?>
<opencv_storage>
<image_Width>752</image_Width>
<image_Height>480</image_Height>
<Camera_Matrix type_id="opencv-matrix">
  <rows>3</rows> <cols>3</cols> <dt>d</dt>
  <data>
    4.586e+002 0. 367.2 0. 457.2 248.3 0. 0. 1.</data></Camera_Matrix>
<Distortion_Coefficients type_id="opencv-matrix">
  <rows>4</rows> <cols>1</cols> <dt>d</dt>
  <data>-0.28 0.07 2.0e-004 1.0e-004</data></Distortion_Coefficients>
</opencv_storage>
"""
OST = """# oST version 5.0 parameters


[image]

width
752

height
480

[narrow_stereo]

camera matrix
458.600000 0.000000 367.200000
0.000000 457.200000 248.300000
0.000000 0.000000 1.000000

distortion
-0.280000 0.070000 0.000200 0.000100

rectification
1.000000 0.000000 0.000000
0.000000 1.000000 0.000000
0.000000 0.000000 1.000000

projection
525.563232 0.000000 310.049056 0.000000
0.000000 524.047913 247.700893 0.000000
0.000000 0.000000 1.000000 0.000000
"""
PARTS = """width: 752
height: 480
distortion_model: plumb_bob
D: [-0.28, 0.07, 0.0002, 0.0001]
K: [458.6, 0, 367.2, 0, 457.2, 248.3, 0, 0, 1]
binning_x: 0
binning_y: 0
roi: {x_offset: 0, y_offset: 0, height: 0, width: 0, do_rectify: false}
"""
FILES = {
    "kalibr.yaml": KALIBR,
    "opencv_kalibr.yaml": f"%YAML:1.0\n{KALIBR.replace('radtan', 'plumb_bob')}",
    "sensor.yaml": EUROC,
    "vins.yaml": VINS,
    "orb3.yaml": ORB,
    "orb2.yaml": ORB.replace("Camera1.", "Camera.").replace("File.v", "# v"),
    "openvslam.yaml": OPENVSLAM,
    "out_camera_data.xml": XML,
    "ost.txt": OST,
    "camera.ini": OST.replace("\n\n\n", "\n\n").replace("[narrow_stereo]", "[camera]"),
    "indented.txt": OST.replace("\n", "\r\n   "),
    "camera_info.yaml": PARTS,
}


def read(folder: Path, text: str, name: str = "camera.yaml") -> CameraCalibration:
    return load_calibration(put_file(folder, name, text))


@pytest.mark.parametrize("name", FILES)
def test_files_of_other_programs_are_the_same_lens(name: str, tmp_path: Path) -> None:
    lens = read(tmp_path, FILES[name], name)
    numbers = [*lens.matrix.diagonal()[:2].tolist(), *lens.matrix[:2, 2].tolist()]
    assert numbers == pytest.approx(PINHOLE)
    assert lens.coefficients.tolist() == pytest.approx(BENT)
    assert (lens.model, lens.size) == ("plumb_bob", (752, 480))


def test_fisheyes_have_the_coefficients_of_their_own_names(tmp_path: Path) -> None:
    orb = ORB.replace("PinHole", "KannalaBrandt8").replace("p1:", "k3:").replace("p2:", "k4:")
    vins = VINS.replace("PINHOLE", "KANNALA_BRANDT")
    for old, new in (("fx", "mu"), ("fy", "mv"), ("cx", "u0"), ("cy", "v0"), ("k2", "k3")):
        vins = vins.replace(f"   {old}:", f"   {new}:")
    vins = vins.replace("k1:", "k2:").replace("p1:", "k4:").replace("p2:", "k5:")
    for text in (orb, vins, KALIBR.replace("radtan", "equi")):
        lens = read(tmp_path, text)
        assert (lens.model, lens.coefficients.tolist()) == ("equidistant", BENT)
    none = KALIBR.replace("radtan", "none").replace("[-0.28, 0.07, 0.0002, 0.0001]", "[]")
    assert read(tmp_path, none).coefficients.size == 0
    full = VINS.replace("PINHOLE", "PINHOLE_FULL")
    full = full.replace("   k1:", "   k3: 1\n   k4: 2\n   k5: 3\n   k6: 4\n   k1:")
    lens = read(tmp_path, full)
    assert (lens.model, lens.coefficients.tolist()) == ("rational_polynomial", [*BENT, 1, 2, 3, 4])


def test_one_of_several_cameras_is_named_or_has_the_topic(tmp_path: Path) -> None:
    path = put_file(tmp_path, "camchain.yaml", BOTH)
    for camera in ("cam1", "/cam1/image_raw"):
        assert load_calibration(path, camera).matrix[0, 0] == 500.0
    for other in (None, "cam2"):
        with pytest.raises(InputError, match="several cameras, cam0, cam1: choose one by --camera"):
            load_calibration(path, other)
    stereo = put_file(tmp_path, "orb.yaml", ORB + "Camera2.fx: 1\n")
    with pytest.raises(InputError, match="has several cameras, Camera1, Camera2"):
        load_calibration(stereo)


def test_binned_and_cut_images_are_those_of_rep_104(tmp_path: Path) -> None:
    part = PARTS.replace(
        "x_offset: 0, y_offset: 0, height: 0, width: 0",
        "x_offset: 152, y_offset: 40, height: 400, width: 500",
    )
    lens = read(tmp_path, part.replace("_x: 0", "_x: 2").replace("_y: 0", "_y: 4"))
    assert lens.size == (250, 100)
    assert lens.matrix.diagonal().tolist() == [458.6 / 2, 457.2 / 4, 1.0]
    assert lens.matrix[:2, 2] == pytest.approx([(215.2 + 0.5) / 2 - 0.5, (208.3 + 0.5) / 4 - 0.5])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (KALIBR.replace("pinhole", "omni"), r"yaml:3: cam0\.camera_model: the model 'omni' is not"),
        (
            KALIBR.replace("radtan", "fov"),
            "yaml:5: cam0.distortion_model: the model 'fov' is",
        ),
        (VINS.replace("PINHOLE", "MEI"), "yaml:3: model_type: the model 'MEI' is not supported"),
        (KALIBR.replace("radtan", "radtam"), "the model 'radtam' is not supported: did you mean"),
        (KALIBR.replace("458.6,", ""), r"yaml:6: cam0\.intrinsics: expected 3 x 3 numbers, got 3"),
        (VINS.replace("fy", "fz"), "has no key 'fy'"),
        (ORB.replace("458.6", "wide"), r"yaml:4: Camera1\.fx: 'wide' is not a number"),
        (PARTS.replace("x: 0", "x: -1", 1), "yaml:6: binning_x: expected pixels, 0 to 20000, got"),
        (
            PARTS.replace("x: 0", "x: 2", 1).replace("367.2", "180"),
            "yaml:5: K: its principal point 180 is not near the middle of 752 px",
        ),
        (
            EUROC.replace("752, 480", "376, 240"),
            "its principal point 367.2 is not near the middle of 376 px: .* another size",
        ),
        (
            OST + OST.replace("narrow_stereo", "right"),
            "several cameras, narrow_stereo, right: save",
        ),
        (OST.replace("458.6", "?"), "yaml:14: camera matrix: '.00000' is not a number"),
        ("<opencv_storage><a>1</a></opencv_storage>", "has no key 'camera_matrix'"),
        ("<opencv_storage><a>1</opencv_storage>", "yaml:1: expected XML of OpenCV's FileStorage"),
    ],
)
def test_what_is_wrong_is_said_with_its_place(text: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=said):
        read(tmp_path, text)
