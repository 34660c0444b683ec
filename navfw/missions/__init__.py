"""Missions: files, the runner, outcomes and metrics; the one room between stack and simulator."""
