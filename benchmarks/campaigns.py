"""Robustness and cost of campaigns: `python -m benchmarks.campaigns [PART ...] [--share S] [--drive]`, by default all parts.

- kill: 2,000 short runs with 20 `kill -9` at random moments: of workers, of the parent, of dask's workers and of its
  scheduler, five each. After resuming, the canonical table must equal that of an undisturbed campaign, byte for byte.
  kill-worker, kill-parent, kill-dask-worker and kill-dask-scheduler are separate parts.
- equality: 160 drives of two planners in four worlds, with and without noise. The table must be the same, byte for byte, from
  this process, from 1, 2 and 4 processes, from Dask, and in other orders.
- efficiency: T1 / (2 T2), without start-up, of runs that compute for 0.2 s on one and two processes, local and Dask; plain
  processes show the machine's limit.
- overhead: cost per run of engines, folder and expansion, with 100,000 empty runs.

`--share 0.05` takes a twentieth of the runs. `--drive` kills campaigns of real drives instead of sleeping runs. Results (of
`kill`: per victim) are cached in out/campaigns.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import json
import os
import random
import shutil
import signal
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from antdrive.runs.campaigns import canonical_bytes, expand, make_campaign, read_results
from antdrive.runs.campaigns.expanding import Expansion
from antdrive.runs.campaigns.job import Job
from antdrive.runs.campaigns.rows import failed_row
from antdrive.runs.campaigns.running import Finished
from antdrive.runs.campaigns.store import parts_in
from antdrive.runs.campaigns.sweeping import sweep
from benchmarks.markdown import chosen, command_line, table

SMALLEST = ("overhead --share 0.005",)
OUT = Path("out/campaigns").resolve()
SHORT = 0.02  # sleep of a run in a killed campaign [s]
LONG = 0.2  # computing time of a run in the efficiency part [s]
ROUNDS = 3  # rounds of each engine in the efficiency part
VICTIMS = ("worker", "parent", "dask worker", "dask scheduler")
PARTS = ("kill", *(f"kill-{v.replace(' ', '-')}" for v in VICTIMS), "equality", "efficiency", "overhead")


@dataclass(frozen=True)
class Sleeping:
    """A sleeping run; its result follows from its key."""

    seconds: float = 0.0

    def __call__(self, job: Job) -> Finished:
        if self.seconds:  # sleep(0) would yield the processor
            time.sleep(self.seconds)
        return Finished(failed_row(job.key, "succeeded", hashlib.sha256(job.key.encode()).hexdigest()))


@dataclass(frozen=True)
class Computing:
    """A computing run: a number of hash rounds."""

    rounds: int

    def __call__(self, job: Job) -> Finished:
        digest = job.key.encode()
        for _ in range(self.rounds):
            digest = hashlib.sha256(digest).digest()
        return Finished(failed_row(job.key, "succeeded", digest.hex()))


def campaign(runs: int) -> dict[str, Any]:
    """Return a campaign with a number of runs in four worlds."""
    return {"worlds": ["empty", "gate", "slalom", "u-trap"], "planners": ["astar"], "seeds": max(1, runs // 4)}


def go(folder: Path, runs: int, work: Any, **options: Any) -> float:
    """Run a campaign, or resume it. Return the time from its first result to its last [s]."""
    asked, times = make_campaign(campaign(runs)), list[float]()

    def note(done: int, size: int) -> None:
        times.append(time.perf_counter())

    sweep(asked, folder, work=work, progress=note, **options)
    return times[-1] - times[min(1, len(times) - 1)]


def kept(name: str, measure: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """Return a result cached in out/campaigns, or measure and cache it."""
    path = OUT / f"{name}.json"
    if not path.exists():
        found = measure()
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(found, indent=1) + "\n")
    return dict(json.loads(path.read_text()))


def started(*words: str) -> subprocess.Popen[bytes]:
    return subprocess.Popen([sys.executable, "-m", *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


class Cluster:
    """A scheduler and two workers in separate processes, which are killed and replaced."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.number = folder, 0
        self.scheduler, self.workers = self._start()

    def _start(self) -> tuple[subprocess.Popen[bytes], subprocess.Popen[bytes]]:
        self.number += 1
        file = self.folder / f"scheduler-{self.number}.json"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.unlink(missing_ok=True)
        here = ("--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--no-show", "--scheduler-file", str(file))
        scheduler = started("distributed.cli.dask_scheduler", *here)
        while not (file.exists() and file.stat().st_size):
            time.sleep(0.05)
        self.address = str(json.loads(file.read_text())["address"])
        threads = ("--nworkers", "2", "--nthreads", "1", "--no-dashboard", "--death-timeout", "5")
        return scheduler, started("distributed.cli.dask_worker", self.address, *threads)

    def kill_scheduler(self) -> None:
        self.scheduler.kill()
        self.stop()
        self.scheduler, self.workers = self._start()

    def kill_worker(self, rng: random.Random) -> bool:
        return kill_one(children(self.workers.pid, "multiprocessing.spawn"), rng)

    def stop(self) -> None:
        for process in (self.workers, self.scheduler):
            process.terminate()
            try:
                process.wait(15)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def children(process: int, word: str) -> list[int]:
    """Return the children of a process whose command line contains a word."""
    with contextlib.suppress(OSError):
        threads = Path(f"/proc/{process}/task").glob("*/children")  # children are listed per thread
        found = " ".join(path.read_text() for path in threads).split()
        return [int(pid) for pid in found if word in Path(f"/proc/{pid}/cmdline").read_text()]
    return []


