"""The pack of motion capture made of arithmetic, for tests of this room."""

from walking_pack import pack, sequences

__all__ = ["pack", "sequences"]
