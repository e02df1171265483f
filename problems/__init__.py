"""What is wanted: scenes as data, with their checks."""
