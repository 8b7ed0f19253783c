"""PPO for any environment; it knows no task."""
