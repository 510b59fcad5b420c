"""Try hostile inputs: `python tests/try_hostile_inputs.py --seed 1 --count 10000` prints each that does harm.

Each input is loaded and built. Harm is an error other than FvsolveError, more than 5 s of CPU time, or more than 1 GB.
"""

import argparse
import random
import resource
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from reference import hostile_inputs  # noqa: E402

import fvsolve  # noqa: E402
from fvsolve.case.reading import Raw  # noqa: E402
from fvsolve.core.solve import initial_state  # noqa: E402
from fvsolve.errors import FvsolveError  # noqa: E402

SECONDS, MEMORY, MESSAGE = 5.0, 1e9, 20_000  # most CPU time [s], memory [B] and length of a message
MOST_CELLS = 20_000  # cells of a case that is built


def attempt(item: hostile_inputs.Input, folder: Path) -> str:
    """Outcome of an input: "refused", "built", "loaded" or the text of an internal error."""
    try:
        if item.text is None:
            case = fvsolve.load(Raw(item.table, "case", None, item.folder))
        else:
            path = folder / "case.toml"
            text = (
                item.text.encode("utf-8", "surrogatepass")
                if isinstance(item.text, str)
                else item.text
            )
            path.write_bytes(text)
            case = fvsolve.load(path)
        cells = sum(link.cells for link in case.links.values() if link.kind == "pipe")
        if cells + sum(len(mesh.cells) for mesh in case.meshes.values()) > MOST_CELLS:
            return "loaded"
        initial_state(fvsolve.build(case))
        return "built"
    except FvsolveError as error:
        text = str(error)
        return "refused" if len(text) < MESSAGE else f"message of {len(text)} characters"
    except Exception as error:
        frames = traceback.extract_tb(error.__traceback__)
        own = next((frame for frame in reversed(frames) if "fvsolve" in frame.filename), frames[-1])
        return f"{type(error).__name__}: {str(error)[:100]} ({Path(own.filename).name}, line {own.lineno})"


def harm(item: hostile_inputs.Input, folder: Path) -> tuple[str, str]:
    """Outcome of an input, and the harm that it does, "" for none."""
    before, began = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.process_time()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        outcome = attempt(item, folder)
    seconds = time.process_time() - began
    memory = 1024.0 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
    faults = [] if outcome in ("refused", "built", "loaded") else [outcome]
    faults += [f"{seconds:.1f} s"] * (seconds > SECONDS) + [f"{memory / 1e9:.2f} GB"] * (
        memory > MEMORY
    )
    faults += sorted(
        {
            f"{w.category.__name__}: {w.message} ({Path(w.filename).name}, line {w.lineno})"
            for w in caught
            if issubclass(w.category, RuntimeWarning)
        }
    )
    return outcome, "; ".join(faults)


def drawn(seed: int, count: int) -> list[hostile_inputs.Input]:
    """Inputs drawn by a seed: nine of ten are mutants of shipped cases, the others texts."""
    draw = random.Random(seed)
    return [
        *hostile_inputs.mutants(draw, count - count // 10),
        *hostile_inputs.texts(draw, count // 10),
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--only", default="", help="text in the names of the inputs")
    parser.add_argument(
        "--part",
        default="1/1",
        help="part of the inputs, for several processes, such as 1/2 and 2/2",
    )
    options = parser.parse_args()
    outcomes, harmful = Counter(), 0
    part, parts = map(int, options.part.split("/"))
    with tempfile.TemporaryDirectory() as folder:
        for item in drawn(options.seed, options.count)[part - 1 :: parts]:
            if options.only not in item.name:
                continue
            outcome, fault = harm(item, Path(folder))
            outcomes[outcome if not fault else "harmful"] += 1
            if fault:
                harmful += 1
                print(f"{item.name}: {fault}", flush=True)
    print(dict(outcomes))
    sys.exit(harmful > 0)


if __name__ == "__main__":
    main()
