"""Margins by calibration: predicted loss of clearance in drives that plan with a margin."""
