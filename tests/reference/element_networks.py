"""Cases of networks of elements without fluid."""

import fvsolve

GROUND = {"gnd": {"type": "ground"}}


def network(nodes, links, end=1.0, probes=None, **more):
    """Case of a network without fluid; nodes given as a list of names are terminals."""
    if isinstance(nodes, str):
        nodes = GROUND | {name: {"type": "terminal"} for name in nodes.split()}
    numerics = {"end": end, "rtol": 1e-11, **more.pop("numerics", {})}
    output = {"every": end / 40} | ({"probes": probes} if probes else {})
    return {
        "schema": 1,
        "nodes": nodes,
        "links": links,
        "numerics": numerics,
        "output": output,
        **more,
    }


def two_port(kind, start, stop, **keys):
    return {"type": kind, "from": start, "to": stop, **keys}


def runs(case, method="dormand-prince", **set):
    run = fvsolve.run(case, {"numerics.method": method} | set)
    assert run.ok, run.reason
    return run
