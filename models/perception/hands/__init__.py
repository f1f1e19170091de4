"""Hands on crops that the body gives: 21 landmarks of each, in the picture and in space."""
