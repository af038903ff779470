"""Bodies and needles that several tests use."""

import pathlib

import numpy as np
import pytest
import stylet

ROOT = pathlib.Path(__file__).resolve().parents[3]
ENTRY_MM = (72.979, 44.715, 86.401)
AXIS = (0.0, 0.0, 1.0)


@pytest.fixture(scope="session")
def paper() -> stylet.Scene:
    return stylet.Scene("paper")


@pytest.fixture
def needle(paper) -> stylet.Insertion:
    return stylet.Insertion(paper, ENTRY_MM)


def same_bits(one, other) -> bool:
    """Compares arrays bit by bit."""
    return np.asarray(one).tobytes() == np.asarray(other).tobytes()
