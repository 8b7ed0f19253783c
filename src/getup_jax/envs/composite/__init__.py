"""Composite motion: body groups imitate clips while goals are reached."""
