"""Viscoelastic pipe walls; imported and compiled only for models that contain them."""
