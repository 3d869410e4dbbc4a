"""Gazebo worlds of several files: included models, frames, meshes, robots and actors."""

import pytest

from antdrive.base import InputError
from antdrive.worlds import Disc, import_sdf
from tests.worlds.formats.test_sdf import cylinder, shape, world
from tests.worlds.formats.test_sdf_shapes import TENT, placed, stl

POST = "<geometry><cylinder><radius>0.1</radius><length>1</length></cylinder></geometry>"
VARIABLES = ("GZ_SIM_RESOURCE_PATH", "IGN_GAZEBO_RESOURCE_PATH", "SDF_PATH", "GAZEBO_MODEL_PATH")


@pytest.fixture(autouse=True)
def bare(monkeypatch, tmp_path):
    for variable in (*VARIABLES, "AMENT_PREFIX_PATH", "ROS_PACKAGE_PATH"):
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))


def post(inside="", name="post", attributes=""):
    link = f"<link name='l'><pose>0 0 0.5 0 0 0</pose><collision name='c'>{POST}</collision></link>"
    return f"<model name='{name}' {attributes}><static>1</static>{inside}{link}</model>"


def model_in(folder, text=None, config="model.sdf", file="model.sdf"):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / file).write_text(f"<sdf version='1.7'>{text or post()}</sdf>")
    if config:
        entry = f"<model><sdf version='1.4'>old.sdf</sdf><sdf version='1.7'>{config}</sdf></model>"
        (folder / "model.config").write_text(entry)


def include(uri, inside="<pose>3 4 0 0 0 0</pose>", attributes=""):
    return f"<include {attributes}><uri>{uri}</uri>{inside}</include>"


def places(path, **options):
    task = import_sdf(path, bounds=(-50, -50, 50, 50), start=(-40, -40, 0), **options)
    return [(round(d.x, 6), round(d.y, 6)) for d in task.world.obstacles]


@pytest.mark.parametrize("variable", [None, *VARIABLES])
def test_an_included_model_is_found_beside_the_file_and_by_each_variable(variable, tmp_path, monkeypatch):
    folder = tmp_path / "elsewhere" if variable else tmp_path
    model_in(folder / "post")
    if variable:
        monkeypatch.setenv(variable, f"{tmp_path / 'nothing'}:{folder}")
    assert places(world(tmp_path, include("model://post"))) == [(3, 4)]


FOUND = {
    "in models beside": ("models/post", "model://post"),
    "by the file": ("models/post", "model://post/model.sdf"),
    "by a relative path": ("post", "post"),
    "by two names": ("models/group/post", "model://group/post"),
    "another file name": ("models/post", "model://post"),
    "from Fuel": (
        "home/.gz/fuel/fuel.gazebosim.org/me/models/a post/2",
        "https://fuel.gazebosim.org/1.0/me/models/A%20Post",
    ),
    "from Fuel by its name": ("models/A Post", "https://fuel.gazebosim.org/1.0/me/models/A Post/7"),
    "of Gazebo classic": ("home/.gazebo/models/post", "model://post"),
}


@pytest.mark.parametrize("case", FOUND)
def test_an_included_model_is_found(case, tmp_path):
    folder, uri = FOUND[case]
    name = "other.sdf" if "another" in case else "model.sdf"
    model_in(tmp_path / folder, config=name, file=name)
    assert places(world(tmp_path, include(uri))) == [(3, 4)]


def test_folders_above_the_file_are_searched(tmp_path):
    model_in(tmp_path / "models" / "post")
    (tmp_path / "a" / "worlds").mkdir(parents=True)
    assert places(world(tmp_path / "a" / "worlds", include("model://post"))) == [(3, 4)]


def test_file_addresses_and_packages_of_ros_are_found(tmp_path, monkeypatch):
    model_in(tmp_path / "far" / "post")
    (tmp_path / "ws" / "share" / "tents" / "meshes").mkdir(parents=True)
    (tmp_path / "ws" / "share" / "tents" / "meshes" / "tent.stl").write_text(stl(*TENT))
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "ws"))
    mesh = placed("<mesh><uri>package://tents/meshes/tent.stl</uri></mesh>", (0,) * 6)
    assert len(places(world(tmp_path, include(f"file://{tmp_path}/far/post/model.sdf"), mesh))) > 10


