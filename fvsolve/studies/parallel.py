"""Parallel computation of tasks in chunks of about a second: in this process, in other processes or by Dask workers.

The result of a task must not depend on the process, the order or the other tasks of its chunk.
"""

import gc
import pickle
import threading
import uuid
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from dataclasses import replace
from typing import Any, ClassVar, NamedTuple, Self

from fvsolve.case import Case, load
from fvsolve.case.load import find_source
from fvsolve.case.reading import Raw, read_raw
from fvsolve.core.output.restart import program_versions
from fvsolve.core.run.process_pool import ProcessPool, compute, results_of
from fvsolve.core.steppers.tableau import BUILT_IN, METHODS
from fvsolve.errors import FvsolveError, RunError, listing
from fvsolve.studies.outcome import Outcome, study_model

CHUNK_TIME = 1.0  # intended time of a chunk [s]
MAX_GROWTH = 8  # greatest ratio of sizes of successive chunks
# timeout for a scheduler, and for its first worker; interval of checks that workers can be reached [s]
TIMEOUT = 10.0
CHUNKS_PER_THREAD = 2  # chunks per thread: one in work, one that waits on the worker
# versions must be equal on both sides
MATCHING_PACKAGES = ("python", "distributed", "msgpack", "cloudpickle", "numpy")
MAX_CRASHES = 2  # number of processes that a task may crash before it counts as lost


class Work:
    """Base class of callables that compute a task. They are sent to processes once or with each chunk, by pickle.

    unsent : names of fields, dicts of data that each process computes again
    """

    unsent: ClassVar[tuple[str, ...]] = ()

    def process_text(self, task: Any) -> str:
        """Words that follow "the process" in the message on a task that crashed it."""
        return f"of task {task}"

    def lost_result(self, task: Any) -> Any:
        """Answer for a task that crashed its process repeatedly and so has no result; here raises RunError."""
        raise RunError(
            f"the process {self.process_text(task)} was killed repeatedly. Is there enough memory?"
        )

    def __getstate__(self) -> dict[str, Any]:
        return vars(self) | {name: {} for name in self.unsent}


class TaskPool:
    """Pool for tasks of one kind. The first task is computed in this process, which compiles the functions for all.

    jobs : number of local processes; dask : address of a scheduler, used instead of local processes.
    Context manager: workers are closed on exit. Raises FvsolveError for `jobs` below 1.
    """

    def __init__(self, work: Work, jobs: int = 1, dask: str | None = None) -> None:
        if jobs < 1:
            raise FvsolveError(f"jobs = {jobs} is out of range; expected 1 or more")
        self.work, self.jobs, self.dask = work, jobs, dask
        self.in_process, self.has_started = dask is None and jobs == 1, False
        self.workers: Any = None

    def run(self, tasks: Sequence) -> Iterator[tuple[int, Any]]:
        """Compute tasks; yields (index, answer) of each task when it is finished."""
        local = len(tasks) if self.in_process else min(len(tasks), int(not self.has_started))
        self.has_started |= local > 0
        yield from enumerate(results_of(self.work, tasks[:local]))
        if local < len(tasks):
            if self.workers is None:
                local_pool = self.dask is None
                self.workers = (
                    ProcessPool(self.work, self.jobs)
                    if local_pool
                    else Cluster(self.work, self.dask)
                )
            yield from distribute(self.work, tasks, self.workers, local)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: Any) -> None:
        if self.workers is not None:
            self.workers.close()


