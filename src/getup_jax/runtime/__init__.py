"""What a run leaves behind and hears: checkpoints, metrics, folders, the console, signals."""
