"""Networks of potential and flow: rotation, electricity and heat, with the forces on masses that they move."""
