"""Validation: cases beside measurements, published results and exact solutions, with verdicts and a page."""
