"""What makes training easier at first: which starts, with how much help, on which ground."""
