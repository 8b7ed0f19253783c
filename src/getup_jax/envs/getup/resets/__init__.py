"""Start states, made before training and drawn from while it runs."""
