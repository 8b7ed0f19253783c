"""Get-ups in clips, and the style curves that describe them."""
