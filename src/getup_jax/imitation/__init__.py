"""What a policy is taught by regression before it trains by itself."""
