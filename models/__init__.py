"""Release models, contact, grip force, flight and kinematics; no scenes, no files."""
