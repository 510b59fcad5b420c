"""Cases of delay blocks without fluid."""

TAU = 0.7


def delayed_loop(gain=1.0, tau=TAU, end=5.0, **numerics):
    """Case of the integrator x' = -gain x(t - tau), x = 1 up to the start."""
    controls = {
        "plant": {
            "type": "transfer-function",
            "input": "controls.gain",
            "numerator": [1.0],
            "denominator": [1.0, 0.0],
            "initial": 1.0,
        },
        "gain": {"type": "function", "inputs": {"x": "controls.late"}, "formula": f"-{gain!r}*x"},
        "late": {"type": "delay", "input": "controls.plant", "delay": tau, "initial": 1.0},
    }
    return blocks(controls, end, **numerics)


def blocks(controls, end, **numerics):
    probes = [f"controls.{name}.output" for name in controls]
    return {
        "schema": 1,
        "controls": controls,
        "numerics": {"end": end, **(numerics or {"rtol": 1e-10})},
        "output": {"every": end / 50, "probes": probes},
    }
