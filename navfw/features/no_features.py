"""No feature recognition: for stacks that find their way by dead reckoning alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from navfw.interfaces import FeatureRecognizer
from navfw.signals import Frame, LandmarkDetection

__all__ = ["NoFeatures"]


class NoFeatures(FeatureRecognizer):
    """Recognizes nothing: no frame has landmarks in it."""

    name: ClassVar[str] = "none"

    def recognize(self, frame: Frame) -> Sequence[LandmarkDetection]:
        """No landmarks, whatever ``frame`` shows."""
        del frame
        return ()
