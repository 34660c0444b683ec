from .mapping_stack import MappingStack as MappingStack
from .shadow_stack import ShadowStack as ShadowStack
from .shadow_stack import halt as halt
from .stack import Stack as Stack
from .stack_state import StackState as StackState
from .stackfile import load_stack as load_stack
