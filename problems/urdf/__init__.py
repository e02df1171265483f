"""Arms from URDF files."""
