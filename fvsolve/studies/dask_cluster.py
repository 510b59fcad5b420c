"""Workers of a Dask scheduler that compute chunks of tasks."""

import pickle
import threading
import uuid
from concurrent.futures import Future
from typing import Any

from fvsolve.errors import FvsolveError, RunError, listing
from fvsolve.output.restart import program_versions
from fvsolve.run.process_pool import compute

TIMEOUT = 10.0  # timeout for a scheduler, and for its first worker [s]
CHUNKS_PER_THREAD = 2  # chunks per thread: one in work, one that waits on the worker
MATCHING_PACKAGES = ("python", "distributed", "msgpack", "cloudpickle", "numpy")  # versions must be equal on both sides


class Cluster:
    """Workers of the Dask scheduler at an address such as "tcp://10.0.0.1:8786".

    work : callable that computes a task. Workers must have the same versions of fvsolve and its packages as this
    process. Raises FvsolveError as `connect` and `check_versions` do.
    """

    def __init__(self, work: Any, address: str) -> None:
        self.work, self.name, self.address = pickle.dumps(work), uuid.uuid4().hex, address
        self.client = connect(address)
        try:
            check_versions(self.client, address)
        except BaseException:
            self.client.close()
            raise
        self.capacity = CHUNKS_PER_THREAD * sum(self.client.nthreads().values())
        self.executor = self.client.get_executor(pure=False)

    @property
    def lost(self) -> type[Exception]:
        """Exception of a future whose worker was killed."""
        from distributed import KilledWorker

        return KilledWorker

    def submit(self, tasks: list) -> Future:
        """Compute a list of tasks on a worker : future of the result of `compute`."""
        return self.executor.submit(run_on_worker, self.name, self.work, tasks)

    def check(self) -> None:
        """Raise RunError if the scheduler is lost."""
        if self.client.status != "running":
            text = "Finished runs are kept; the same command resumes from there"
            raise RunError(f"lost the Dask scheduler at {self.address}. {text}")

    def close(self) -> None:
        """Cancel unfinished chunks and close the connection."""
        if self.client.status == "running":
            self.executor.shutdown(wait=False)
        self.client.close()


WORKER_CACHE = threading.local()  # for each thread: name of the last work, and the work with the data that it has read


def run_on_worker(name: str, work: bytes, tasks: list) -> tuple[Any, float]:
    """Compute a chunk of tasks on a worker; returns the result of `compute`.

    work : pickled callable; name : its identity, by which a worker reuses the unpickled callable for later chunks
    """
    if getattr(WORKER_CACHE, "name", None) != name:
        WORKER_CACHE.name, WORKER_CACHE.work = name, pickle.loads(work)
    return compute(WORKER_CACHE.work, tasks)


def connect(address: str) -> Any:
    """Connect to the scheduler at an address; returns the Dask client.

    Raises FvsolveError if no scheduler answers or the package `distributed` is missing.
    """
    try:
        from distributed import Client
    except ImportError:
        raise FvsolveError("--dask needs the package distributed: pip install fvsolve[dask]") from None
    try:
        client = Client(address, timeout=TIMEOUT, set_as_default=False)
    except Exception as error:  # Dask raises many types of exceptions
        text = str(error).split("\n")[0] or type(error).__name__
        raise FvsolveError(f'no Dask scheduler answers at "{address}": {text}. Expected an address such as '
                           "tcp://10.0.0.1:8786; the command `dask scheduler` prints it") from None  # fmt: skip
    return client


def check_versions(client: Any, address: str) -> None:
    """Wait for the first worker, then compare versions on the scheduler and all workers with those of this process.

    Raises FvsolveError if no worker comes, or if versions differ; the message lists the differences. Versions of
    programs (see `program_differences`) are compared only if those of `MATCHING_PACKAGES` are equal everywhere.
    """
    try:
        client.wait_for_workers(1, timeout=TIMEOUT)
    except TimeoutError:
        text = f"the Dask scheduler at {address} has no workers. Start workers: dask worker {address}"
        raise FvsolveError(text) from None
    reported = client.get_versions(check=False)
    ends = {"the scheduler": reported["scheduler"]}
    ends |= {f"worker {name}": text for name, text in reported["workers"].items()}
    here = version_numbers(reported["client"])
    faults = [
        f"{end} has {item}" for end, text in ends.items() for item in differing_versions(here, version_numbers(text))
    ]
    faults = faults or [
        f"worker {name} has {item}"
        for name, text in client.run(program_versions, on_error="return").items()
        for item in program_differences(text)
    ]
    if faults:
        raise FvsolveError(f"the Dask cluster at {address} has other versions, so its results could differ: "
                           f"{listing(faults)}. Install the same versions there and here")  # fmt: skip


def program_differences(reported: Any) -> list[str]:
    """Texts on programs whose version on a worker differs from that in this process; the processor may differ.

    reported : program -> version on the worker, or the exception of the worker if fvsolve is missing there
    """
    if not isinstance(reported, dict):
        return [f"no fvsolve ({reported})"]
    own = {name: version for name, version in program_versions().items() if name != "target"}
    return differing_versions(own, reported)


def version_numbers(reported: dict) -> dict[str, str]:
    """Versions of `MATCHING_PACKAGES` from the report of a Dask process : package -> version; Python as major.minor."""
    host, packages = reported.get("host", {}), reported.get("packages", {})
    numbers = {name: str(packages.get(name)) for name in MATCHING_PACKAGES[1:]}
    return {"python": ".".join(str(host.get("python", packages.get("python"))).split(".")[:2]), **numbers}


def differing_versions(here: dict[str, str], there: dict[str, str]) -> list[str]:
    """Texts on packages whose version there differs from that here, such as "numpy 2.1 (here 2.2)".

    here, there : package -> version
    """
    texts = {name: f"{name} {there.get(name)} (here {version})" for name, version in here.items()}
    return [text for name, text in texts.items() if there.get(name) != here[name]]
