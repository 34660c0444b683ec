from .search_spaces import BreakPoints as BreakPoints
from .search_spaces import search_space as search_space
from .stack_study import StackStudy as StackStudy
from .stack_study import open_study as open_study
from .trials import Objectives as Objectives
from .trials import driver as driver
