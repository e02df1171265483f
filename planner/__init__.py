"""From a scene to a checked throw."""
