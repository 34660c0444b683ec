from .mission_env import MissionEnv as MissionEnv

IDS: dict[str, dict[str, str]]
__all__: list[str]
