"""ROS 2 bags of others are recordings: joints and measurements matched by time, what is assumed said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType

import trical
from bags import write_bag

UR = ["elbow_joint", "shoulder_lift_joint", "shoulder_pan_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint"]
OF_UR = [2, 1, 0, 3, 4, 5]


@pytest.mark.parametrize(
    ("kind", "compression"),
    [
        ("PoseStamped", CompressionType.ZSTD),
        ("TransformStamped", CompressionType.LZ4),
        ("PointStamped", CompressionType.NONE),
    ],
)
def test_a_bag_says_what_was_seen_where_the_arm_stood(tmp_path: Path, kind: str, compression: CompressionType) -> None:
    rng = np.random.default_rng(1)
    q = rng.uniform(-1.5, 1.5, (12, 6))
    positions = rng.uniform(-1, 1, (12, 3))
    turns = rng.normal(size=(12, 4))
    turns /= np.linalg.norm(turns, axis=1)[:, None]
    # as the drivers publish them: by the alphabet
    write_bag(tmp_path / "run.mcap", q[:, OF_UR], positions, turns, UR, kind, compression)
    with pytest.warns(UserWarning) as said:
        r = trical.Recording.load(tmp_path / "run.mcap", joints=6)
    assert any("joints 1 to 6 are" in str(warning.message) for warning in said)
    assert len(r) == 12
    assert np.allclose(r.q, q, atol=1e-9)
    assert r.position is not None and np.allclose(r.position, positions, atol=1e-9)
    if kind != "PointStamped":
        assert r.orientation is not None and np.allclose(np.abs(np.sum(r.orientation * turns, axis=1)), 1, atol=1e-9)


def test_one_frame_of_a_tree_of_transforms_is_a_measurement(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    q, positions = rng.uniform(-1.5, 1.5, (8, 6)), rng.uniform(-1, 1, (8, 3))
    turns = np.tile([1.0, 0, 0, 0], (8, 1))
    write_bag(tmp_path / "run.mcap", q[:, OF_UR], positions, turns, UR, "TFMessage")
    with pytest.warns(UserWarning):
        r = trical.Recording.load(f"{tmp_path / 'run.mcap'}#/tf:probe", joints=6)
    assert len(r) == 8 and r.position is not None and np.allclose(r.position, positions, atol=1e-9)
    for asked in ("", "#/tf:nothing"):
        with pytest.raises(
            trical.TricalError, match=r"transforms of link_1, probe on /tf; .* as in run.mcap#/tf:probe"
        ):
            trical.Recording.load(f"{tmp_path / 'run.mcap'}{asked}", joints=6)


def test_a_bag_in_sqlite_says_how_it_is_converted(tmp_path: Path) -> None:
    (tmp_path / "run_0.db3").write_bytes(b"SQLite format 3\0")
    (tmp_path / "metadata.yaml").write_text("rosbag2_bagfile_information:\n")
    for path in (tmp_path, tmp_path / "metadata.yaml", tmp_path / "run_0.db3"):
        with pytest.raises(trical.TricalError, match=r"bag in sqlite3; expected MCAP: ros2 bag convert"):
            trical.Recording.load(path, joints=6)


def test_a_bag_of_an_arm_with_other_joints_is_refused(tmp_path: Path) -> None:
    q = np.zeros((2, 6))
    write_bag(tmp_path / "run.mcap", q, np.zeros((2, 3)), np.tile([1.0, 0, 0, 0], (2, 1)), [*UR[:5], "gripper"])
    with pytest.raises(trical.TricalError, match=r"robot has 7"):
        trical.Recording.load(tmp_path / "run.mcap", joints=7)
