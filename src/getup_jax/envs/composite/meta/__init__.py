"""Incremental learning from a trained policy."""
