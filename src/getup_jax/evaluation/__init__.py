"""What trained policies do: episodes without noise, their metrics, tables, plots and films."""
