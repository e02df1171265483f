"""`throwplan report`: error against run time, stability, and what a scene leaves out."""
