"""The environment: what Gymnasium asks for, the same episodes for the same seed, a target that can be met."""

import time

import gymnasium
import numpy as np
import pytest
import stylet.env
from gymnasium.utils.env_checker import check_env


@pytest.fixture(scope="module")
def env():
    return gymnasium.make("Stylet/Needle-v0").unwrapped


def straight(env, seed):
    """Goes to the depth of the target without a turn, and drops; returns all rewards and the last information."""
    observation, _ = env.reset(seed=seed)
    rewards, over = [], False
    while not over:
        arrived = observation[2] > -0.5
        action = np.array([0.0, 0.0, 1.0] if arrived else [1.0, 0.0, -1.0])
        observation, reward, terminated, truncated, info = env.step(action)
        rewards.append(reward)
        over = terminated or truncated
    return rewards, info


@pytest.mark.filterwarnings("error")
def test_gymnasium_finds_nothing_wrong(env):
    check_env(env, skip_render_check=True)


def test_everything_follows_from_the_seed(env):
    first, again, other = straight(env, 3), straight(env, 3), straight(env, 4)
    assert first[0] == again[0] and np.array_equal(first[1]["seed_mm"], again[1]["seed_mm"])
    assert first[0] != other[0]
    assert straight(stylet.env.NeedleEnv(), 3)[0] == first[0], "whatever was before"


def test_the_reward_is_the_error_and_the_work(env):
    rewards, info = straight(env, 5)
    steps = len(rewards)
    assert info["error_mm"] < 15.0
    expected = -info["error_mm"] - env.damage_per_j * info["work_j"] - env.step_cost * steps
    assert sum(rewards) == pytest.approx(expected)
    assert 0.0 < info["work_j"] < 1.0


def test_a_seed_never_dropped_and_one_outside_cost(env):
    short = stylet.env.NeedleEnv(most_steps=5)
    short.reset(seed=1)
    rewards = [short.step(np.array([0.0, 0.0, -1.0])) for _ in range(5)]
    assert rewards[-1][3] and rewards[-1][1] < -19.0 and not rewards[-2][3]
    env.reset(seed=1)
    _, reward, terminated, *_ = env.step(np.array([0.0, 0.0, 1.0]))
    assert reward < -0.9 and not terminated


def test_a_turn_steers_the_needle(env):
    def end(roll_steps):
        env.reset(seed=2)
        for _ in range(roll_steps):
            env.step(np.array([0.0, 1.0, -1.0]))
        for _ in range(45):
            observation = env.step(np.array([1.0, 0.0, -1.0]))[0]
        return observation[:2]

    # 25 steps of 20 ms at 360 degrees a second are half a turn.
    assert np.linalg.norm(end(0) - end(25)) > 0.5


def test_tissue_can_vary_between_episodes():
    env = stylet.env.NeedleEnv(vary={"force.shaft_friction": (20.0, 300.0)})
    works = {round(straight(env, seed)[1]["work_j"], 6) for seed in (1, 1, 2)}
    assert len(works) == 2


def test_steps_per_second_are_printed(env):
    env.reset(seed=1)
    begun, steps = time.perf_counter(), 0
    for seed in range(3):
        env.reset(seed=seed)
        for _ in range(100):
            env.step(np.array([0.4, 0.1, -1.0]))
            steps += 1
    print(f"\n{steps / (time.perf_counter() - begun):.0f} steps of 20 ms a second")
