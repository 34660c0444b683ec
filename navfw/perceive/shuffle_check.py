"""Whether images follow each other in time, by their likeness."""

from __future__ import annotations

import cv2
import numpy as np
from scipy.spatial.distance import cdist

from navfw.errors import InputError
from navfw.signals import Array, Image

_SIZE = (16, 12)
"""Width and height of the images that are compared [px]."""
_MIN_CONTRAST = 2.0
"""Standard deviation below which there is nothing to compare [grey levels]."""
_FIRST, _LAST = 32, 2048
"""Least and largest number of images after which all are compared; in between at each doubling."""
_MIN_IMAGES = 12
"""Least number of images to compare at the end."""
_MIN_DIFFERENCE = 0.05
"""Mean difference of neighbours [standard deviations] below which the camera stands still."""
_UNLIKE = 0.6
"""Difference of neighbours, as part of that of any two, from which they may be shuffled."""
_MUCH_MORE_ALIKE = 0.33
"""Difference to the likest image, as part of that of neighbours: below it they are shuffled. It is
0.6 to 1 for recordings and for photographs of different places, 0.4 where a car passes the same
place lap by lap and is seen there every few seconds."""


class ShuffleCheck:
    """Compares the images of a sequence with each other as they come.

    In a shuffled one neighbours are as different as any two images, while most have a much liker
    one elsewhere.
    """

    def __init__(self) -> None:
        self._names: list[str] = []
        self._looks: list[Array] = []

    def add(self, name: str, image: Image) -> None:
        """Add the next image (height, width, 3).

        Raises:
            InputError: the images so far are shuffled.

        """
        if len(self._looks) >= _LAST:
            return
        small = cv2.resize(image, _SIZE, interpolation=cv2.INTER_AREA)
        look = cv2.cvtColor(small, cv2.COLOR_BGR2GRAY).astype(np.float64).ravel()
        self._names.append(name)
        self._looks.append((look - look.mean()) / max(float(look.std()), _MIN_CONTRAST))
        count = len(self._looks)
        if count >= _FIRST and count & (count - 1) == 0:
            self._compare()

    def finish(self) -> None:
        """Compare the images once more after the last one.

        Raises:
            InputError: the images are shuffled.

        """
        if len(self._looks) >= _MIN_IMAGES:
            self._compare()

    def _compare(self) -> None:
        looks = np.array(self._looks)
        apart = cdist(looks, looks, "cityblock") / looks.shape[1]
        neighbours = np.diagonal(apart, 1)
        usual = float(np.median(neighbours))
        anywhere = float(np.median(apart[np.triu_indices(len(looks), 1)]))
        np.fill_diagonal(apart, np.inf)
        if usual < max(_UNLIKE * anywhere, _MIN_DIFFERENCE):
            return
        if float(np.median(apart.min(axis=1))) >= _MUCH_MORE_ALIKE * usual:
            return
        k = int(np.argmin(apart.min(axis=1)[:-1] / np.maximum(neighbours, 1e-9)))
        like = self._names[int(apart[k].argmin())]
        raise InputError(
            f"the images seem to be shuffled: this one is most like {like}, and unlike its "
            f"neighbour {self._names[k + 1]}; number them in the order of time",
            file=self._names[k],
        )
