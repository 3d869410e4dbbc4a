"""Maps of ROS's map_server: pixels, order of rows and invalid files."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from antdrive.base import InputError
from antdrive.worlds import export_map_server, import_file, import_map_server, load_task, save_task
from antdrive.worlds.formats.map_server import read_map

GOOD = """\
image: made.pgm
resolution: 0.5
origin: [-1.0, 2.0, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
name: keys of other tools are ignored
"""
#: Two rows: free, unknown, occupied above; all free below.
PGM = b"P5\n# by hand\n3 2\n255\n" + bytes([254, 205, 0, 254, 254, 254])


def written(folder, text=GOOD, image=PGM):
    if image is not None:
        (folder / "made.pgm").write_bytes(image)
    path = folder / "made.yaml"
    path.write_text(text)
    return path


def rows_of(path, **options):
    """1 where a cell is free, from the lowest row."""
    return read_map(path, **options).cells.free.astype(int).tolist()


def test_the_images_last_row_is_the_lowest_and_unknown_cells_block(tmp_path):
    served = read_map(written(tmp_path))
    assert served.cells.free.astype(int).tolist() == [[1, 1, 1], [1, 0, 0]]
    assert served.unknown == 1
    assert (served.cells.resolution, served.cells.origin, served.cells.bounds) == (
        0.5,
        (-1.0, 2.0),
        (-1.0, 2.0, 0.5, 3.0),
    )
    assert rows_of(written(tmp_path), unknown_is_free=True) == [[1, 1, 1], [1, 1, 0]]


@given(st.integers(1, 6), st.integers(1, 6), st.data())
@settings(max_examples=40)
def test_cell_r_c_is_the_pixel_r_rows_from_below(tmp_path_factory, rows, cols, data):
    folder = tmp_path_factory.mktemp("flip")
    level = data.draw(
        st.lists(st.lists(st.integers(0, 255), min_size=cols, max_size=cols), min_size=rows, max_size=rows)
    )
    plain = f"P2\n{cols} {rows}\n255\n" + "\n".join(" ".join(map(str, row)) for row in level) + "\n"
    free = read_map(written(folder, image=plain.encode())).cells.free
    for r in range(rows):
        for c in range(cols):
            assert free[r, c] == ((255 - level[rows - 1 - r][c]) / 255 < 0.196)


def strip(*levels):
    return b"P5 %d 1 255\n" % len(levels) + bytes(levels)


def test_thresholds_are_compared_strictly_as_map_server_does(tmp_path):
    # (255 - 204) / 255 is 0.2 to the last bit, (255 - 51) / 255 is 0.8.
    text = GOOD.replace("0.196", "0.2").replace("0.65", "0.8")
    path = written(tmp_path, text, strip(205, 204, 51, 50))
    assert rows_of(path) == [[1, 0, 0, 0]]
    assert rows_of(path, unknown_is_free=True) == [[1, 1, 1, 0]]


def test_negate_turns_black_and_white_around(tmp_path):
    for word in ("1", "true"):
        path = written(tmp_path, GOOD.replace("negate: 0", f"negate: {word}"), strip(0, 49, 50, 255))
        assert rows_of(path) == [[1, 1, 0, 0]]


def test_raw_shades_are_percent_and_never_negated(tmp_path):
    for negate in "01":
        text = GOOD.replace("negate: 0", f"negate: {negate}") + "mode: raw\n"
        path = written(tmp_path, text, strip(0, 19, 20, 65, 66, 100, 101, 255))
        assert rows_of(path) == [[1, 1, 0, 0, 0, 0, 0, 0]]
        assert rows_of(path, unknown_is_free=True) == [[1, 1, 1, 1, 0, 0, 1, 1]]
        assert read_map(path).unknown == 4


def test_transparent_pixels_are_unknown_in_scale_and_averaged_in_trinary(tmp_path):
    pixels = np.array([[[255, 255], [255, 254], [0, 255], [0, 0]]], dtype=np.uint8)
    Image.fromarray(pixels).save(tmp_path / "made.png")
    text = GOOD.replace("made.pgm", "made.png")
    scale = written(tmp_path, text + "mode: scale\n")
    assert rows_of(scale) == [[1, 0, 0, 0]]
    assert rows_of(scale, unknown_is_free=True) == [[1, 1, 0, 1]]
    assert rows_of(written(tmp_path, text)) == [[1, 1, 0, 0]]
    assert rows_of(written(tmp_path, text), unknown_is_free=True) == [[1, 1, 1, 0]]


def test_colours_are_averaged_and_other_depths_understood(tmp_path):
    path = written(tmp_path, image=b"P6 2 1 255\n" + bytes([255, 255, 255, 255, 255, 90]))
    assert rows_of(path) == [[1, 0]]
    assert rows_of(written(tmp_path, image=b"P2 3 1 65535\n65535 60000 0\n")) == [[1, 1, 0]]
    assert rows_of(written(tmp_path, image=b"P2 3 1 100\n100 90 0\n")) == [[1, 1, 0]]
    assert rows_of(written(tmp_path, image=b"P1 3 1\n0 1 0\n")) == [[1, 0, 1]]
    palette = Image.fromarray(np.array([[0, 1]], dtype=np.uint8)).convert("P")
    palette.putpalette([255, 255, 255, 9, 9, 9])
    palette.save(tmp_path / "made.png")
    assert rows_of(written(tmp_path, GOOD.replace("made.pgm", "made.png"))) == [[1, 0]]


def test_the_task_has_a_source_and_can_be_saved(tmp_path):
    task = import_map_server(written(tmp_path), start=(-0.7, 2.2, 0.0), goal=(0.2, 2.2))
    assert task.world.name == "made"
    assert task.world.source == (
        "the map_server map made.yaml with 1 unknown cells taken for blocked, 2 x 3 cells of 0.5 m; the 2 blocked cells next "
        "to free cells are fully covered by 2 cylinders that reach at most 0.1036 m beyond blocked cells"
    )
    assert task.cell == 0.5
    save_task(task, tmp_path / "kept.yaml")
    assert load_task(tmp_path / "kept.yaml") == task


def _without(key):
    return "".join(line for line in GOOD.splitlines(keepends=True) if not line.startswith(key))


#: Changes of the YAML that make it wrong, and images that are none.
CHANGES = {
    "image is a number": ("made.pgm", "7"), "image is a folder": ("made.pgm", "."), "resolution 0": ("0.5", "0.0"),
    "resolution text": ("0.5", "5e-2"), "resolution nan": ("0.5", ".nan"), "origin without yaw": (", 0.0]", "]"),
    "negate 2": ("negate: 0", "negate: 2"), "threshold 65": ("0.65", "65"), "threshold below 0": ("0.196", "-0.1"),
    "thresholds crossed": ("0.196", "0.7"), "mode": ("0.196", "0.196\nmode: binary"),
    "yaw nan": ("0.0]", "-nan]"), "image of another computer": ("made.pgm", "/home/someone/other.pgm"),
    "bad ends": ("0.196", "0.196\nantdrive: {start: [0.0, 0.0]}"),
}  # fmt: skip
IMAGES = {
    "no image": None, "no picture": b"hello", "wrong magic": PGM.replace(b"P5", b"P9"), "cut off": PGM[:-2],
    "pointer of Git LFS": b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n",
    "gif": b"GIF89a\x01\x00\x01\x00\x80\x00\x00", "cut off in plain": b"P2 3 2 255\n1 2 3",
    "cut off in the header": b"P5\n3", "no pixels": b"P5\n0 2\n255\n", "word for a pixel": b"P2 3 1 255\n1 x 3",
    "pixel too bright": b"P2 3 1 255\n1 600 3", "maxval": b"P5 3 1 0\n123", "huge": b"P5 9999 9999 255\n123",
    "a bomb": b"P5 99999 99999 255\n123", "float pixels": b"Pf\n1 1\n-1.0\n\0\0\0\0", "nothing free": strip(0, 0),
}  # fmt: skip
BAD = {
    **{
        f"no {key}": (_without(key), PGM)
        for key in ("resolution", "origin", "negate", "occupied_thresh", "free_thresh")
    },
    "empty": ("", PGM),
    "a list": ("- 1\n", PGM),
    "a world": ("schema: 1\nbounds: [0, 0, 1, 1]\n", PGM),
    **{name: (GOOD.replace(*change), PGM) for name, change in CHANGES.items()},
    **{name: (GOOD, image) for name, image in IMAGES.items()},
}


@pytest.mark.parametrize("thresh", ["0.196", "0.25"])
@pytest.mark.parametrize(("kind", "free"), [(None, [1, 0, 0]), ("blocked", [1, 0, 0]), ("free", [1, 1, 0])])
def test_shade_205_is_unknown_whatever_free_thresh_is(tmp_path, thresh, kind, free):
    path = written(tmp_path, GOOD.replace("0.196", thresh))
    (task,) = import_file(path, start=(-0.7, 2.2, 0.0), goal=(0.2, 2.2), unknown=kind)
    assert rows_of(path, unknown_is_free={"free": True, "blocked": False}.get(kind))[1] == free
    assert task.world.source.endswith(
        "; 1 cells (16.67%) of shade 205, map savers' unknown, are "
        f"{'free, for' if kind == 'free' else 'taken for unknown, though'} free_thresh 0.25 makes them free"
    ) == (thresh == "0.25")


def test_shade_205_is_one_of_many_in_a_picture_of_greys(tmp_path):
    text = GOOD.replace("0.196", "0.3")
    path = written(tmp_path, text, b"P5\n5 1\n255\n" + bytes([254, 205, 200, 210, 0]))
    assert rows_of(path) == rows_of(path, unknown_is_free=True) == [[1, 1, 1, 1, 0]]
    assert rows_of(path, unknown_is_free=False) == [[1, 0, 1, 1, 0]]
    assert read_map(path).remarks == (
        "1 cells (20.00%) of shade 205, map savers' unknown, are free, for free_thresh 0.3 makes them free",
    )


def test_a_saved_map_with_an_alpha_channel_keeps_its_unknown_cells(tmp_path):
    """map_server averages alpha in, so that 205 is 217.5, and p = 0.147."""
    Image.fromarray(np.array([[254, 205, 0]], dtype=np.uint8)).convert("LA").save(tmp_path / "made.png")
    assert rows_of(written(tmp_path, GOOD.replace("made.pgm", "made.png"))) == [[1, 0, 0]]


@pytest.mark.parametrize("image", ["/home/someone/made.pgm", "C:\\maps\\made.pgm", "../gone/made.pgm"])
def test_the_image_of_another_computer_is_the_file_of_that_name_beside_the_yaml(tmp_path, image):
    served = read_map(written(tmp_path, GOOD.replace("made.pgm", image)))
    assert served.cells.free.shape == (2, 3)
    assert served.remarks == (f"its image is made.pgm beside it, for there is no {image}",)


def test_an_end_on_an_unknown_cell_names_the_option(tmp_path):
    with pytest.raises(InputError, match=r"goal: \(-0\.2, 2\.7\) is on an unknown cell, .*--unknown free"):
        import_map_server(written(tmp_path), start=(-0.7, 2.2, 0.0), goal=(-0.2, 2.7))


def test_a_rotated_map_becomes_an_upright_world_with_a_frame(tmp_path):
    """The same picture, upright and rotated: same world, with start and goal rotated by complex numbers."""
    turn, corner = 0.4, complex(2.0, -3.0)
    for name, origin in (("upright", "[0.0, 0.0, 0.0]"), ("turned", "[2.0, -3.0, 0.4]")):
        Image.fromarray(np.full((8, 8), 254, dtype=np.uint8)).save(tmp_path / f"{name}.png")
        lines = f"image: {name}.png\nresolution: 0.5\norigin: {origin}\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n"
        (tmp_path / f"{name}.yaml").write_text(lines)
    upright = import_map_server(tmp_path / "upright.yaml", start=(1.0, 1.0, 0.1), goal=(3.0, 2.0))
    start, goal = (complex(*end) * np.exp(1j * turn) + corner for end in ((1.0, 1.0), (3.0, 2.0)))
    turned = import_map_server(
        tmp_path / "turned.yaml", start=(start.real, start.imag, 0.5), goal=(goal.real, goal.imag)
    )
    with pytest.raises(
        InputError,
        match=r"goal: \(20, 30\) is not on the map, which spans x 0\.442327 to 5\.684244 and y -3 to 2\.241917",
    ):
        import_map_server(tmp_path / "turned.yaml", start=(start.real, start.imag, 0.5), goal=(20.0, 30.0))
    assert turned.world.bounds == upright.world.bounds
    assert turned.start == pytest.approx(upright.start)
    assert turned.goal == pytest.approx(upright.goal)
    assert (turned.frame, upright.frame) == ((2.0, -3.0, 0.4), (0.0, 0.0, 0.0))
    export_map_server(turned, tmp_path / "again.yaml")
    again = import_map_server(tmp_path / "again.yaml")
    assert again.frame == pytest.approx(turned.frame)
    assert again.start == pytest.approx(turned.start)
    assert again.goal == pytest.approx(turned.goal)


@pytest.mark.parametrize("there", ["w.yaml", "w.pgm"])
def test_an_export_replaces_files_only_on_request(tmp_path, there):
    (tmp_path / there).write_text("mine")
    with pytest.raises(InputError, match=rf"{there}: exists; choose another file, or replace it with --force"):
        export_map_server(load_task("empty"), tmp_path / "w.yaml")
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [(there, "mine")]
    export_map_server(load_task("empty"), tmp_path / "w.yaml", replace=True)
    assert import_map_server(tmp_path / "w.yaml").goal == load_task("empty").goal


def test_an_imported_world_has_no_rounding_errors(tmp_path):
    """Three tenths of a metre are 0.30000000000000004 in steps of 0.1."""
    text = GOOD.replace("0.5", "0.1").replace("[-1.0, 2.0, 0.0]", "[0.0, 0.0, 0.0]")
    task = import_map_server(written(tmp_path, text), start=(0.05, 0.05, 0.0), goal=(0.25, 0.05))
    assert task.world.bounds == (0.0, 0.0, 0.3, 0.2)
    assert [(disc.x, disc.y) for disc in task.world.obstacles] == [(0.15, 0.15), (0.25, 0.15)]
