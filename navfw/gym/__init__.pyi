from .mission_env import MissionEnv as MissionEnv

IDS: dict[str, dict[str, str]]
MAX_STEPS: int
__all__: list[str]
