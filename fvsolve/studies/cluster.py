"""Workers of a Dask scheduler that do chunks of work. Knows Dask; knows no work."""

from __future__ import annotations

import pickle
import queue
import threading
import uuid
from typing import Any

from fvsolve.errors import FvsolveError, RunError, listing
from fvsolve.output.restart import programs
from fvsolve.run.crew import done

PATIENCE = 10.0  # s for a scheduler, and for a first worker
AHEAD = 2  # chunks of each thread: one that is done, one that waits there
SAME = ("python", "distributed", "msgpack", "cloudpickle", "numpy")  # what both ends must agree in


class Cluster:
    """The workers of the scheduler at an address such as "tcp://10.0.0.1:8786"; their program is this one."""

    def __init__(self, work: Any, address: str) -> None:
        self.work, self.name, self.address = pickle.dumps(work), uuid.uuid4().hex, address
        self.client = connected(address)
        try:
            agree(self.client, address)
        except BaseException:
            self.client.close()
            raise
        self.room = AHEAD * sum(self.client.nthreads().values())
        self.given: dict[Any, int] = {}  # future -> chunk
        self.ended: queue.SimpleQueue = queue.SimpleQueue()

    def give(self, chunk: int, tasks: list) -> None:
        """Send a chunk."""
        future = self.client.submit(done_there, self.name, self.work, tasks, pure=False)
        self.given[future] = chunk
        future.add_done_callback(self.ended.put)

    def take(self) -> tuple[int, list | None, float]:
        """The next chunk that is done; what a worker raised is raised here."""
        future = self._next()
        chunk, status = self.given.pop(future), future.status
        if status == "finished":
            answers, seconds = future.result()
            if isinstance(answers, BaseException):
                raise answers
            return chunk, answers, seconds
        if status == "error" and type(future.exception()).__name__ == "KilledWorker":
            return chunk, None, 0.0
        if status == "error":
            raise future.exception()
        raise RunError(self._gone())

    def _next(self) -> Any:
        while True:
            try:
                return self.ended.get(timeout=PATIENCE)
            except queue.Empty:
                if self.client.status != "running":
                    raise RunError(self._gone()) from None

    def _gone(self) -> str:
        return f"the Dask scheduler at {self.address} has gone; what is finished is kept, and the same command goes on"

    def close(self) -> None:
        """Take back what is not done, and leave."""
        self.client.cancel([*self.given], force=True) if self.client.status == "running" else None
        self.client.close()


KNOWN = threading.local()  # of a worker's thread: the work that it did last and its name, with what that has read


def done_there(name: str, work: bytes, tasks: list) -> tuple[Any, float]:
    """`done` on a worker."""
    if getattr(KNOWN, "name", None) != name:
        KNOWN.name, KNOWN.work = name, pickle.loads(work)
    return done(KNOWN.work, tasks)


def connected(address: str) -> Any:
    """A client of the scheduler at an address; FvsolveError where there is none, or no package."""
    try:
        from distributed import Client
    except ImportError:
        raise FvsolveError("--dask needs the package distributed: pip install fvsolve[dask]") from None
    try:
        client = Client(address, timeout=PATIENCE, set_as_default=False)
    except Exception as error:  # Dask has many, of its own and of the system's
        said = str(error).split("\n")[0] or type(error).__name__
        raise FvsolveError(f'no Dask scheduler answers at "{address}": {said}; wanted one such as '
                           "tcp://10.0.0.1:8786, which dask scheduler prints") from None  # fmt: skip
    return client


def agree(client: Any, address: str) -> None:
    """FvsolveError with all in which scheduler and workers are not as this process is; one worker at least is there."""
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except TimeoutError:
        said = f"the Dask scheduler at {address} has no workers; start some: dask worker {address}"
        raise FvsolveError(said) from None
    found = client.get_versions(check=False)
    ends = {"the scheduler": found["scheduler"]}
    ends |= {f"worker {name}": said for name, said in found["workers"].items()}
    here = versions(found["client"])
    faults = [f"{who} has {one}" for who, said in ends.items() for one in other(here, versions(said))]
    faults = faults or [f"worker {name} has {one}" for name, said in client.run(programs, on_error="return").items()
                        for one in strange(said)]  # fmt: skip
    if faults:
        raise FvsolveError(f"the Dask cluster at {address} is of another version, and its rows would not be the same: "
                           f"{listing(faults)}; install the same there and here")  # fmt: skip


def strange(said: Any) -> list[str]:
    """What a worker computes with other than this process, in words; what it raised where it has none of it."""
    if not isinstance(said, dict):
        return [f"no fvsolve ({said})"]
    own = {name: one for name, one in programs().items() if name != "target"}  # workers may be of other kinds
    return other(own, said)


def versions(said: dict) -> dict[str, str]:
    """Versions of what both ends must agree in, as Dask tells them; of Python without the last number."""
    host, packages = said.get("host", {}), said.get("packages", {})
    found = {name: str(packages.get(name)) for name in SAME[1:]}
    return {"python": ".".join(str(host.get("python", packages.get("python"))).split(".")[:2]), **found}


def other(here: dict[str, str], there: dict[str, str]) -> list[str]:
    """What there is other than here, in words."""
    return [f"{name} {there.get(name)} (here {own})" for name, own in here.items() if there.get(name) != own]
