"""Goal tasks of composite motion: the Protocol, the goals, and any number of them at once."""

from getup_jax.envs.composite.goals.combine import GOALS, Goals, equipment_of, make_goals
from getup_jax.envs.composite.goals.goal import Goal, GoalOutput, Marker

__all__ = ["GOALS", "Goal", "GoalOutput", "Goals", "Marker", "equipment_of", "make_goals"]
