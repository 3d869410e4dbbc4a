"""Shapes of Gazebo worlds: obstacles cover what is true of them between two heights, and little more."""

import math
import re

import numpy as np
import pytest

from antdrive.worlds import Disc, import_sdf
from tests.worlds.formats.test_sdf import shape, world
from tests.worlds.oracles import rotation

BAND = (0.1, 0.6)


def placed(geometry, pose, name="thing", static=1):
    numbers = " ".join(f"{v:.17g}" for v in pose)
    return (
        f"<model name='{name}'><static>{static}</static><pose>{numbers}</pose><link name='l'><collision name='c'>"
        f"<geometry>{geometry}</geometry></collision></link></model>"
    )


def imported(tmp_path, *parts, **options):
    return import_sdf(world(tmp_path, *parts), bounds=(-50, -50, 50, 50), start=(-49, -49, 0), **options).world


def reach(world):
    return float(re.search(r"reach at most ([\d.e-]+) m", world.source)[1])


def gaps(world, points):
    """Distances from points (N, 2) to the nearest obstacle, negative inside."""
    return np.min([np.hypot(*(points - (d.x, d.y)).T) - d.radius for d in world.obstacles], axis=0)


#: SDF of a shape, the half sides of a box around it, and which of its own points (N, 3) are in it.
SHAPES = {
    "box": ("<box><size>1 0.4 0.8</size></box>", (0.5, 0.2, 0.4), lambda p: np.ones(len(p), bool)),
    "cylinder": (
        "<cylinder><radius>0.3</radius><length>1.2</length></cylinder>", (0.3, 0.3, 0.6),
        lambda p: np.hypot(p[:, 0], p[:, 1]) < 0.3,
    ),
    "sphere": ("<sphere><radius>0.5</radius></sphere>", (0.5,) * 3, lambda p: np.linalg.norm(p, axis=1) < 0.5),
    "ellipsoid": (
        "<ellipsoid><radii>0.6 0.3 0.2</radii></ellipsoid>", (0.6, 0.3, 0.2),
        lambda p: np.linalg.norm(p / [0.6, 0.3, 0.2], axis=1) < 1,
    ),
    "capsule": (
        "<capsule><radius>0.2</radius><length>0.6</length></capsule>", (0.2, 0.2, 0.5),
        lambda p: np.linalg.norm(p - np.outer(p[:, 2].clip(-0.3, 0.3), [0, 0, 1]), axis=1) < 0.2,
    ),
    "cone": (
        "<cone><radius>0.4</radius><length>0.8</length></cone>", (0.4, 0.4, 0.4),
        lambda p: np.hypot(p[:, 0], p[:, 1]) < 0.4 * (0.4 - p[:, 2]) / 0.8,
    ),
    "polyline": (  # the letter L, with a hole
        "<polyline><point>-0.5 -0.5</point><point>0.5 -0.5</point><point>0.5 0</point><point>0 0</point><point>0 0.5</point>"
        "<point>-0.5 0.5</point><height>0.7</height></polyline>"
        "<polyline><point>-0.4 -0.4</point><point>-0.1 -0.4</point><point>-0.1 -0.1</point><height>0.7</height></polyline>",
        (0.5, 0.5, 0.7),
        lambda p: (p[:, 2] > 0) & ((p[:, 0] < 0) | (p[:, 1] < 0))
        & ~((p[:, 0] < -0.1) & (p[:, 1] > -0.4) & (p[:, 1] < p[:, 0])),
    ),
}  # fmt: skip


@pytest.mark.parametrize("upright", [True, False])
@pytest.mark.parametrize("name", SHAPES)
def test_every_point_of_a_shape_between_the_heights_is_covered_and_little_else(name, upright, tmp_path):
    geometry, half, inside = SHAPES[name]
    rng = np.random.default_rng(len(name))
    for _ in range(3):
        pose = np.array([*rng.uniform(-3, 3, 2), rng.uniform(0.2, 0.5), *rng.uniform(-3, 3, 3)])
        if upright:
            pose[3:5] = 0.0
        made = imported(tmp_path, placed(geometry, pose), band=BAND)
        own = rng.uniform(-1, 1, (60_000, 3)) * half
        points = own[inside(own)] @ rotation(*pose[3:]).T + pose[:3]
        points = points[(points[:, 2] > BAND[0]) & (points[:, 2] < BAND[1])][:, :2]
        assert gaps(made, points).max() <= 0
        most = reach(made) if "reach" in made.source else 0.002
        turns = np.exp(2j * math.pi * np.arange(8) / 8)
        rims = [(d.x + d.radius * t.real, d.y + d.radius * t.imag) for d in made.obstacles for t in turns]
        away = [np.hypot(*(points - rim).T).min() for rim in rims]
        assert max(away) < most + 0.04  # samples are that dense


