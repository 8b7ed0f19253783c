"""The environments that are learned in."""
