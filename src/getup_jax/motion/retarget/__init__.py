"""Recordings of any skeleton on a character."""