def test_a_cover_reaches_no_farther_beyond_a_box_than_it_states(tmp_path):
    rng = np.random.default_rng(5)
    for cell in (0.01, 0.02, 0.05):
        x, y, yaw = rng.uniform(-3, 3, 3)
        made = imported(tmp_path, placed("<box><size>2 0.3 1</size></box>", (x, y, 0.5, 0, 0, yaw)), resolution=cell)
        points = rng.uniform(-1.5, 1.5, (40_000, 2))
        own = (points - 0) @ np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
        beyond = np.hypot(*np.maximum(np.abs(own) - [1.0, 0.15], 0.0).T)
        free = gaps(made, points + (x, y)) > 0
        assert reach(made) < 2.5 * cell
        assert not free[beyond == 0].any()
        assert free[beyond > reach(made)].all()


def test_the_inside_of_a_large_box_is_covered_too(tmp_path):
    made = imported(tmp_path, placed("<box><size>12 9 1</size></box>", (0.3, 0.2, 0.5, 0, 0, 0.4)))
    points = np.random.default_rng(0).uniform(-1, 1, (5000, 2)) * [6.0, 4.5]
    turn = np.array([[math.cos(0.4), -math.sin(0.4)], [math.sin(0.4), math.cos(0.4)]])
    assert gaps(made, points @ turn.T + (0.3, 0.2)).max() <= 0
    assert len(made.obstacles) < 1000


def test_smaller_cells_and_a_smaller_overhang_protrude_less_and_need_more_cylinders(tmp_path):
    wall = placed("<box><size>3 0.15 1</size></box>", (0, 0, 0.5, 0, 0, 0.3))
    coarse, fine = (imported(tmp_path, wall, resolution=cell) for cell in (0.05, 0.01))
    assert reach(fine) < reach(coarse)
    assert len(fine.obstacles) > len(coarse.obstacles)
    tight = imported(tmp_path, wall, resolution=0.05, overhang=0.0104)
    assert reach(tight) < reach(coarse)


def test_spheres_and_upright_round_shapes_are_one_cylinder_each(tmp_path):
    kinds = ("cylinder", "sphere", "capsule", "cone")
    parts = [placed(SHAPES[kind][0], (3 * i, 0, 0.5, 0, 0, 1)) for i, kind in enumerate(kinds)]
    made = imported(tmp_path, *parts)
    assert [(d.x, d.y) for d in made.obstacles] == [(0, 0), (3, 0), (6, 0), (9, 0)]
    assert [d.radius for d in made.obstacles] == pytest.approx([0.3, 0.5, 0.2, 0.4 * (0.9 - 0.1 + 0.0) / 0.8], abs=0.01)


def test_what_is_above_the_band_or_flat_is_no_obstacle_and_said(tmp_path):
    lamp, lintel = placed("<sphere><radius>0.1</radius></sphere>", (1, 1, 2.5, 0, 0, 0)), (2, 2, 2.3, 0, 0, 0)
    carpet = placed("<box><size>2 2 0.008</size></box>", (0, 0, 0.004, 0, 0, 0))
    post = placed("<cylinder><radius>0.1</radius><length>1</length></cylinder>", (3, 3, 0.5, 0, 0, 0), static=0)
    made = imported(tmp_path, lamp, placed("<box><size>1 1 0.4</size></box>", lintel), carpet, post)
    assert made.obstacles == (Disc(3, 3, 0.1),)
    said = made.source.split("; ")
    assert "shapes above 2 m, no obstacles: 2" in said
    assert "shapes up to 0.01 m, taken for floor: 1" in said
    assert "bodies that could move, taken to stand still: 1" in said
    assert len(imported(tmp_path, lamp, post, band=(0.0, 3.0)).obstacles) == 2


def test_a_thick_floor_raises_the_heights(tmp_path):
    floor = placed("<box><size>20 20 0.2</size></box>", (0, 0, 0.1, 0, 0, 0))
    step = placed("<box><size>1 1 0.1</size></box>", (0, 0, 0.25, 0, 0, 0))
    lamp = placed("<box><size>1 1 0.1</size></box>", (4, 4, 2.15, 0, 0, 0))
    made = imported(tmp_path, floor, step, lamp, resolution=0.05)
    assert "the floor is 0.2 m high" in made.source
    assert gaps(made, np.array([[0.0, 0.0], [4.0, 4.0]])).max() < 0
    assert gaps(made, np.array([[7.0, 0.0]])) > 4
    assert gaps(imported(tmp_path, floor, band=(0.01, 2), resolution=0.2), np.array([[9.0, 9.0]])) < 0


def test_a_house_of_which_walls_enclose_the_floor_is_no_floor(tmp_path):
    curb = [placed("<box><size>9 0.2 0.2</size></box>", (0, y, 0.1, 0, 0, 0)) for y in (-5, 5)]
    assert gaps(imported(tmp_path, *curb), np.array([[0.0, 5.0]])) < 0


def stl(*triangles):
    """An ASCII STL file."""
    corners = ("".join(f"vertex {x} {y} {z}\n" for x, y, z in corner) for corner in triangles)
    facets = "".join(f"facet normal 0 0 0\nouter loop\n{each}endloop\nendfacet\n" for each in corners)
    return f"solid made\n{facets}endsolid made\n"


TENT = [((0, 0, 0), (2, 0, 0), (1, 0, 2)), ((0, 3, 0), (2, 3, 0), (1, 3, 2))]