def kill_one(processes: list[int], rng: random.Random) -> bool:
    if not processes:
        return False
    with contextlib.suppress(ProcessLookupError):
        os.kill(rng.choice(processes), signal.SIGKILL)
        return True
    return False


def kill(victim: str, kills: int, runs: int, drive: bool) -> dict[str, Any]:
    """Kill one kind of process repeatedly in a campaign, and resume the campaign until it is complete."""
    rng, folder = random.Random(VICTIMS.index(victim)), OUT / "folders" / f"{victim.replace(' ', '-')}-{runs}-{drive}"
    calm = OUT / "folders" / f"calm-{runs}-{drive}"
    shutil.rmtree(folder, ignore_errors=True)
    go(calm, runs, None if drive else Sleeping(), jobs=2)
    cluster = Cluster(OUT / "folders" / "cluster") if "dask" in victim else None
    left, resumed, begun = kills, 0, time.monotonic()
    try:
        while not (folder.exists() and (folder / "runs.parquet").exists() and read_results(folder).complete):
            address = [cluster.address] if cluster else []
            parent = started("benchmarks.campaigns", "_go", str(folder), str(runs), str(int(drive)), *address)
            resumed += 1
            before = len(parts_in(folder)) if folder.exists() else 0
            while parent.poll() is None:
                # Kills are spread over the campaign; each waits for results written after the last one.
                time.sleep(rng.uniform(0.2, 0.8) * runs * SHORT / 2 / (kills + 2))
                if not left or not folder.exists() or len(parts_in(folder)) <= before:
                    continue
                before, killed = len(parts_in(folder)), True
                if victim == "worker":
                    killed = kill_one(children(parent.pid, "popen_loky"), rng)
                elif victim == "parent":
                    parent.kill()
                elif cluster and victim == "dask worker":
                    killed = cluster.kill_worker(rng)
                elif cluster:
                    cluster.kill_scheduler()
                left -= killed
            parent.wait()
    finally:
        if cluster:
            cluster.stop()
    keys = read_results(folder).table["key"].to_pylist()
    return {
        "victim": victim,
        "kills": kills - left,
        "commands": resumed,
        "lost": read_results(folder).size - len(set(keys)),
        "double": len(keys) - len(set(keys)),
        "same": canonical_bytes(folder) == canonical_bytes(calm),
        "seconds": round(time.monotonic() - begun, 1),
    }


