"""The safety monitor: last in the chain, outside all plugins; it may only take speed away."""

from __future__ import annotations

from navfw.safety.monitor import PersistentFailure, SafetyMonitor, SafetyParams, SafetyVerdict

__all__ = ["PersistentFailure", "SafetyMonitor", "SafetyParams", "SafetyVerdict"]
