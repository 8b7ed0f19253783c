"""The conditional VAE of human poses: its data, training, cache and use."""