def efficiency(runs: int) -> dict[str, Any]:
    """Measure T1 / (2 T2) of runs that compute for 0.2 s: medians over rounds with all engines.

    *bare* is the same work in plain processes that share nothing: what the machine itself gives to two processes.
    """
    trial, started_at = Computing(100_000), time.perf_counter()
    (job,) = expand(make_campaign({"worlds": ["empty"], "planners": ["astar"]})).jobs
    trial(job)
    rounds = int(100_000 * LONG / (time.perf_counter() - started_at))
    engines: dict[str, dict[str, Any]] = {
        "local 1": {"jobs": 1}, "local 2": {"jobs": 2}, "dask 1": {"dask": "local:1"}, "dask 2": {"dask": "local:2"}
    }  # fmt: skip
    times: dict[str, list[float]] = {name: [] for name in ("bare 1", "bare 2", *engines)}
    part = max(1, runs // ROUNDS)
    for _ in range(ROUNDS):
        times["bare 1"].append(bare(1, part, rounds))
        times["bare 2"].append(bare(2, part, rounds))
        for name, options in engines.items():
            folder = OUT / "folders" / f"efficiency-{name.replace(' ', '-')}"
            shutil.rmtree(folder, ignore_errors=True)
            times[name].append(go(folder, part, Computing(rounds), **options))
    found = {name: statistics.median(each) for name, each in times.items()}
    ratios = {
        name: statistics.median(one / two / 2 for one, two in zip(times[f"{name} 1"], times[f"{name} 2"], strict=True))
        for name in ("bare", "local", "dask")
    }
    return {"rounds": ROUNDS, "runs": part, "run_s": found["bare 1"] / part, **found, **ratios}


def bare(processes: int, runs: int, rounds: int) -> float:
    """Measure plain processes that share the runs evenly, without start-up [s]."""
    command = [sys.executable, "-m", "benchmarks.campaigns", "_compute", str(runs // processes), str(rounds)]
    started = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(processes)]
    return max(float(one.communicate()[0]) for one in started)


def compute(runs: int, rounds: int) -> float:
    """Measure computing runs in this process [s]."""
    (job,) = expand(make_campaign({"worlds": ["empty"], "planners": ["astar"]})).jobs
    work, begun = Computing(rounds), time.perf_counter()
    for _ in range(runs):
        work(job)
    return time.perf_counter() - begun


def equality(runs: int) -> dict[str, Any]:
    """List the engines whose table equals that of this process, byte for byte."""
    asked = make_campaign(
        {
            "worlds": ["empty", "gate", "slalom", "u-trap"], "planners": ["astar", {"name": "aco-han", "ants": 10}],
            "noise": [0, 1], "seeds": max(1, runs // 16),
        }
    )  # fmt: skip
    calm, rng = expand(asked), random.Random(1)
    back = dataclasses.replace(calm, jobs=calm.jobs[::-1])
    mixed = dataclasses.replace(calm, jobs=tuple(rng.sample(calm.jobs, len(calm.jobs))))
    ways: dict[str, tuple[Expansion, dict[str, Any]]] = {
        "this process": (calm, {"jobs": 0}),
        **{f"{n} processes": (calm, {"jobs": n}) for n in (1, 2, 4)},
        **{f"dask, {n} processes": (calm, {"dask": f"local:{n}"}) for n in (1, 2)},
        "2 processes, backwards": (back, {"jobs": 2}),
        "2 processes, mixed": (mixed, {"jobs": 2}),
        "this process, mixed": (mixed, {"jobs": 0}),
    }
    hashes = {}
    for name, (expansion, options) in ways.items():
        folder = OUT / "folders" / f"equality-{name.replace(' ', '-').replace(',', '')}"
        shutil.rmtree(folder, ignore_errors=True)
        sweep(asked, folder, expansion=expansion, **options)
        hashes[name] = hashlib.sha256(canonical_bytes(folder)).hexdigest()
    equal = {name: one == hashes["this process"] for name, one in hashes.items()}
    return {"runs": len(calm.jobs), **equal, "equal": sum(equal.values()), "of": len(ways)}


def overhead(runs: int) -> dict[str, Any]:
    """Measure the cost of an empty run [ms]."""
    begun = time.perf_counter()
    expand(make_campaign(campaign(runs)))
    found: dict[str, Any] = {"runs": runs, "expand_ms": (time.perf_counter() - begun) / runs * 1e3}
    engines: dict[str, dict[str, Any]] = {"here": {"jobs": 0}, "local": {"jobs": 2}, "dask": {"dask": "local:2"}}
    for name, options in engines.items():
        folder = OUT / "folders" / f"overhead-{name}"
        shutil.rmtree(folder, ignore_errors=True)
        begun = time.perf_counter()
        found[f"{name}_ms"] = go(folder, runs, Sleeping(), **options) / runs * 1e3
        found[f"{name}_all_ms"] = (time.perf_counter() - begun) / runs * 1e3
        found["bytes"] = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file()) / runs
    begun = time.perf_counter()
    go(OUT / "folders" / "overhead-local", runs, Sleeping(), jobs=2)
    return found | {"resume_ms": (time.perf_counter() - begun) / runs * 1e3}


def print_parts(parts: list[str], share: float, drive: bool) -> Iterator[str]:
    """Yield the tables of the selected parts."""
    victims = [v for v in VICTIMS if "kill" in parts or f"kill-{v.replace(' ', '-')}" in parts]
    if victims:
        runs, kills = int(2000 * share), max(1, int(5 * share**0.5))
        rows = [
            kept(f"kill-{v.replace(' ', '-')}-{runs}-{drive}", lambda v=v: kill(v, kills, runs, drive))  # type: ignore[misc]
            for v in victims
        ]
        heads = "killed | kills | commands | lost | double | same table | s"
        yield "\n".join(table(heads, [tuple(map(str, row.values())) for row in rows]))
    measures = (("equality", equality, 160), ("efficiency", efficiency, 1000), ("overhead", overhead, 100_000))
    for name, measure, runs in measures:
        if name in parts:
            found = kept(f"{name}-{int(runs * share)}", lambda m=measure, n=int(runs * share): m(n))  # type: ignore[misc]
            yield "\n".join(table((name, "value"), [(key, f"{value:.4g}") for key, value in found.items()]))


def main() -> None:
    if sys.argv[1:2] == ["_compute"]:
        print(compute(int(sys.argv[2]), int(sys.argv[3])))
        return
    if sys.argv[1:2] == ["_go"]:
        folder, runs, drive, *dask = sys.argv[2:]
        work = None if drive == "1" else Sleeping(SHORT)
        go(Path(folder), int(runs), work, jobs=2, dask=dask[0] if dask else None)
        return
    given = command_line(
        __doc__,
        parts=([], ", ".join(PARTS)),
        share=(1.0, "how many of the runs"),
        drive=(False, "kill campaigns of real drives"),
    )
    parts = chosen(given.parts, PARTS) if given.parts else ["kill", "equality", "efficiency", "overhead"]
    for text in print_parts(parts, given.share, given.drive):
        print(text, flush=True)


if __name__ == "__main__":
    main()
