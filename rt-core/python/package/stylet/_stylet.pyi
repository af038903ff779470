"""Types of the compiled module; ``help(stylet)`` explains each."""

import os
from collections.abc import Mapping, Sequence
from typing import Any, TypedDict, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

__version__: str
__all__ = [
    "gamma",
    "Dvh",
    "read_dose",
    "read_labels",
    "read_plan",
    "Insertion",
    "State",
    "Parameter",
    "parameters",
    "tissues",
    "read_flight",
    "read_recording",
    "Scene",
    "Structure",
    "scenes",
    "Source",
    "sources",
    "Rehearsed",
    "Stage",
    "study",
    "__version__",
]

_Path = str | os.PathLike[str]
_Three = tuple[float, float, float] | Sequence[float] | NDArray[np.float64]
_Parameters = dict[str, float] | None

class _Trace(TypedDict):
    time_s: NDArray[np.float64]
    depth_mm: NDArray[np.float64]
    resistance_n: NDArray[np.float64]
    displacement_mm: NDArray[np.float64]
    force_n: NDArray[np.float64]
    terms_n: NDArray[np.float64]
    phase: NDArray[np.uint8]

class _Study(TypedDict):
    study: str
    fingerprint: str
    digest: str
    insertions: dict[str, Any]
    seeds: dict[str, Any]

class _Labels(TypedDict):
    labels: NDArray[np.uint8]
    names: dict[int, str]
    patient_from_voxel: NDArray[np.float64]

class _Plan(TypedDict):
    label: str
    source: str
    prescription_gy: float | None
    seeds_mm: NDArray[np.float64]
    axes: NDArray[np.float64]
    strength_u: NDArray[np.float64]
    holes: list[str]
    notes: list[str]

class _Dose(TypedDict):
    dose_gy: NDArray[np.float64]
    origin_mm: list[float]
    spacing_mm: list[float]
    notes: list[str]

class _Ticks(TypedDict):
    time_s: NDArray[np.float64]
    tick: NDArray[np.uint64]
    tip_mm: NDArray[np.float64]
    deflection_mm: NDArray[np.float64]
    tool: NDArray[np.float64]
    force_n: NDArray[np.float64]
    terms_n: NDArray[np.float64]
    past_membrane_mm: NDArray[np.float64]
    speed_mm_per_s: NDArray[np.float64]
    phase: NDArray[np.uint8]
    fault: NDArray[np.uint32]
    flags: NDArray[np.uint32]
    buttons: NDArray[np.uint32]
    tissue_tick: NDArray[np.uint64]
    missed: NDArray[np.uint32]
    wake_latency_ns: NDArray[np.uint64]
    force_written_ns: NDArray[np.uint64]
    work_ns: NDArray[np.uint64]

class _SecondTicks(TypedDict):
    time_s: NDArray[np.float64]
    tick: NDArray[np.uint64]
    tip_mm: NDArray[np.float64]
    tool: NDArray[np.float64]
    force_n: NDArray[np.float64]
    torque_nm: NDArray[np.float64]
    contact_n: NDArray[np.float64]
    fault: NDArray[np.uint32]
    flags: NDArray[np.uint32]
    buttons: NDArray[np.uint32]
    tissue_tick: NDArray[np.uint64]
    missed: NDArray[np.uint32]
    wake_latency_ns: NDArray[np.uint64]
    force_written_ns: NDArray[np.uint64]
    work_ns: NDArray[np.uint64]

class _Events(TypedDict):
    kind: list[str]
    text: list[str]
    time_s: NDArray[np.float64]
    tick: NDArray[np.uint64]
    code: NDArray[np.uint32]
    value: NDArray[np.float64]
    position_mm: NDArray[np.float64]

class _Snapshots(TypedDict):
    time_s: NDArray[np.float64]
    displacement_mm: NDArray[np.float64]
    seeds: NDArray[np.uint32]
    tip_mm: NDArray[np.float64]
    surface_mm: NDArray[np.float32]
    rest_mm: NDArray[np.float32]
    triangles: NDArray[np.uint32]

