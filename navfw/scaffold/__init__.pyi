from .new_files import write_part as write_part
from .new_files import write_project as write_project
from .part_kinds import PARTS as PARTS