def distribute(work: Work, tasks: Sequence, workers: Any, first: int) -> Iterator[tuple[int, Any]]:
    """Distribute the tasks from index `first` on to workers; yields (index, answer) of each finished task.

    If a process crashes, its chunk is divided into two halves and repeated, so that only tasks that crash are lost (see
    `Work.lost_result`).
    workers : `ProcessPool` or `Cluster`. It has a `capacity`, the greatest number of chunks in work; submit(tasks) ->
    future of (answers, or the exception of a task; computing time [s]); the type `lost` of the exception of a future
    whose process crashed; and check(cancelled), which raises RunError if the workers cannot be reached
    """
    waiting, retry = deque(range(first, len(tasks))), deque()
    in_work: dict[Future, list[int]] = {}
    crashes: dict[int, int] = {}
    size = 1  # start with single tasks: computing times of tasks may differ by orders of magnitude
    while waiting or retry or in_work:
        while (waiting or retry) and len(in_work) < workers.capacity:
            # limits chunks near the end, so that no worker is idle
            fair_share = -(-len(waiting) // workers.capacity)
            numbers_given = (
                retry.popleft()
                if retry
                else [waiting.popleft() for _ in range(min(size, fair_share))]
            )
            in_work[workers.submit([tasks[k] for k in numbers_given])] = numbers_given
        done = wait(in_work, TIMEOUT, FIRST_COMPLETED).done
        if not done:
            workers.check()
            continue
        future = done.pop()
        numbers = in_work.pop(future)
        try:
            answers, seconds = future.result()
        except CancelledError:
            workers.check(cancelled=True)
            raise
        except workers.lost:
            if len(numbers) > 1:
                retry += [numbers[: len(numbers) // 2], numbers[len(numbers) // 2 :]]
            elif crashes.setdefault(numbers[0], 1) < MAX_CRASHES:
                crashes[numbers[0]] += 1
                retry.append(numbers)
            else:
                yield numbers[0], work.lost_result(tasks[numbers[0]])
            continue
        if isinstance(answers, BaseException):
            raise answers
        size = next_chunk_size(len(numbers), seconds, size)
        yield from zip(numbers, answers, strict=True)


def next_chunk_size(done: int, seconds: float, size: int) -> int:
    """Number of tasks of the next chunk, so that it takes about `CHUNK_TIME`, at most `MAX_GROWTH` times `size`.

    done : number of tasks of a finished chunk; seconds : its computing time [s]; size : present number of tasks of a
    chunk
    """
    return max(1, min(MAX_GROWTH * size, int(done * CHUNK_TIME / max(seconds, 1e-6))))


class RunRequest(NamedTuple):
    """Request for a run with changed keys.

    function : function(case, keys) at module level that makes the run; returns an `Outcome`, or a collection with one
    keys : dotted key -> value; stages : overrides that are applied first, in order, to the case of the study
    """

    function: Callable[[Case, Mapping[str, Any]], Any]
    keys: dict[str, Any]
    stages: tuple[dict[str, Any], ...] = ()


class RunQueue(TaskPool):
    """Runs of a study. A result computed ahead is returned once; other runs are computed when requested.

    source : case of the study, as for `load`; jobs, dask : as for `TaskPool`
    """

    def __init__(self, source: Any, jobs: int = 1, dask: str | None = None) -> None:
        super().__init__(RequestRunner(source), jobs, dask)
        self.results: dict[str, Any] = {}

    def run_ahead(self, requests: Sequence[RunRequest]) -> Iterator[int]:
        """Compute runs before their results are requested; yields the index of each finished run.

        requests : runs from cheap to expensive. The cheapest is computed first, because the study needs it first,
        then the others from the most expensive on, so that processes end together. A single process computes
        nothing ahead.
        """
        if self.in_process or not requests:
            return
        order = [0, *range(len(requests) - 1, 0, -1)]
        for position, answer in self.run([requests[k] for k in order]):
            self.results[repr(requests[order[position]])] = answer
            yield order[position]

    def __call__(self, case: Case, request: RunRequest) -> Any:
        """Result of a run, computed now unless it was computed ahead; case : the case after `request.stages`."""
        answer = self.results.pop(repr(request), None)
        if answer is None:
            return request.function(case, request.keys)
        if isinstance(answer, Outcome) and not answer.refused and answer.model is None:
            return replace(answer, model=study_model(case, request.keys))
        return answer


class RequestRunner(Work):
    """Callable that makes the run of a `RunRequest`, in this or another process.

    The case after each sequence of stages (see `RunRequest`) is stored and used again for later runs.
    """

    unsent = ("staged",)

    def __init__(self, source: Any) -> None:
        self.sent = PickledCase(source)
        self.staged: dict[str, Case] = {}

    def __call__(self, request: RunRequest) -> Any:
        name = repr(request.stages)
        if name not in self.staged:
            first_stage, *later = request.stages or ({},)
            case = load(self.sent.source, first_stage)
            for stage in later:
                case = load(case, stage)
            self.staged[name] = case
        return request.function(self.staged[name], request.keys)

    def process_text(self, request: RunRequest) -> str:
        keys = (
            ", ".join(f"{key} = {value}" for key, value in request.keys.items())
            or "the keys of the case"
        )
        return f"that made the run with {keys}"


class PickledCase:
    """Case that can be pickled. A `Case` is pickled as the values of its file, because it may contain functions.

    User-defined methods are pickled too. source : argument of `load`, such as a path, a dict or a `Case`
    """

    def __init__(self, source: Any) -> None:
        self.source = source

    def __getstate__(self) -> dict[str, Any]:
        raw = self.source
        if isinstance(raw, Case):
            raw = Raw(raw.raw, raw.name, raw.path, raw.folder)
        source = raw if isinstance(raw, Raw) else read_raw(find_source(raw))
        return {
            "source": source,
            "methods": {name: method for name, method in METHODS.items() if name not in BUILT_IN},
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        METHODS.update(state["methods"])
        self.source = state["source"]


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

    def check(self, cancelled: bool = False) -> None:
        """Raise RunError if the scheduler is lost; cancelled : True if it has cancelled a chunk, which shows this."""
        if cancelled or self.client.status != "running":
            text = "Finished runs are kept; the same command resumes from there"
            raise RunError(f"lost the Dask scheduler at {self.address}. {text}")

    def close(self) -> None:
        """Cancel unfinished chunks and close the connection."""
        if self.client.status == "running":
            self.executor.shutdown(wait=False)
        self.client.close()


# for each thread: name of the last work, and the work with the data that it has read
WORKER_CACHE = threading.local()


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
        raise FvsolveError(
            "--dask needs the package distributed: pip install fvsolve[dask]"
        ) from None
    client, text = None, ""
    try:
        client = Client(address, timeout=TIMEOUT, set_as_default=False)
    except Exception as error:  # Dask raises many types of exceptions
        text = str(error).split("\n")[0] or type(error).__name__
    if client is None:
        # closes the failed client now: while another client starts, Dask would wait for ever
        gc.collect()
        raise FvsolveError(
            f'no Dask scheduler answers at "{address}": {text}; expected an address such as '
            "tcp://10.0.0.1:8786; the command `dask scheduler` prints it"
        )
    return client


def check_versions(client: Any, address: str) -> None:
    """Wait for the first worker, then compare versions on the scheduler and all workers with those of this process.

    Raises FvsolveError if no worker comes, or if versions differ; the message lists the differences. Versions of
    programs (see `program_differences`) are compared only if those of `MATCHING_PACKAGES` are equal everywhere.
    """
    try:
        client.wait_for_workers(1, timeout=TIMEOUT)
    except TimeoutError:
        text = (
            f"the Dask scheduler at {address} has no workers; start workers: dask worker {address}"
        )
        raise FvsolveError(text) from None
    reported = client.get_versions(check=False)
    ends = {"the scheduler": reported["scheduler"]}
    ends |= {f"worker {name}": text for name, text in reported["workers"].items()}
    here = version_numbers(reported["client"])
    faults = [
        f"{end} has {item}"
        for end, text in ends.items()
        for item in differing_versions(here, version_numbers(text))
    ]
    if not faults:
        programs = client.run(program_versions, on_error="return")
        faults = [
            f"worker {name} has {item}"
            for name, text in programs.items()
            for item in program_differences(text)
        ]
    if faults:
        raise FvsolveError(
            f"the Dask cluster at {address} has other versions, so its results could differ: "
            f"{listing(faults)}; install the same versions there and here"
        )


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
    return {
        "python": ".".join(str(host.get("python", packages.get("python"))).split(".")[:2]),
        **numbers,
    }


def differing_versions(here: dict[str, str], there: dict[str, str]) -> list[str]:
    """Texts on versions that differ, such as "numpy 2.1 (here 2.2)"; here, there : package -> version."""
    texts = {name: f"{name} {there.get(name)} (here {version})" for name, version in here.items()}
    return [text for name, text in texts.items() if there.get(name) != here[name]]
