"""Threads that step bands of one state together, all by the same compiled loop. Knows arrays; knows no physics.

Every member has arrays of its own, of the size of all, of which only what it looks at is ever touched. Python works on
those of the loop, which are the first member's; before members go on they take from there what Python may have changed,
and when they come back each brings its rows.
"""

from __future__ import annotations

import ctypes
import os
import signal
import threading
import time
from contextlib import contextmanager
from dataclasses import replace
from queue import SimpleQueue

import numpy as np

from fvsolve.kernels import joint
from fvsolve.kernels.functions import functions
from fvsolve.model import Slate
from fvsolve.model.slate import lined
from fvsolve.solve.bands import Cut
from fvsolve.solve.formed import formed
from fvsolve.steppers import slots
from fvsolve.steppers.signatures import JOIN, compiled_as
from fvsolve.steppers.stepper import Stepper

SMALL = ("memory", "orders", "flags", "ledger", "carry", "g", "g_new", "out", "out_row", "values", "supply")
WRITTEN = ("clock", "armed", "marks", "scratch", "spare", "envelope", "extremes", "past")


def yielding() -> int:
    """Address of the system's function that lets other threads run."""
    name = "SwitchToThread" if os.name == "nt" else "sched_yield"
    library = ctypes.windll.kernel32 if os.name == "nt" else ctypes.CDLL(None)
    return ctypes.cast(getattr(library, name), ctypes.c_void_p).value


class Member:
    """One band: its arrays, and the handle that opens them.

    team : a `Team` of threads or `Ranks`: board, room, yielding and tell are what `kernels.joint` is to know of it
    """

    def __init__(self, team, k: int, run_data: Slate, stepper: Stepper) -> None:
        cut, loop = team.cut, team.loop
        self.loop, self.number, self.slate, self.stepper = loop, k, run_data, stepper
        self.stepper.join, self.stepper.spans = team.join, cut.spans(k)
        self.stepper.sums = np.zeros(cut.sums)
        self.own = [slice(begin, stop) for begin, stop, *_ in self.stepper.spans[len(cut.alike()) :].tolist()]
        states, flows = cut.states(k), cut.flows(k)
        own = np.zeros(joint.HEAD + 3 * (len(states) + len(flows)), dtype=np.int64)
        own[joint.ME], own[joint.MANY], own[joint.YIELD], own[joint.TELL] = k, cut.many, team.yielding, team.tell
        own[joint.BOARD], own[joint.ROOM] = team.board.ctypes.data, team.room.ctypes.data
        own[joint.ALIKE], own[joint.STATES], own[joint.FLOWS] = len(cut.alike()), len(states), len(flows)
        own[joint.HEAD :] = np.concatenate([states, flows]).ravel()
        self.stepper.shape = formed(cut, k)
        self.mine = {"bands": cut.bands(k), "joint": own, "sums": self.stepper.shape}
        self.called = team.functions.calls, team.functions.hooks
        self.open()
        at, bounds = loop.stepper.within
        own_states = np.zeros(loop.model.y_size, dtype=bool)
        for begin, stop, *_ in self.stepper.spans.tolist():
            own_states[begin:stop] = True
        owned = own_states[at[::3]]
        self.within = np.ascontiguousarray(at.reshape(-1, 3)[owned]).ravel(), bounds[owned]

    def open(self) -> None:
        """What is written here, and the handle that opens it: anew where a past of delay lines has more room."""
        self.written = self.slate.written._replace(**self.mine)
        self.handle = self.slate.linked(self.written, self.called)

    def take(self, name: str, values: np.ndarray) -> None:
        """Take over one of `WRITTEN`."""
        if name == "past" and values.size != self.slate.past.size:
            self.slate.past = values.copy()
        getattr(self.slate.written, name)[...] = values

    def follow(self, states: list[slice]) -> None:
        """Take over what Python may have changed in the arrays of the loop, and these states."""
        if self.number == 0:
            return
        for name in SMALL:
            getattr(self.stepper, name)[...] = getattr(self.loop.stepper, name)
        for name in WRITTEN:
            self.take(name, getattr(self.loop.slate.written, name))
        self.stepper.times, self.stepper.largest = self.loop.stepper.times, self.loop.stepper.largest
        now = self.loop.flags[slots.NOW]
        for rows in states:
            self.stepper.y[now, rows] = self.loop.stepper.y[now, rows]

    def march(self, functions: tuple, where: int) -> int:
        """Go on until there is something to do, and bring what the loop has not."""
        stepper = self.stepper
        if self.slate.past is not self.written.past:
            self.open()
        within, stepper.within = stepper.within, self.within
        code = stepper.call(*functions, self.handle, where, self.slate.armed)
        stepper.within = within
        return code

    def bring(self, name: str, at) -> None:
        """Copy the rows of this band to the arrays of the loop."""
        if self.number > 0:
            source, target = getattr(self.stepper, name)[at], getattr(self.loop.stepper, name)[at]
            for rows in self.own:
                target[rows] = source[rows]


