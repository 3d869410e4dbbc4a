"""Bags: what opens them, and one line for what does not."""

import os
import shutil

import numpy as np
import pytest
from rosbags import rosbag2
from rosbags.typesys import Stores, get_typestore

from antdrive.base import bags
from antdrive.base.bags import Bag
from antdrive.base.errors import InputError
from tests.foreign.writing import START, stamped, write

POSES = np.zeros((3, 3))


@pytest.fixture
def bag(tmp_path):
    return write(tmp_path / "bag", stamped(START + np.arange(3.0), POSES))


def refused(path, *topics):
    with pytest.raises(InputError) as caught, Bag(path) as opened:
        list(opened.messages(*topics))
    assert len(str(caught.value).splitlines()) == 1
    assert str(path) in str(caught.value)
    return str(caught.value)


def test_a_folder_without_metadata_has_one_bag(bag):
    (bag / "metadata.yaml").unlink()
    with Bag(bag) as opened:
        assert opened.topics == {"/pose": "geometry_msgs/msg/PoseStamped"}
        assert [received for _, received, _ in opened.messages("/pose")] == [round((START + k) * 1e9) for k in range(3)]
        assert list(opened.messages()) == []
    shutil.copy(bag / "bag.mcap", bag / "other.mcap")
    assert "no metadata.yaml and 2 bags; make one: ros2 bag reindex" in refused(bag)


def test_a_bag_without_definitions_has_those_of_jazzy(tmp_path):
    store = get_typestore(Stores.ROS2_JAZZY)
    with rosbag2.Writer(tmp_path / "old", version=8, storage_plugin=rosbag2.StoragePlugin.SQLITE3) as writer:
        own = writer.add_connection("/text", "std_msgs/msg/String", typestore=store)
        writer.write(own, 5, store.serialize_cdr(store.types["std_msgs/msg/String"]("here"), "std_msgs/msg/String"))
        other = writer.add_connection("/own", "my_msgs/msg/Own", msgdef="uint8 x", rihs01="RIHS01_0")
        writer.write(other, 6, b"\0\1\0\0")
    with Bag(tmp_path / "old") as opened:
        assert [(topic, at, message.data) for topic, at, message in opened.messages("/text")] == [("/text", 5, "here")]
    assert "my_msgs/msg/Own" in refused(tmp_path / "old", "/own")


def test_a_definition_that_nobody_asks_for_may_be_wrong(tmp_path):
    from mcap_ros2.writer import Writer

    with (tmp_path / "log.mcap").open("wb") as file:
        writer = Writer(file)
        for topic, text in (("/good", "float64 x"), ("/bad", "float64 x")):
            schema = writer.register_msgdef(f"my_msgs/msg/{topic[1:].title()}", text)
            writer.write_message(topic, schema, {"x": 1.5}, log_time=1, publish_time=1)
        writer.finish()
    data = (tmp_path / "log.mcap").read_bytes()
    at = data.rindex(b"my_msgs/msg/Bad")
    end = data.index(b"float64 x", at)
    (tmp_path / "log.mcap").write_bytes(data[:end] + b"float64 !" + data[end + 9 :])
    with Bag(tmp_path / "log.mcap") as opened:
        assert [message.x for _, _, message in opened.messages("/good")] == [1.5]
    assert "not a readable bag" in refused(tmp_path / "log.mcap", "/bad")


def test_what_is_no_bag_is_one_line(tmp_path, bag, monkeypatch):
    assert "no topic /x; it has /pose" in refused(bag, "/x")
    assert "no such file" in refused(tmp_path / "none.mcap")
    assert "no metadata.yaml and 0 bags" in refused(tmp_path)
    (tmp_path / "text.mcap").write_text("here")
    assert "File magic is invalid" in refused(tmp_path / "text.mcap")
    (tmp_path / "lfs.mcap").write_text("version https://git-lfs.github.com/spec/v1\n")
    assert "Git LFS" in refused(tmp_path / "lfs.mcap")
    os.mkfifo(tmp_path / "pipe.mcap")
    assert "is a pipe" in refused(tmp_path / "pipe.mcap")
    monkeypatch.setattr(bags, "MAX_CHUNK", 100)
    assert "a chunk of more than 100 bytes" in refused(bag, "/pose")
    (bag / "metadata.yaml").write_text("rosbag2_bagfile_information: [")
    assert "not a readable bag" in refused(bag)
