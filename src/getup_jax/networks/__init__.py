"""Networks and distributions, of any policy, critic and prior."""
