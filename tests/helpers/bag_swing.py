"""Images of a camera that looks around, with the rates of a gyro."""

import cv2
import numpy as np
from bag_samples import Sent, image, imu
from scipy.spatial.transform import Rotation

from navfw.numerics import Array
from navfw.recording.static_frames import OPTICAL

NOISE = np.random.default_rng(5).integers(0, 256, (400, 600), np.uint8)
WIDE = np.asarray(cv2.equalizeHist(cv2.GaussianBlur(NOISE, (9, 9), 2)), np.uint8)
MIDDLES = ((299.5, 199.5), (79.5, 59.5))
"""Middle of WIDE and of the images [px]."""
YAW = 0.3 * np.sin(np.linspace(0.0, 6.0, 41))
"""The camera's yaw [rad] every 0.1 s: it looks around."""


def swinging(axes: Array, frame: str = "imu", image_frame: str = "cam") -> list[Sent]:
    """Images of a camera that turns by YAW, with the rates of a gyro with these axes."""
    sent = []
    rates = np.gradient(YAW, 0.1)
    for k, (yaw, rate) in enumerate(zip(YAW, rates, strict=True)):
        # what is far away, in the plane of an image whose middle is ahead
        turn = OPTICAL.T @ Rotation.from_euler("z", yaw).as_matrix() @ OPTICAL
        whole, part = (np.array([[80.0, 0, x], [0, 80, y], [0, 0, 1]]) for x, y in MIDDLES)
        seen = cv2.warpPerspective(WIDE, part @ turn.T @ np.linalg.inv(whole), (160, 120))
        here = {"header": {"frame_id": image_frame}}
        sent.append(image("/cam/image", 0.1 * k, np.ascontiguousarray(seen), "mono8"))
        sent[-1] = sent[-1]._replace(fields=sent[-1].fields | here)
        sent.append(imu(0.1 * k, (axes.T @ [0.0, 0.0, rate]).tolist()))
        sent[-1] = sent[-1]._replace(fields=sent[-1].fields | {"header": {"frame_id": frame}})
    return sent
