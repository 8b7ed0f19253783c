"""What a policy learns by regression before it trains by itself."""
