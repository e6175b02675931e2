# SPDX-License-Identifier: Apache-2.0
"""Plans of recordings: a furnished room with several places, and how a camera is carried through it.

| scenario | what happens |
| --- | --- |
| `orbit` | once around a table and a little further |
| `loop` | three rounds past a table and another, out of sight of it, each time from a little aside |
| `opposite` | two rounds, and on the second both tables are seen from their other side |
| `look-alikes` | like `loop`, but the two tables are alike and things of the same classes lie on them |
| `posters` | like `look-alikes`, and every picture on the walls is one of two |
| `moved` | like `loop`, but the things on the first table are rearranged while the second is looked at |
| `days` | two rounds, and two a day later, when a third of all things stand elsewhere |
| `twins` | two rounds through two equal places that differ in one poster, one book or where one chair stands |

A round leads along one long wall to the second table and along the other one back.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from objreg_ros.data.checked import Array
from objreg_ros.geometry import transform
from objreg_tools.simulation.trajectory import Hand, Waypoint, around, carried
from objreg_tools.simulation.visits import CameraLook, between
from objreg_tools.simulation.world import distractors, furniture, print_design
from objreg_tools.simulation.world.furniture import Furniture
from objreg_tools.simulation.world.mesh import Material
from objreg_tools.simulation.world.model import ObjectModel, turn
from objreg_tools.simulation.world.objects import make_object
from objreg_tools.simulation.world.rooms import (
    Laid,
    Spot,
    along_the_walls,
    chairs_at,
    moved_about,
    on_the_boards,
    places_of,
    table_with,
    things,
)
from objreg_tools.simulation.world.scene import Placed, Scene, furnished, number
from objreg_tools.simulation.world.twins import MIDDLE_X, T_SECOND_FIRST, Twins, make_twins

Random = np.random.Generator

ROOM_HALF = (4.4, 3.2)
HALF_WIDTH_OF_TABLES = 0.8
DETOUR_M = 1.4
"""How far from the straight line a round leads."""
NEAR_M = 0.3
Plot = tuple[tuple[Scene, ...], list[Waypoint], Waypoint | float | None]
"""The scenes, the camera's path, and where the second scene takes over: a waypoint, or a share of the frames."""
HEIGHT_M, STEP_M = 1.35, 0.7
"""Of a camera that goes through an opening: its height, and how far before and behind it looks straight ahead."""


@dataclass(frozen=True, eq=False)
class RecordingPlan:
    """``scenes``; for every frame the number of its scene and its pose ``T_world_camera (N, 4, 4)``; the rate in Hz.

    ``robot`` is the name of who carries the camera, empty where there is but one; it begins ``start_ns`` after the
    first of all.
    """

    scenes: tuple[Scene, ...]
    scene_of: Array
    T_world_camera: Array
    rate: float
    robot: str = ""
    start_ns: int = 0

    def __len__(self) -> int:
        return len(self.T_world_camera)


@dataclass(frozen=True, eq=False)
class _Setting:
    """A room with its places: the tables' poses, what lies on each, and everything else that stands about."""

    scene: Scene
    tables: tuple[tuple[Furniture, Array], ...]
    on_table: tuple[Laid, ...]
    others: Laid
    walls: tuple[tuple[Furniture, Array], ...]

    def scene_with(self, on_table: tuple[Laid, ...]) -> Scene:
        return self.scene.with_objects(number([*(item for laid in on_table for item in laid), *self.others]))

    def centre(self, k: int) -> Array:
        """The middle of table ``k``, just above its top."""
        piece, T = self.tables[k]
        return transform(T, np.array([0.0, 0.0, piece.boards[0][2] + 0.08]))


def _setting(rng: Random, occluders: int, alike: bool = False, posters: Sequence[Material] = ()) -> _Setting:
    """A room with two tables far apart, furniture along the walls, chairs, and things on everything."""
    room = furniture.room(rng, ROOM_HALF, posters=posters)
    tables = _two_tables(rng, alike)
    walls = along_the_walls(rng, _spots())
    models = things(rng, int(rng.integers(5, 8)), int(rng.integers(1, 4)))
    second = _look_alikes(rng, models) if alike else things(rng, int(rng.integers(4, 8)), int(rng.integers(1, 4)))
    both = zip(tables, (models, second), strict=True)
    laid = tuple(table_with(rng, piece, T, m, occluders) for (piece, T), m in both)
    others = [item for piece, T in tables for item in chairs_at(rng, piece, T, int(rng.integers(1, 3)))]
    others += on_the_boards(rng, walls)
    scene = furnished(rng, [*tables, *walls], room, lamp_count=2)
    return _Setting(replace(scene, places=places_of(tables)), tables, laid, others, tuple(walls))


