"""What the tests share: warm kernels are timed apart, and pictures stay off screen."""

from __future__ import annotations

import os

os.environ.setdefault("MPLBACKEND", "Agg")
