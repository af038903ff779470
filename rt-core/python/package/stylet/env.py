"""An environment for reinforcement learning: steer a needle onto a target and drop a seed there (Gymnasium).

>>> import gymnasium, stylet.env
>>> env = gymnasium.make("Stylet/Needle-v0")
>>> observation, info = env.reset(seed=1)
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

import stylet

PITCH_MM = 5.0
"""Distance between neighbouring holes of the template."""
SEED_MM = 4.5
"""Length of a seed, whose deeper end lies at the tip."""
LEAST_TISSUE_MM = 20.0
"""A hole is used if its axis meets so much of the target."""
BEFORE_BODY_MM = 2.0
"""Distance of the entry from the body."""
BESIDE_MM = 1.5
"""Largest distance of a target from the axis of its hole."""
MOST_DEPTH_MM = 145.0
PHASES = ("outside", "membrane contraction", "penetration", "retraction", "hold")
STEEL_18_G = {"needle.bending_stiffness": 0.016}
LIMITS = np.array([150, 150, 150, 150, 1, 1, 20, 20, 20, 1, 1, 1, 1], dtype=np.float32)


class NeedleEnv(gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]):
    """One needle with a bevel through a hole of the template, one seed onto a target in the gland.

    Each episode draws a hole, and a target up to 1.5 mm beside its axis. It ends when the seed is dropped, or after
    `most_steps`.

    **Action**, shape (3,), each -1 to 1: speed along the needle (times `speed_mm_per_s`), turn of the needle about
    itself (times `turn_deg_per_s`), which steers it by its bevel, and drop the seed (above 0).

    **Observation**, shape (13,), ``float32``: the seed in the needle from the target, x y z [mm]; depth of the tip from
    the entry [mm]; cosine and sine of the roll; force on the hand, x y z [N]; phase (0 outside, 0.25 membrane
    contraction, 0.5 penetration, 0.75 retraction, 1 hold); whether the membrane has given way; time used, 0 to 1;
    whether the seed is out.

    **Reward**: minus the distance [mm] from the target at which the seed comes to rest, when it is dropped; minus
    `damage_per_j` for each joule that the hand puts into the tissue; minus `step_cost` a step; minus 20 for a seed that
    is never dropped. A drop outside the tissue costs 1.

    :param scene: name of a built-in scene, or a :class:`stylet.Scene`; needles go along +z.
    :param tissue: a name of :func:`stylet.tissues`.
    :param parameters: as of :class:`stylet.Insertion`; a needle of 18 G steel by default.
    :param vary: parameters that each episode draws anew, ``{key: (least, most)}``.
    :param step_s: time of one step.
    """

    metadata = {"render_modes": []}

    def __init__(
        self,
        scene: str | stylet.Scene = "paper",
        *,
        tissue: str = "chainmail",
        parameters: Mapping[str, float] = STEEL_18_G,
        vary: Mapping[str, tuple[float, float]] | None = None,
        speed_mm_per_s: float = 50.0,
        turn_deg_per_s: float = 360.0,
        step_s: float = 0.02,
        most_steps: int = 300,
        damage_per_j: float = 10.0,
        step_cost: float = 0.01,
    ) -> None:
        self.scene = stylet.Scene(scene) if isinstance(scene, str) else scene
        self.action_space = spaces.Box(-1.0, 1.0, (3,), np.float32)
        self.observation_space = spaces.Box(-LIMITS, LIMITS, dtype=np.float32)
        self.tissue, self.parameters, self.vary = tissue, dict(parameters), dict(vary or {})
        self.speed_mm_per_s, self.turn_deg_per_s = speed_mm_per_s, turn_deg_per_s
        self.step_s, self.most_steps = step_s, most_steps
        self.damage_per_j, self.step_cost = damage_per_j, step_cost
        labels, self.edge_mm = self.scene.labels, self.scene.spacing_mm
        self.body_from_mm = float(np.flatnonzero(labels.any(axis=(0, 1)))[0] * self.edge_mm)
        self.holes = self._holes(np.isin(labels, [s.label for s in self.scene.structures if s.role == "target"]))
        self.needle: stylet.Insertion | None = None

    def _holes(self, target: NDArray[np.bool_]) -> list[tuple[float, float, float, float]]:
        """Returns x, y and where the target begins and ends on the axis of each hole, mm."""
        low, high = self.scene.target_bounds_mm
        middle = [(low[a] + high[a]) / 2 for a in (0, 1)]
        reach = [int((high[a] - low[a]) / 2 / PITCH_MM) for a in (0, 1)]
        holes = []
        for column in range(-reach[0], reach[0] + 1):
            for row in range(-reach[1], reach[1] + 1):
                x, y = middle[0] + PITCH_MM * column, middle[1] + PITCH_MM * row
                inside = np.flatnonzero(target[int(x / self.edge_mm), int(y / self.edge_mm)])
                if len(inside) * self.edge_mm >= LEAST_TISSUE_MM:
                    holes.append((x, y, float(inside[0] * self.edge_mm), float((inside[-1] + 1) * self.edge_mm)))
        if not holes:
            raise ValueError(f"no hole of the template meets {LEAST_TISSUE_MM} mm of a target")
        return holes

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begins an episode. Everything that it draws follows from `seed`."""
        super().reset(seed=seed)
        x, y, begin, end = self.holes[self.np_random.integers(len(self.holes))]
        angle, beside = self.np_random.uniform(0.0, 2.0 * np.pi), BESIDE_MM * np.sqrt(self.np_random.uniform())
        depth = self.np_random.uniform(begin + 2.0 * SEED_MM, end - SEED_MM)
        self.target_mm = np.array([x + beside * np.cos(angle), y + beside * np.sin(angle), depth])
        self.entry_mm = np.array([x, y, self.body_from_mm - BEFORE_BODY_MM])
        drawn = {key: float(self.np_random.uniform(*ends)) for key, ends in self.vary.items()}
        entry, parameters = tuple(self.entry_mm), {**self.parameters, **drawn}
        if self.needle is None:
            self.needle = stylet.Insertion(
                self.scene, entry, tissue=self.tissue, parameters=parameters, linear=True
            )
        else:
            self.needle.reset(entry, parameters=parameters)
        self.state = self.needle.state
        self.depth_mm, self.roll_deg, self.steps, self.work_j = 0.0, 0.0, 0, 0.0
        return self._observation(), {"target_mm": self.target_mm, "entry_mm": self.entry_mm}

    def step(self, action: NDArray[np.float32]) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Moves for `step_s`, then drops the seed if the action says so."""
        if self.needle is None:
            raise RuntimeError("reset the environment first")
        along, turn, drop = np.clip(np.asarray(action, dtype=float), -1.0, 1.0)
        before_mm, before_n = self.depth_mm, self.state.resistance_n
        self.depth_mm = float(np.clip(before_mm + along * self.speed_mm_per_s * self.step_s, 0.0, MOST_DEPTH_MM))
        self.roll_deg += float(turn * self.turn_deg_per_s * self.step_s)
        self.state = self.needle.step(self.depth_mm, self.step_s, roll_deg=self.roll_deg)
        self.steps += 1
        # Mean force times way; N mm are mJ.
        work_j = 1e-3 * max(0.0, (self.depth_mm - before_mm) * (before_n + self.state.resistance_n) / 2.0)
        self.work_j += work_j
        reward = -self.step_cost - self.damage_per_j * work_j
        info: dict[str, Any] = {"work_j": self.work_j}
        terminated = False
        if drop > 0.0:
            try:
                self.state = self.needle.drop_seed()
                terminated = True
            except ValueError:
                reward -= 1.0
        if terminated:
            info["seed_mm"] = self.needle.seeds()[0][0]
            info["error_mm"] = float(np.linalg.norm(info["seed_mm"] - self.target_mm))
            reward -= info["error_mm"]
        truncated = not terminated and self.steps >= self.most_steps
        return self._observation(), float(reward - 20.0 * truncated), terminated, truncated, info

    def _observation(self) -> NDArray[np.float32]:
        state, roll = self.state, np.radians(self.roll_deg)
        off_mm = np.array(state.tip_mm) - [0.0, 0.0, SEED_MM / 2.0] - self.target_mm
        phase = PHASES.index(state.phase) / (len(PHASES) - 1)
        rest = [phase, state.punctures > 0, min(1.0, self.steps / self.most_steps), state.seeds > 0]
        values = [*off_mm, self.depth_mm, np.cos(roll), np.sin(roll), *state.force_n, *rest]
        return np.clip(np.array(values, dtype=np.float32), -LIMITS, LIMITS)


gymnasium.register(id="Stylet/Needle-v0", entry_point="stylet.env:NeedleEnv")