def test_meshes_are_covered_between_the_heights(tmp_path):
    (tmp_path / "tent.stl").write_text(stl(*TENT))
    mesh = "<mesh><uri>tent.stl</uri><scale>1 1 0.5</scale></mesh>"
    made = imported(tmp_path, placed(mesh, (0, 0, 0, 0, 0, 0)), band=(0.5, 5))
    rows = np.column_stack([np.linspace(0.5, 1.5, 50), np.zeros(50)])
    assert gaps(made, rows).max() <= 0
    assert gaps(made, rows + (0, 3)).max() <= 0
    assert gaps(made, np.array([[0.4, 0.0], [1.6, 3.0], [1.0, 1.5]])).min() > 0


def test_sloping_ground_is_said(tmp_path):
    hill = [((0, 0, 0), (20, 0, 2), (0, 20, 0)), ((20, 0, 2), (20, 20, 2), (0, 20, 0))]
    (tmp_path / "hill.stl").write_text(stl(*hill))
    mesh = "<mesh><uri>hill.stl</uri></mesh>"
    assert (
        "sloping ground, taken for obstacles: 400 m2"
        in imported(tmp_path, placed(mesh, (0,) * 6), resolution=0.2).source
    )
    steep = placed(mesh, (0, 0, 0, 1.2, 0, 0))
    assert "sloping" not in imported(tmp_path, steep, resolution=0.2).source


def test_the_same_mesh_is_read_once(tmp_path, monkeypatch):
    from antdrive.worlds.formats import sdf_models

    (tmp_path / "tent.stl").write_text(stl(*TENT))
    read = []
    monkeypatch.setattr(
        sdf_models, "read_mesh", lambda *given: read.append(given) or (np.eye(3), np.array([[0, 1, 2]]))
    )
    mesh = "<mesh><uri>tent.stl</uri></mesh>"
    imported(tmp_path, *(placed(mesh, (4 * i, 0, 0, 0, 0, 0), f"m{i}") for i in range(5)))
    assert len(read) == 1


def test_without_trimesh_a_mesh_names_the_extra(tmp_path, monkeypatch):
    import sys

    (tmp_path / "tent.stl").write_text(stl(*TENT))
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with pytest.raises(ValueError, match=r"pip install 'antdrive\[urdf\]'"):
        imported(tmp_path, placed("<mesh><uri>tent.stl</uri></mesh>", (0,) * 6))


def test_a_large_world_gets_larger_cells(tmp_path):
    walls = [placed("<box><size>900 0.3 1</size></box>", (0, 40 * i, 0.5, 0, 0, 0), f"w{i}") for i in range(4)]
    made = import_sdf(world(tmp_path, *walls)).world
    assert 0.05 < reach(made) < 1
    assert len(made.obstacles) < 20_000
    with pytest.raises(ValueError, match="--resolution"):
        import_sdf(world(tmp_path, *walls), resolution=0.001)


def test_a_plain_world_of_cylinders_needs_no_kernels(tmp_path, monkeypatch):
    from antdrive.worlds.formats import solids

    monkeypatch.setattr(solids, "_rasterised", None)
    can = "<cylinder><radius>0.1</radius><length>1</length></cylinder>"
    assert imported(tmp_path, placed(can, (1, 1, 0.5, 0, 0, 0)), shape("empty")).obstacles == (Disc(1, 1, 0.1),)


def plane(z, normal="0 0 1"):
    return placed(f"<plane><normal>{normal}</normal><size>9 9</size></plane>", (0, 0, z, 0, 0, 0), f"plane{z}")


def test_the_highest_ground_plane_is_the_floor(tmp_path):
    box = placed("<box><size>1 1 1</size></box>", (3, 0, -1.5, 0, 0, 0))
    low = tmp_path / "low.sdf"
    low.write_text(f"<sdf><world name='w'>{plane(-2.5)}{plane(-2.0)}{box}</world></sdf>")
    made = import_sdf(low).world
    assert "the floor is -2 m high" in made.source
    assert "shapes between -1.99 and 0 m: 1 box" in made.source
    assert {d.height for d in made.obstacles} == {1.0}
    assert import_sdf(low, band=(-1.99, 0)).world.obstacles[0].height == pytest.approx(0.99)


@pytest.mark.parametrize(
    ("odd", "why"), [(plane(1.0), "1 m above the floor"), (plane(0.0, "0 0 -1"), "does not face up")]
)
def test_planes_that_are_no_floor_are_refused(odd, why, tmp_path):
    with pytest.raises(ValueError, match=why):
        imported(tmp_path, placed("<box><size>1 1 0.5</size></box>", (3, 0, 0.25, 0, 0, 0)), odd)


def test_a_stage_on_the_ground_is_an_obstacle(tmp_path):
    stage = placed("<box><size>6 4 0.25</size></box>", (0, 0, 0.125, 0, 0, 0))
    post = placed("<box><size>0.2 0.2 1</size></box>", (5, 2.4, 0.5, 0, 0, 0), "post")
    made = imported(tmp_path, stage, post)
    assert "the floor is" not in made.source
    assert gaps(made, np.array([[2.9, 0.0]])) < 0
