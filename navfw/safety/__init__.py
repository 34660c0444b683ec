"""The safety monitor: last in the chain, outside all plugins; it may only take speed away."""

from __future__ import annotations

from navfw.safety.monitor import SafetyMonitor, SafetyParams, SafetyVerdict

__all__ = ["SafetyMonitor", "SafetyParams", "SafetyVerdict"]