def test_a_mesh_whose_name_differs_in_capitals_is_found_and_said(tmp_path):
    (tmp_path / "Tent.stl").write_text(stl(*TENT))
    task = import_sdf(world(tmp_path, placed("<mesh><uri>file://tent.STL</uri></mesh>", (0,) * 6)))
    assert "meshes whose names differ in capitals: 1" in task.world.source


def test_all_missing_models_are_named_in_one_line_with_the_remedy(tmp_path):
    model_in(tmp_path / "cart", post("<include><uri>model://wheel</uri></include>"))
    mesh = shape("mesh", "<uri>model://statue/meshes/statue.dae</uri>")
    path = world(tmp_path, include("model://house"), include("model://cart"), include("model://house"), mesh)
    with pytest.raises(InputError) as caught:
        import_sdf(path)
    problem = str(caught.value)
    assert "\n" not in problem
    assert "models and meshes not found (3): model://house, model://wheel, model://statue/meshes/statue.dae" in problem
    assert "GZ_SIM_RESOURCE_PATH" in problem
    skipped = []
    import_sdf(path, skip_unsupported=True, on_skipped=skipped.extend)
    assert [part.split(" ")[0] for part in skipped] == [
        "model://house",
        "model://wheel",
        "model://statue/meshes/statue.dae",
    ]


def test_addresses_longer_than_file_names_are_missing(tmp_path):
    fuel = include(f"https://fuel.gazebosim.org/1.0/{'a' * 300}/models/{'b' * 300}")
    mesh = shape("mesh", f"<uri>{'c' * 300}/{'d' * 5000}.stl</uri>")
    with pytest.raises(InputError, match=r"not found \(2\)"):
        import_sdf(world(tmp_path, fuel, mesh))


def test_an_include_gives_pose_name_and_static(tmp_path):
    moving = post("<pose>9 9 0 0 0 0</pose>").replace("<static>1</static>", "")
    model_in(tmp_path / "post", moving)
    assert places(world(tmp_path, include("model://post"))) == [(3, 4)]
    assert places(world(tmp_path, include("model://post", ""))) == [(9, 9)]
    source = import_sdf(world(tmp_path, include("model://post"))).world.source
    assert "bodies that could move, taken to stand still: 1" in source
    fixed = import_sdf(world(tmp_path, include("model://post", "<static>true</static><name>a</name>"))).world.source
    assert "could move" not in fixed


def test_nested_and_merged_includes_are_placed_in_their_model(tmp_path):
    model_in(tmp_path / "post")
    for attributes in ("", "merge='true'"):
        inner = include("model://post", "<pose>1 0 0 0 0 0</pose>", attributes)
        outer = f"<model name='o'><pose>5 0 0 0 0 1.5707963267948966</pose><static>1</static>{inner}</model>"
        assert places(world(tmp_path, outer)) == [(5, 1)]


def test_states_of_included_models_win(tmp_path):
    model_in(tmp_path / "post")
    state = "<state world_name='w'><model name='there'><pose>7 7 0 0 0 0</pose></model></state>"
    assert places(world(tmp_path, include("model://post", "<name>there</name>"), state)) == [(7, 7)]


def test_models_inserted_by_the_state_count_and_deleted_ones_do_not(tmp_path):
    new = f"<insertions>{post('<pose>2 2 0 0 0 0</pose>', 'new')}</insertions>"
    state = f"<state>{new}<deletions><name>old</name></deletions></state>"
    assert places(world(tmp_path, post(name="old"), state)) == [(2, 2)]


def test_poses_are_relative_to_frames(tmp_path):
    base = post("<pose>1 2 0 0 0 1.5707963267948966</pose>", "base")
    beside = post("<pose relative_to='base'>3 0 0 0 0 0</pose>", "beside")
    frames = "<frame name='f' attached_to='beside'><pose>0 1 0 0 0 0</pose></frame><frame name='g' attached_to='f'/>"
    third = post("<pose relative_to='g'/>", "third")
    fourth = post("<pose relative_to='base::l'>0 2 0 0 0 0</pose>", "fourth")
    assert places(world(tmp_path, base, beside, frames, third, fourth)) == [(1, 2), (1, 5), (0, 5), (-1, 2)]


