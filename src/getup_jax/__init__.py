"""A simulator and trainer that teaches a physics-based humanoid to get up."""

__version__ = "0.1.0"