class _Recording(TypedDict):
    device: str
    version: str
    scene: str
    cut_off: str | None
    ticks: _Ticks
    second: _SecondTicks
    events: _Events
    snapshots: _Snapshots
    seeds_mm: NDArray[np.float64]
    axes: NDArray[np.float64]
    planned_mm: NDArray[np.float64]
    parameters: dict[str, float]

class _TissueTicks(TypedDict):
    time_s: NDArray[np.float64]
    tip_mm: NDArray[np.float64]
    displacement_mm: NDArray[np.float64]
    residual: NDArray[np.float64]
    seeds: NDArray[np.uint32]

class _Flight(TypedDict):
    reason: str
    device: str
    version: str
    period_s: float
    tissue_period_s: float
    ticks: _Ticks
    second: _SecondTicks
    tissue: _TissueTicks

@final
class Parameter:
    @property
    def key(self) -> str: ...
    @property
    def label(self) -> str: ...
    @property
    def unit(self) -> str: ...
    @property
    def default(self) -> float: ...
    @property
    def least(self) -> float: ...
    @property
    def most(self) -> float: ...
    @property
    def source(self) -> str: ...
    @property
    def help(self) -> str: ...

def parameters() -> list[Parameter]: ...
def tissues() -> dict[str, str]: ...
def scenes() -> list[str]: ...
def sources() -> list[str]: ...
@final
class Structure:
    @property
    def name(self) -> str: ...
    @property
    def label(self) -> int: ...
    @property
    def role(self) -> str: ...
    @property
    def young_kpa(self) -> float: ...
    @property
    def poisson(self) -> float: ...
    @property
    def fixed(self) -> bool: ...
    @property
    def volume_cc(self) -> float: ...
    @property
    def lower_mm(self) -> list[float]: ...
    @property
    def upper_mm(self) -> list[float]: ...