def test_links_are_relative_to_links_joints_and_the_model(tmp_path):
    def link(name, pose):
        return f"<link name='{name}'>{pose}<collision name='c'>{POST}</collision></link>"

    parts = (
        link("a", "<pose>1 0 0.5 0 0 0</pose>") + link("b", "<pose relative_to='a'>1 0 0 0 0 0</pose>")
        + "<joint name='j' type='fixed'><parent>a</parent><child>b</child><pose>0 1 0 0 0 0</pose></joint>"
        + link("c", "<pose relative_to='j'>0 0 0 0 0 0</pose>") + link("d", "<pose relative_to='__model__'>0 3 0.5 0 0 0</pose>")
    )  # fmt: skip
    model = f"<model name='m'><pose>10 0 0 0 0 0</pose>{parts}</model>"
    assert places(world(tmp_path, model)) == [(11, 0), (12, 0), (12, 1), (10, 3)]


def test_a_frame_may_be_attached_to_a_link_that_is_placed_in_it(tmp_path):
    frame = "<frame name='f' attached_to='l'><pose relative_to='__model__'>3 4 0 0 0 0</pose></frame>"
    link = f"<link name='l'><pose relative_to='f'>1 0 0.5 0 0 0</pose><collision name='c'>{POST}</collision></link>"
    assert places(world(tmp_path, f"<model name='m'>{frame}{link}</model>")) == [(4, 4)]


def test_a_placement_frame_is_what_the_pose_places(tmp_path):
    frame = "<pose>5 5 0 0 0 0</pose><frame name='corner'><pose>1 0 0 0 0 0</pose></frame>"
    assert places(world(tmp_path, post(frame, attributes="placement_frame='corner'"))) == [(4, 5)]
    model_in(tmp_path / "post", post(frame))
    inside = "<placement_frame>corner</placement_frame><pose>7 7 0 0 0 0</pose>"
    assert places(world(tmp_path, include("model://post", inside))) == [(6, 7)]


CIRCLES = {
    "frames": "<frame name='a' attached_to='b'/><frame name='b' attached_to='a'/>" + post("<pose relative_to='a'/>"),
    "models": post("<pose relative_to='q'/>", "p") + post("<pose relative_to='p'/>", "q"),
    "itself": post("<pose relative_to='post'/>"),
    "long chain": "".join(f"<frame name='f{i}' attached_to='f{i + 1}'/>" for i in range(3000))
    + post("<pose relative_to='f0'/>"),
}


@pytest.mark.parametrize("case", CIRCLES)
def test_frames_in_a_circle_are_refused(case, tmp_path):
    with pytest.raises(InputError, match="refers to itself"):
        import_sdf(world(tmp_path, cylinder(), CIRCLES[case]))


def test_models_that_include_themselves_are_refused(tmp_path):
    model_in(tmp_path / "a", post(include("model://b")))
    model_in(tmp_path / "b", post(include("model://a")))
    with pytest.raises(InputError, match="includes itself"):
        import_sdf(world(tmp_path, include("model://a")))


def test_includes_that_multiply_are_refused(tmp_path):
    for i in range(12):
        model_in(tmp_path / f"m{i}", post("".join(include(f"model://m{i + 1}") for _ in range(10))))
    with pytest.raises(InputError, match="20000 models"):
        import_sdf(world(tmp_path, include("model://m0")))


def test_a_broken_included_file_is_named(tmp_path):
    model_in(tmp_path / "bad", "<model name='m'>")
    with pytest.raises(InputError, match=r"model://bad \(.*bad/model.sdf:1: not XML"):
        import_sdf(world(tmp_path, include("model://bad")))


def test_a_model_file_is_a_world(tmp_path):
    model_in(tmp_path, post("<pose>1 2 0 0 0 0</pose>"))
    assert places(tmp_path / "model.sdf") == [(1, 2)]


