"""Model of a case and its solution: kernels to runs; may import base classes of `parts`, `case`, and no feature.

Kernels, steppers, fluids and the base classes of lowerings import nothing above them but `compile`. Model, solution,
output and runs import also `case`.
"""