@final
class Scene:
    def __new__(cls, name: str = "paper", *, stiffness: float = 1.0) -> Scene: ...
    @staticmethod
    def of_labels(
        labels: NDArray[np.uint8],
        spacing_mm: _Three,
        structures: dict[int, Any] | None = None,
        *,
        origin_mm: _Three = ...,
        name: str = "labels",
    ) -> Scene: ...
    @staticmethod
    def read(path: _Path, label: int | None = None) -> Scene: ...
    @property
    def name(self) -> str: ...
    @property
    def shape(self) -> tuple[int, int, int]: ...
    @property
    def spacing_mm(self) -> float: ...
    @property
    def structures(self) -> list[Structure]: ...
    @property
    def labels(self) -> NDArray[np.uint8]: ...
    @property
    def target_bounds_mm(self) -> tuple[list[float], list[float]]: ...
    @property
    def warnings(self) -> list[str]: ...
    def to_patient(self, places_mm: ArrayLike) -> NDArray[np.float64]: ...
    def to_scene(self, places_mm: ArrayLike) -> NDArray[np.float64]: ...
    def points(
        self, structure: str | None = None, pitch_mm: float = 1.0
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...

@final
class State:
    @property
    def time_s(self) -> float: ...
    @property
    def depth_mm(self) -> float: ...
    @property
    def tip_mm(self) -> tuple[float, float, float]: ...
    @property
    def force_n(self) -> tuple[float, float, float]: ...
    @property
    def resistance_n(self) -> float: ...
    @property
    def terms_n(self) -> tuple[float, float, float, float, float]: ...
    @property
    def past_membrane_mm(self) -> float: ...
    @property
    def phase(self) -> str: ...
    @property
    def punctures(self) -> int: ...
    @property
    def displacement_mm(self) -> float: ...
    @property
    def seeds(self) -> int: ...

@final
class Insertion:
    def __new__(
        cls,
        scene: Scene,
        entry_mm: _Three,
        direction: _Three = ...,
        *,
        tissue: str = "chainmail",
        parameters: _Parameters = None,
        linear: bool = False,
    ) -> Insertion: ...
    def reset(
        self, entry_mm: _Three | None = None, direction: _Three | None = None, *, parameters: _Parameters = None
    ) -> State: ...
    def step(
        self,
        depth_mm: float | None = None,
        dt_s: float = 0.001,
        *,
        tip_mm: _Three | None = None,
        direction: _Three | None = None,
        roll_deg: float | None = None,
    ) -> State: ...
    def move(self, depth_mm: float, speed_mm_per_s: float = 50.0) -> _Trace: ...
    def drop_seed(self, strand_pitch_mm: float | None = None) -> State: ...
    def seeds(self, *, at_rest: bool = True) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
    def displacement(self, places_mm: ArrayLike) -> NDArray[np.float64]: ...
    @property
    def state(self) -> State: ...

@final
class Rehearsed:
    @property
    def planned_mm(self) -> NDArray[np.float64]: ...
    @property
    def seeds_mm(self) -> NDArray[np.float64]: ...
    @property
    def axes(self) -> NDArray[np.float64]: ...
    @property
    def dropped_after_s(self) -> NDArray[np.float64]: ...
    @property
    def peak_force_n(self) -> float: ...
    @property
    def displacement_before_puncture_mm(self) -> float: ...
    @property
    def largest_displacement_mm(self) -> float: ...
    @property
    def target_shift_mm(self) -> float: ...
    @property
    def deflection_mm(self) -> float: ...
    @property
    def simulated_s(self) -> float: ...

@final
class Stage:
    def __new__(cls, scene: Scene, *, tissue: str = "chainmail", linear: bool = False) -> Stage: ...
    def rehearse(
        self,
        entry_mm: _Three,
        direction: _Three,
        seeds_mm: Sequence[float],
        *,
        insert_mm_per_s: float = 50.0,
        retract_mm_per_s: float = 50.0,
        retract_to_mm: float = 0.0,
        strand_pitch_mm: float | None = None,
        stabilising: Sequence[tuple[_Three, _Three, float]] = ...,
        hand: tuple[float, float, float] = ...,
        parameters: _Parameters = None,
    ) -> Rehearsed: ...

@final
class Source:
    def __new__(cls, model: str) -> Source: ...
    @staticmethod
    def parse(text: str) -> Source: ...
    @property
    def model(self) -> str: ...
    @property
    def nuclide(self) -> str: ...
    @property
    def half_life_days(self) -> float: ...
    @property
    def dose_rate_constant(self) -> float: ...
    @property
    def prescription_gy(self) -> float | None: ...
    @property
    def publication(self) -> str | None: ...
    def dose_rate(self, across_mm: ArrayLike, along_mm: ArrayLike, *, line: bool = True) -> NDArray[np.float64]: ...
    def dose(
        self,
        points_mm: ArrayLike,
        seeds_mm: ArrayLike,
        strength_u: ArrayLike,
        axes: ArrayLike | None = None,
        *,
        days: tuple[float, float] | None = None,
    ) -> NDArray[np.float64]: ...
    def dose_grid(
        self,
        origin_mm: _Three,
        spacing_mm: _Three,
        shape: tuple[int, int, int],
        seeds_mm: ArrayLike,
        strength_u: ArrayLike,
        axes: ArrayLike | None = None,
        *,
        days: tuple[float, float] | None = None,
    ) -> NDArray[np.float64]: ...

@final
class Dvh:
    def __new__(cls, dose_gy: ArrayLike, volumes_cc: ArrayLike) -> Dvh: ...
    @property
    def volume_cc(self) -> float: ...
    @property
    def mean_gy(self) -> float: ...
    def metric(self, name: str, prescription_gy: float) -> float: ...
    def at_least_cc(self, dose_gy: ArrayLike) -> NDArray[np.float64]: ...

def gamma(
    dose_gy: NDArray[np.float64],
    other_gy: NDArray[np.float64],
    spacing_mm: _Three,
    *,
    origin_mm: _Three = ...,
    other_spacing_mm: _Three | None = None,
    other_origin_mm: _Three | None = None,
    percent: float = 3.0,
    distance_mm: float = 3.0,
    of_gy: float | None = None,
    least_gy: float = 0.0,
) -> NDArray[np.float64]: ...
def study(file: _Path, folder: _Path, *, jobs: int | None = None) -> _Study: ...
def read_labels(path: _Path) -> _Labels: ...
def read_plan(path: _Path) -> _Plan: ...
def read_dose(path: _Path) -> _Dose: ...
def read_recording(path: _Path) -> _Recording: ...
def read_flight(path: _Path) -> _Flight: ...