def test_two_hyphens_in_a_comment_are_accepted(tmp_path):
    odd = "<!-- gz topic -t /x --json\n -- -->"
    kept = f"<link name='n'><![CDATA[<!-- kept -->]]></link>{odd}"
    assert len(places(world(tmp_path, odd, post(kept)))) == 1
    late = tmp_path / "late.world"
    late.write_text(" <!-- -- -->\n" + world(tmp_path, post()).read_text())
    assert len(places(late)) == 1
    bad = world(tmp_path, odd, "<b></a>")
    with pytest.raises(InputError, match=rf"made.world:{len(bad.read_text().splitlines())}: not XML"):
        import_sdf(bad)


def test_robots_in_a_world_are_left_out_and_named(tmp_path):
    drive = "<plugin filename='gz-sim-diff-drive-system' name='gz::sim::systems::DiffDrive'/>"
    (tmp_path / "bot.urdf").write_text("<robot name='r'/>")
    path = world(tmp_path, cylinder(), post(f"<pose>1 2 0 0 0 0</pose>{drive}", "courier"), include("bot.urdf"))
    task = import_sdf(path)
    assert task.world.obstacles == (Disc(0, 0, 0.5, 0.5),)
    assert "left out: robot courier at (1.00, 2.00)" in task.world.source
    assert "left out: robot bot.urdf" in task.world.source


def actor(*waypoints, loop="true", more=""):
    points = "".join(f"<waypoint><time>{t}</time><pose>{x} {y} 1 0 0 0</pose></waypoint>" for t, x, y in waypoints)
    return f"<actor name='a'><script><loop>{loop}</loop>{more}<trajectory id='0'>{points}</trajectory></script></actor>"


def test_actors_with_a_trajectory_are_movers(tmp_path):
    walk = ((0, 3, 3), (2, 4, 3), (5, 4, 4))
    made = import_sdf(
        world(tmp_path, cylinder(), actor(*walk), actor((1, 5, 5)), actor(*walk, loop="0"), actor())
    ).world
    first, standing, once = made.movers
    assert (first.keyframes, first.loop, first.radius) == (walk, "teleport", 0.3)
    assert [(x, y) for _, x, y in standing.keyframes] == [(5, 5), (5, 5)]
    assert once.loop == "once"
    assert "actors as movers of radius 0.3 m, in straight lines: 3" in made.source
    assert "actors without a trajectory, left out: 1" in made.source


def test_trajectories_follow_each_other_after_a_delay(tmp_path):
    second = "<trajectory id='1'><waypoint><time>1</time><pose>2 0 0 0 0 0</pose></waypoint></trajectory>"
    text = actor((0, 0, 0), (2, 1, 0), more="<delay_start>3</delay_start>").replace("</script>", f"{second}</script>")
    (mover,) = import_sdf(world(tmp_path, cylinder(pose="5 5 0.5 0 0 0"), text)).world.movers
    assert mover.keyframes == ((3, 0, 0), (5, 1, 0), (6, 2, 0))


def test_poses_of_collisions_are_relative_to_their_link_or_to_a_named_frame(tmp_path):
    def collision(attribute):
        return f"<collision name='c{attribute}'><pose {attribute}>1 0 0.5 0 0 0</pose>{POST}</collision>"

    parts = "<link name='a'><pose>0 3 0 0 0 0</pose></link><frame name='f'><pose>5 0 0 0 0 0</pose></frame>"
    link = f"<link name='l'><pose>0 1 0 0 0 0</pose>{collision('')}"
    named = "".join(collision(f'relative_to="{name}"') for name in ("a", "f", "l", "__model__"))
    model = f"<model name='m'><pose>10 0 0 0 0 0</pose>{parts}{link}{named}</link></model>"
    assert places(world(tmp_path, model)) == [(11, 1), (11, 3), (16, 0), (11, 1), (11, 0)]


def test_one_of_several_worlds_is_not_taken_in_silence(tmp_path):
    path = world(tmp_path, cylinder())
    path.write_text(path.read_text().replace("</sdf>", "<world name='second'/></sdf>"))
    with pytest.raises(InputError, match=r"has 2 worlds \(default, second\); leave one in it"):
        import_sdf(path)


def test_the_usual_bounds_enclose_the_ways_of_actors(tmp_path):
    bounds = import_sdf(world(tmp_path, cylinder(), actor((0, 3, 3), (2, 3, 9)))).world.bounds
    assert bounds == pytest.approx((-1.5, -1.5, 4.3, 10.3))
