"""What everything else is made of: types, quaternions, mirror images, shipped files."""
