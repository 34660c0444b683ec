"""The recogniser ``none``: no landmarks, for stacks that localise by dead reckoning."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from navfw.interfaces import FeatureRecognizer
from navfw.signals import Frame, LandmarkDetection


class NoFeatures(FeatureRecognizer):
    """Detects nothing."""

    name: ClassVar[str] = "none"

    def recognize(self, frame: Frame) -> Sequence[LandmarkDetection]:
        """No landmarks in any ``frame``."""
        del frame
        return ()
