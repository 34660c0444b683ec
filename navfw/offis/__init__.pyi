from .offis import Offis as Offis
