"""Feature Recognition Processor (paper sec 2): landmarks from single images."""

from __future__ import annotations
