"""Requests of rank 0 to other ranks, and interrupts while threads or ranks wait for each other."""

import signal
import threading
from contextlib import contextmanager

RUN_LOOP, SEND_STATES, CLOSE = range(3)  # requests of rank 0: run the time loop, send states, end
CLOSE_MESSAGE = CLOSE, None


@contextmanager
def postponed_interrupts():
    """Postpone Ctrl-C until all workers have returned, because they wait for each other."""
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
