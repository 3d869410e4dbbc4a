"""Margins chosen by calibration: how near a robot comes to obstacles that its plan keeps at the margin's distance."""
