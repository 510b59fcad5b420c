"""Up to which step a scheme and a method hold. Knows schemes, methods and a model's waves; runs nothing."""