def _spots() -> list[Spot]:
    x, y = ROOM_HALF
    return [(0, -2.6, y), (0, 0.2, y), (0, 2.8, y), (180, -2.4, y), (180, 2.2, y), (90, 0.0, x), (270, 0.3, x)]


def _two_tables(rng: Random, alike: bool) -> tuple[tuple[Furniture, Array], ...]:
    """A table on the left and one on the right of the room; the same piece twice if they are ``alike``."""
    size = (float(rng.uniform(1.2, 2 * HALF_WIDTH_OF_TABLES)), float(rng.uniform(0.7, 0.9)))
    first = furniture.table(rng, size)
    second = first if alike else furniture.table(rng, (1.3, 0.75))
    out = []
    for piece, side in ((first, -1.0), (second, 1.0)):
        T = turn("z", float(rng.normal(0, 12)) + (90.0 if alike and side > 0 else 0.0))
        T[:2, 3] = [side * rng.uniform(1.9, 2.2), rng.uniform(-0.4, 0.4)]
        out.append((piece, T))
    return tuple(out)


def _look_alikes(rng: Random, models: list[ObjectModel]) -> list[ObjectModel]:
    """Objects of the same classes: every third the very same model, the others another instance of its class."""
    out = []
    for k, model in enumerate(models):
        kind = model.label
        seed = int(rng.integers(2**31))
        if k % 3 == 0:
            out.append(model)
        elif kind in distractors.FAMILIES:
            out.append(distractors.make_distractor(kind, seed))
        else:
            out.append(make_object(kind, seed))
    return out


def _rounds(setting: _Setting, looks: list[CameraLook]) -> list[Waypoint]:
    """The path past the two tables in turn, seen as the looks say."""
    visits = [look.waypoints(setting.centre(k % 2)) for k, look in enumerate(looks)]
    way = visits[0]
    for k, visit in enumerate(visits[1:]):
        way = [*way, *between(way[-1], visit[0], DETOUR_M * (-1) ** k), *visit]
    return way


def _facing(setting: _Setting, k: int) -> float:
    """The azimuth in degrees from which table ``k`` is seen with one's back to the other table."""
    towards = setting.centre(1 - k) - setting.centre(k)
    return float(np.degrees(np.arctan2(towards[1], towards[0])))


def _looks(rng: Random, setting: _Setting, asides: list[float]) -> list[CameraLook]:
    """A look at each table, and for every one of ``asides`` another at each, so many degrees further around."""
    sign = float(rng.choice([-1, 1]))
    front, back = _facing(setting, 0), _facing(setting, 1)
    looks = [
        CameraLook.at_random(rng, front - sign * 70, sign * 40),
        CameraLook.at_random(rng, back + sign * 30, -sign * 40),
    ]
    for aside in asides:
        looks.append(CameraLook.at_random(rng, front - sign * 50 + sign * aside, -sign * 25))
        looks.append(CameraLook.at_random(rng, back + sign * 10 + sign * aside, sign * 25))
    return looks


def _a_little_aside(rng: Random, setting: _Setting) -> list[CameraLook]:
    """Three rounds: the second and the third see both tables from a little to the left and to the right."""
    side = float(rng.choice([-1, 1]))
    return _looks(rng, setting, [side * float(rng.uniform(15, 35)), -side * float(rng.uniform(15, 35))])


def _orbit(rng: Random, occluders: int) -> Plot:
    setting = _setting(rng, occluders)
    start = float(rng.uniform(0, 360))
    look = CameraLook.at_random(rng, start, float(rng.choice([-1, 1])) * 385)
    way = around(setting.centre(0), look.radius, look.height, look.start, look.stop, count=40)
    return (setting.scene_with(setting.on_table),), way, None


def _loop(rng: Random, occluders: int) -> Plot:
    setting = _setting(rng, occluders)
    return (setting.scene_with(setting.on_table),), _rounds(setting, _a_little_aside(rng, setting)), None


def _opposite(rng: Random, occluders: int) -> Plot:
    setting = _setting(rng, occluders)
    looks = _looks(rng, setting, [float(rng.uniform(150, 180))])
    return (setting.scene_with(setting.on_table),), _rounds(setting, looks), None


def _posters(rng: Random, occluders: int) -> Plot:
    return _alike(rng, occluders, [Material(print_design.poster(rng)) for _ in range(2)])


def _alike(rng: Random, occluders: int, posters: Sequence[Material] = ()) -> Plot:
    setting = _setting(rng, occluders, alike=True, posters=posters)
    return (setting.scene_with(setting.on_table),), _rounds(setting, _a_little_aside(rng, setting)), None


