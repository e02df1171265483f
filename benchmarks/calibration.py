"""Section `calibration`: to be filled."""
