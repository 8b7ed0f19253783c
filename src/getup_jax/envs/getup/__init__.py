"""Getting up from the floor, in the style that curves describe."""
