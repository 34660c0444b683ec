from .generation import generate as generate
