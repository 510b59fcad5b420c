"""Pieces of a network that no link connects do not affect each other: each starts with the bits of its own problem."""

import numpy as np
import pytest

from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.kernels.steady_edges import FRICTION, LEAK, RESTRICTION, friction_drop, law_of
from fvsolve.core.steady import Edge, solve_steady

NAN = float("nan")


def friction(loss: float) -> np.ndarray:
    """Law of a pipe with the drop loss |M| M."""
    return law_of(
        FRICTION, 1.0, float(rec.FRICTION_FACTOR), loss, 0.0, 0.0, 1.0, 1e-6 * (loss > 0.0)
    )


def line(head: float):
    """Pipe and restriction between two potentials, with a demand between them."""
    edges = [
        Edge(0, 1, friction(300.0), flow=70.0),
        Edge(1, 2, law_of(RESTRICTION, 0.02, 0.5, 1e-3, 2e-3), flow=44.0),
    ]
    return np.array([head, NAN, 1e5]), np.array([0.0, 3.0, 0.0]), edges, np.array([70.0, 44.0])


def loop(flow: float):
    """Two equal pipes without friction side by side, behind a fixed flow out of a potential."""
    law = friction(200.0)
    edges = [
        Edge(0, 1, None, flow, drop=lambda m: friction_drop(law, m)),
        Edge(1, 2, friction(0.0)),
        Edge(1, 2, friction(0.0)),
    ]
    return (
        np.array([4e5, NAN, NAN]),
        np.array([0.0, 0.0, flow]),
        edges,
        np.array([50.0, 20.0, 20.0]),
    )


def shut(leak: float):
    """Node behind shut links, a leak, and a node whose flow follows its own potential."""
    follows = Edge(2, 3, lambda m, drop, p: (1.0, 0.0, 1e-5 * p - m, 1e-5), sensed_nodes=(2,))
    edges = [
        Edge(0, 1, None, shut=True),
        Edge(1, 2, None, shut=True),
        Edge(0, 2, law_of(LEAK, leak)),
        follows,
    ]
    return np.array([3e5, NAN, NAN, 1e5]), np.zeros(4), edges, np.array([0.0, 0.0, 5.0, 5.0])


PIECES = [line(4e5), loop(11.0), line(3.3e5), shut(1e-5), line(1e5), loop(7.0), shut(3e-5)]


def together(pieces):
    """Problem of all pieces, whose nodes and edges are numbered alternately; also the nodes and edges of each piece."""
    nodes = [(k, i) for i in range(9) for k, piece in enumerate(pieces) if i < len(piece[0])]
    number = {node: n for n, node in enumerate(nodes)}
    links = [(k, e) for e in range(9) for k, piece in enumerate(pieces) if e < len(piece[2])]
    edges = [
        pieces[k][2][e].numbered({i: number[k, i] for i in range(len(pieces[k][0]))})
        for k, e in links
    ]
    held, demand = (np.array([pieces[k][which][i] for k, i in nodes]) for which in (0, 1))
    sizes = np.array([pieces[k][3][e] for k, e in links])
    found = solve_steady(held, demand, edges, (1e5, sizes))
    owns = [
        (
            [number[k, i] for i in range(len(piece[0]))],
            [n for n, link in enumerate(links) if link[0] == k],
        )
        for k, piece in enumerate(pieces)
    ]
    return found, owns


@pytest.mark.parametrize("order", [1, -1])
def test_each_piece_has_the_bits_of_its_own_problem(order):
    pieces = PIECES[::order]
    found, owns = together(pieces)
    for (held, demand, edges, sizes), (nodes, links) in zip(pieces, owns, strict=True):
        own = solve_steady(held, demand, edges, (1e5, sizes))
        assert own.converged and len(own.pieces) == 1
        assert np.array_equal(own.potential, found.potential[nodes]) and np.array_equal(
            own.flow, found.flow[links]
        )
    assert found.converged and found.split and len(found.pieces) == len(pieces)


def test_balances_hold_and_loops_have_the_least_norm():
    found, owns = together(PIECES)
    flows = [found.flow[links] for _, links in owns]
    assert flows[0][0] == pytest.approx(flows[0][1] + 3.0) and flows[1] == pytest.approx(
        [11.0, 5.5, 5.5]
    )
    drop = found.potential[owns[0][0][0]] - found.potential[owns[0][0][1]]
    assert drop == pytest.approx(300.0 * flows[0][0] * abs(flows[0][0]))


def test_a_piece_that_does_not_converge_leaves_the_others_as_they_are():
    bad = np.array([NAN, 1e5]), np.array([5.0, 0.0]), [Edge(0, 1, None, shut=True)], np.array([1.0])
    found, owns = together([line(4e5), bad, line(3.3e5)])
    assert found.no_solution == [owns[1][0][0]]
    broken = (
        np.array([2e5, NAN, 1e5]),
        np.zeros(3),
        [Edge(0, 1, lambda m, drop: (NAN, 1.0, 0.0)), Edge(1, 2, friction(3.0))],
    )
    found, owns = together([line(4e5), (*broken, np.ones(2)), line(3.3e5)])
    own = solve_steady(*line(4e5)[:3], (1e5, line(4e5)[3]))
    assert not found.converged and np.array_equal(found.flow[owns[0][1]], own.flow)
