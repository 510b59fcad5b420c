"""Viscoelastic pipe walls; imported and compiled only for scenes that contain such walls."""
