"""PPO that learns among BARN-like worlds on the kinematic plant, and drives BARN's own worlds in physics.

    python examples/train_ppo.py train policy.zip                       # about 15 minutes of one core
    python examples/train_ppo.py drive policy.zip BARN drives.csv       # 50 worlds x 10 seeds; continues where it ended
    python examples/train_ppo.py table drives.csv

BARN is the folder or archive of the challenge's worlds (docs/how-to/data.md). Needs the extra `gym` and stable-baselines3.
"""

import csv
import math
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecMonitor

from antdrive.gym import NavigationEnv
from antdrive.gym.sb3 import NavigationVecEnv
from antdrive.runs.barn_challenge import OFFICIAL, WORLDS, reference_times, unpacked
from antdrive.sim import measure
from antdrive.worlds import Task, import_barn

SEEDS, STEPS, ROBOTS = 10, 9_500_000, 64
SHARED = {"noise": 1.0, "reach": 4.0, "flat": True}
COLUMNS = ("world", "seed", "outcome", "certified", "score", "exact", "seconds", "contact", "clearance_m", "digest")
torch.set_num_threads(1)  # more are slower for networks of this size


class Shown(BaseCallback):
    """Show the success of the last thousand episodes."""

    def _on_step(self) -> bool:
        if self.n_calls % 4000 == 0:
            print(f"{time.process_time() / 60:.1f} min, {self.num_timesteps} steps: {self.arrived:.1%}", flush=True)
        return True

    @property
    def arrived(self) -> float:
        return float(np.mean(self.model.ep_success_buffer or [0.0]))


def train(policy: str) -> None:
    """Train a policy, and print the success that training reports."""
    robots = NavigationVecEnv(
        ROBOTS, "barn", worlds=1500, steps=400, reward={"progress": 0.5, "contact": -4.0}, **SHARED
    )
    robots.seed(0)
    model = PPO(
        "MlpPolicy", VecMonitor(robots), n_steps=64, batch_size=1024, n_epochs=6, gamma=0.99, ent_coef=1e-3,
        learning_rate=lambda left: 1e-4 + 9e-4 * left, policy_kwargs={"net_arch": [128, 128], "log_std_init": -0.7},
        stats_window_size=1000, seed=0, device="cpu",
    )  # fmt: skip
    model.learn(STEPS, callback=(shown := Shown()))
    model.save(policy)
    print(f"{shown.arrived:.1%} of the last 1,000 episodes arrived; {time.process_time() / 60:.1f} min of one core")


def drive(policy: str, barn: str, drives: str, plant: str = "bullet") -> None:
    """Drive the policy in each world with each seed, a line each in a table; lines that are there are kept."""
    model = PPO.load(policy, device="cpu")
    with tempfile.TemporaryDirectory() as temporary:
        folder = unpacked(Path(barn), Path(temporary))
        fastest, tasks = reference_times(folder), [import_barn(path) for path in sorted(folder.rglob(WORLDS))]
    env = NavigationEnv("barn50", source=barn, plant=plant, steps=1000, rollouts=True, **SHARED)
    path = Path(drives)
    path.touch()
    done = {(row["world"], row["seed"]) for row in csv.DictReader(path.read_text().splitlines())}
    with path.open("a", newline="") as file:
        lines = csv.DictWriter(file, COLUMNS)
        if not done:
            lines.writeheader()
        for task in tasks:
            for seed in range(SEEDS):
                if (task.world.name, str(seed)) not in done:
                    lines.writerow(driven(model, env, task, seed, fastest[task.world.name]))
                    file.flush()


def driven(model: PPO, env: NavigationEnv, task: Task, seed: int, fastest: float) -> dict[str, object]:
    """Drive one episode; return its line."""
    observation, info = env.reset(seed=seed, options={"world": task})
    over, clearance = False, info["clearance_m"]
    while not over:
        action, _ = model.predict(observation, deterministic=True)
        observation, _, terminated, truncated, info = env.step(action)
        over, clearance = terminated or truncated, min(clearance, info["clearance_m"])
    line = {"world": task.world.name, "seed": seed, "outcome": info["outcome"], "contact": info["collision"]}
    line |= {"clearance_m": round(clearance, 4), "digest": info["digest"]}
    if "rollout" in info:
        measured = measure(info["rollout"])
        succeeded, seconds = info["is_success"], measured["arrival_s"]
        line |= {"certified": info["certificate"].certified, "seconds": seconds, "exact": measured["barn"]}
        line |= {"score": OFFICIAL.score(succeeded, seconds, fastest), "clearance_m": measured["min_clearance_m"]}
    return line


def table(drives: str) -> None:
    """Print the drives' shares."""
    rows = list(csv.DictReader(Path(drives).read_text().splitlines()))
    arrived = [row for row in rows if row["outcome"] == "succeeded"]
    certified = [row for row in arrived if row["certified"] == "True"]
    print(f"{len(rows)} drives in {len({row['world'] for row in rows})} worlds")
    print(f"arrived {len(arrived) / len(rows):.1%}, certified at the goal {len(certified) / len(rows):.1%}")
    print(f"contact {sum(row['contact'] == 'True' for row in rows) / len(rows):.1%}")
    for key in ("score", "exact"):
        print(f"mean {key} {math.fsum(float(row[key] or 0) for row in rows) / len(rows):.4f}")


if __name__ == "__main__":
    COMMANDS = {"train": train, "drive": drive, "table": table}
    name, *arguments = sys.argv[1:]
    COMMANDS[name](*arguments)
