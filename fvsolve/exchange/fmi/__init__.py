"""Functional mock-up units (FMI 2.0, co-simulation) of cases."""
