"""Failure maps: verdicts on runs of a case over methods and steps, with predicted limits of the step."""
