"""Motions made by hand, and more of them out of few."""