def twin(stepper: Stepper) -> Stepper:
    """Another of the same method, with arrays of its own but for what steps only read."""
    copy = Stepper(stepper.method, stepper.scale.size, stepper.supply.shape[1], stepper.structure, stepper.scale,
                    stepper.damped)  # fmt: skip
    copy.stored, copy.carry, copy.within = stepper.stored, stepper.carry.copy(), stepper.within
    for name in ("out", "out_row", "values", "g", "g_new", "rows"):
        setattr(copy, name, getattr(stepper, name).copy())
    return copy


def banded(cut: Cut) -> tuple:
    """Functions of a model whose bands tell each other, and by what they bring sums together."""
    features = replace(cut.model.functions.cast, bands=True, together=cut.together)
    return functions(features), compiled_as(joint.share, JOIN)


class Team:
    """All members of a loop, each but none of them in the thread that asks."""

    def __init__(self, loop, cut: Cut) -> None:
        self.loop, self.cut, self.yielding, self.tell, self.seconds = loop, cut, yielding(), 0, 0.0
        self.functions, self.join = banded(cut)
        self.board = lined(joint.LINE * cut.many)
        self.room = lined(2 * cut.sums)
        self.members = [Member(self, 0, loop.slate, loop.stepper)]
        self.members += [Member(self, k, Slate(loop.model), twin(loop.stepper)) for k in range(1, cut.many)]
        self.stale = True  # whether rows of the loop are not those of the members
        self.asked = [SimpleQueue() for _ in self.members]
        self.answers: SimpleQueue = SimpleQueue()
        tasks = zip(self.members, self.asked, strict=True)
        self.threads = [threading.Thread(target=self.serve, args=task, daemon=True, name="band") for task in tasks]
        for thread in self.threads:
            thread.start()

    def serve(self, member: Member, requests: SimpleQueue) -> None:
        """What a thread does: march when it is asked to."""
        while (task := requests.get()) is not None:
            start = time.thread_time()
            try:
                answer = member.march(*task)
                member.bring("y", member.stepper.flags[slots.NOW])
                if answer == slots.FIELD:
                    member.bring("y_out", ...)
            except BaseException as error:  # for whoever asked
                answer = error
            self.answers.put((answer, time.thread_time() - start))

    def call(self, functions: tuple, where: int) -> int:
        """March on with all members; returns one of the codes of `steppers.slots`."""
        for member in self.members:
            alike = [slice(*block) for block in self.cut.alike()]
            member.follow(alike + (member.own if self.stale else []))
        self.stale = False
        with undisturbed():
            for requests in self.asked:
                requests.put((functions, where))
            answers = [self.answers.get() for _ in self.members]
        self.seconds += sum(seconds for _, seconds in answers)
        for answer, _ in answers:
            if isinstance(answer, BaseException):
                raise answer
        return answers[0][0]

    def whole(self, at: int) -> None:
        """Bring row `at` of the states of all members to the loop."""
        for member in self.members:
            member.bring("y", at)

    def close(self) -> None:
        """Let the threads end."""
        for requests in self.asked:
            requests.put(None)
        for thread in self.threads:
            thread.join()


@contextmanager
def undisturbed():
    """Put off Ctrl-C until all members are back, who wait for each other."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    signals, before = [], signal.getsignal(signal.SIGINT)
    signal.signal(signal.SIGINT, lambda *arguments: signals.append(arguments))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if signals and callable(before):
        before(*signals[0])
