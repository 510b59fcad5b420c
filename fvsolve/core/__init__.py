"""Model of a case and its solution; names no part, no feature and no study.

Kernels, steppers, fluids and the base classes of lowerings import only `compile`. Model, solution, output and runs
import also `case` and the base classes of `parts`.
"""
