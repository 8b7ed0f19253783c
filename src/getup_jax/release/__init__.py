"""What is shipped of a run: the policy and its model card."""