def _moved(rng: Random, occluders: int) -> Plot:
    setting = _setting(rng, occluders)
    looks = _a_little_aside(rng, setting)
    piece, T = setting.tables[0]
    again = table_with(rng, piece, T, [model for model, _ in setting.on_table[0]], 0)
    before = setting.scene_with(setting.on_table)
    after = _same_numbers(before, setting.scene_with((again, *setting.on_table[1:])))
    at_the_second = looks[1].waypoints(setting.centre(1))
    return (before, after), _rounds(setting, looks), at_the_second[len(at_the_second) // 2]


def _days(rng: Random, occluders: int) -> Plot:
    setting = _setting(rng, occluders)
    side = float(rng.choice([-1, 1]))
    asides = [side * float(rng.uniform(*degrees)) for degrees in ((15, 35), (-35, -15), (5, 25))]
    laid = [item for table in setting.on_table for item in table] + setting.others
    boards = [(piece, T) for piece, T in (*setting.tables, *setting.walls) if piece.boards]
    before = setting.scene_with(setting.on_table)
    after = before.with_objects(number(moved_about(rng, laid, boards, setting.tables)))
    return (before, _same_numbers(before, after)), _rounds(setting, _looks(rng, setting, asides)), 0.5


def _same_numbers(before: Scene, after: Scene) -> Scene:
    """The scene with every model's instance number of ``before``: rearranged things keep their numbers."""
    numbers = {id(o.model): o.instance for o in before.objects}
    return after.with_objects([Placed(numbers[id(o.model)], o.model, o.T_world_object) for o in after.objects])


def _twins(rng: Random, occluders: int) -> Plot:
    twins = make_twins(rng, occluders)
    path = _visit(rng, twins, 0)
    for k in (1, 0, 1):
        path += [*_through(k), *_visit(rng, twins, k)]
    return (twins.scene,), path, None


def _visit(rng: Random, twins: Twins, k: int) -> list[Waypoint]:
    """A look at the table of place ``k`` and one along the wall behind it, in either order."""
    front, turned = twins.front + 180.0 * k, np.linalg.matrix_power(T_SECOND_FIRST, k)
    sweep, aside = float(rng.choice([-1, 1])) * 40, float(rng.uniform(-25, 25))
    look = CameraLook.at_random(rng, front + aside - sweep / 2, sweep).waypoints(twins.scene.places[k].centre)
    eye = transform(turned, np.array([MIDDLE_X + rng.uniform(-0.4, 0.4), 0.0, HEIGHT_M]))
    azimuths = np.radians(front + 180.0 + float(rng.choice([-1, 1])) * np.linspace(-50, 50, 7))
    along = [Waypoint(eye, eye + np.array([np.cos(a), np.sin(a), -0.1])) for a in azimuths]
    return [*along, *look] if rng.random() < 0.5 else [*look, *along]


def _through(to: int) -> list[Waypoint]:
    """Through the opening between twin places, looking ahead."""
    ahead = 1.0 if to else -1.0
    eyes = [np.array([ahead * step, 0.0, HEIGHT_M]) for step in (-STEP_M, 0.0, STEP_M)]
    return [Waypoint(eye, eye + np.array([ahead, 0.0, -0.2])) for eye in eyes]


def twins_of(seed: int, occluders: int = 0) -> Twins:
    """The places of the scenario `twins` of a seed: what differs in them, and where."""
    return make_twins(_sown("twins", seed), occluders)


SCENARIOS: dict[str, Callable[[Random, int], Plot]] = {
    "orbit": _orbit,
    "loop": _loop,
    "opposite": _opposite,
    "look-alikes": _alike,
    "moved": _moved,
    "posters": _posters,
    "days": _days,
    "twins": _twins,
}
OF_ONE_DAY = tuple(name for name in SCENARIOS if name not in ("days", "twins"))
"""What training draws from."""


def _sown(scenario: str, seed: int) -> Random:
    return np.random.default_rng([seed, 31, list(SCENARIOS).index(scenario)])


def make_plan(scenario: str, seed: int, frames: int = 600, rate: float = 30.0, occluders: int = 0) -> RecordingPlan:
    """The plan of a recording of a scenario; all follows from its arguments. ValueError if there is no such scenario.

    ``occluders`` are things added to every table. ``rate`` in Hz comes down where so few frames would make the
    camera faster than a hand moves it.
    """
    if scenario not in SCENARIOS:
        raise ValueError(f"expected one of {', '.join(SCENARIOS)}, got {scenario!r}")
    rng = _sown(scenario, seed)
    scenes, waypoints, change = SCENARIOS[scenario](rng, occluders)
    poses, rate = carried(waypoints, frames, rate, rng, Hand())
    scene_of = np.zeros(frames, int)
    if change is not None:
        scene_of[round(change * frames) if isinstance(change, float) else _first_passing(poses, change) :] = 1
    return RecordingPlan(scenes, scene_of, poses, rate)


def _first_passing(poses: Array, waypoint: Waypoint) -> int:
    """The first frame whose camera is near a waypoint of its path."""
    return int(np.argmax(np.linalg.norm(poses[:, :3, 3] - waypoint.eye, axis=1) < NEAR_M))
