"""The pack of motion capture made of arithmetic, for tests of this room."""

from walking_pack import pack, takes

__all__ = ["pack", "takes"]
