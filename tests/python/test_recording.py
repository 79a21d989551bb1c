"""Recordings as other programs read them: the plain `mcap` reader, and ROS 2 messages by the schemas inside."""

from __future__ import annotations

import csv
import json
import math
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory

from conftest import program

ROOT = Path(__file__).resolve().parents[2]
ARM = ROOT / "cells" / "irb120"
ARM_ARGS = ["--robot", str(ARM / "robot.toml"), "--cell", str(ARM / "cell.toml")]
TOUCHES = 9


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with run.mcap, measured on a virtual cell through the real drivers, and run.csv from it."""
    d = tmp_path_factory.mktemp("recording")

    def run(*args: str) -> None:
        subprocess.run([program(), *args], cwd=d, check=True, capture_output=True)

    run("plan", *ARM_ARGS, "--per-ball", str(TOUCHES // 3), "--out", "plan.csv")
    cell = subprocess.Popen(
        [program(), "virtual-cell", *ARM_ARGS, "--port", "0"],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    assert cell.stdout is not None
    try:
        _, gauge, _, controller, _ = cell.stdout.readline().split("'")
        links = ["--gauge", gauge, "--controller", controller]
        run("measure", *ARM_ARGS, "--plan", "plan.csv", *links, "--out", "run.mcap", "--go")
    finally:
        cell.kill()
        cell.stdout.close()
        cell.wait()
    run("convert", "run.mcap", "run.csv")
    yield d


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as f:
        return list(csv.DictReader(f))


def test_the_file_is_indexed_and_says_what_it_holds(folder: Path) -> None:
    with (folder / "run.mcap").open("rb") as f:
        reader = make_reader(f, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        assert summary is not None and summary.statistics is not None
        topics = {c.topic: (c.message_encoding, summary.schemas.get(c.schema_id)) for c in summary.channels.values()}
        for topic, (encoding, schema_encoding) in {
            "/joint_states": ("cdr", "ros2msg"),
            "/robot_description": ("cdr", "ros2msg"),
            "/indicators": ("json", "jsonschema"),
            "/temperature": ("json", "jsonschema"),
            "/measurement": ("json", "jsonschema"),
        }.items():
            found, schema = topics[topic]
            assert (found, schema and schema.encoding) == (encoding, schema_encoding), topic
            if schema is not None and schema.encoding == "jsonschema":
                assert json.loads(schema.data)["title"] == schema.name
        assert {a.name for a in reader.iter_attachments()} == {"robot.toml", "cell.toml"}
        settings = {m.name: m.metadata for m in reader.iter_metadata()}
        assert settings["trical"]["epsilon_mm"] == "0.02"
        assert "version" in settings["trical"]


def test_joint_states_decode_and_times_go_on(folder: Path) -> None:
    with (folder / "run.mcap").open("rb") as f:
        reader = make_reader(f, decoder_factories=[DecoderFactory()])
        states = [(m.log_time, d) for _, _, m, d in reader.iter_decoded_messages(topics=["/joint_states"])]
        robot = [d.data for _, _, _, d in reader.iter_decoded_messages(topics=["/robot_description"])]
    assert len(states) > 5 * TOUCHES, "continuous while the robot moves"
    for time, state in states:
        assert list(state.name) == [f"joint_{k}" for k in range(1, 7)]
        assert len(state.position) == 6 and all(abs(q) < 2 * math.pi + 1 for q in state.position)
        assert (len(state.velocity), len(state.effort)) == (0, 0)
        assert state.header.frame_id == "base_link"
        assert state.header.stamp.sec * 10**9 + state.header.stamp.nanosec == time
    times = [t for t, _ in states]
    assert times == sorted(times) and times[0] > 1_700_000_000 * 10**9, "the date is in it"
    assert len(robot) == 1 and robot[0].startswith("<?xml") and "<robot" in robot[0]


def test_measurements_are_the_rows_of_the_csv_and_the_arm_stands_where_they_say(folder: Path) -> None:
    with (folder / "run.mcap").open("rb") as f:
        reader = make_reader(f, decoder_factories=[DecoderFactory()])
        # a measurement is logged when it is accepted, and published when it was made
        measured = [(m.publish_time, json.loads(m.data)) for _, _, m in reader.iter_messages(topics=["/measurement"])]
        states = [(m.publish_time, d) for _, _, m, d in reader.iter_decoded_messages(topics=["/joint_states"])]
    rows = rows_of(folder / "run.csv")
    assert len(measured) == len(rows) == TOUCHES
    for (time, message), row in zip(measured, rows, strict=True):
        filled = {k: float(v) for k, v in row.items() if v != ""}
        assert filled == pytest.approx({k: float(v) for k, v in message.items()}, abs=1e-9)
        last = max((s for s in states if s[0] <= time), key=lambda s: s[0])[1]
        joints = [math.degrees(q) for q in last.position]
        assert joints == pytest.approx([message[f"q{k}_deg"] for k in range(1, 7)], abs=1e-6)


def test_csv_to_mcap_and_back_loses_nothing(folder: Path) -> None:
    for args in (["run.csv", "again.mcap"], ["again.mcap", "again.csv"]):
        subprocess.run([program(), "convert", *args], cwd=folder, check=True, capture_output=True)
    assert (folder / "run.csv").read_bytes() == (folder / "again.csv").read_bytes()


def test_a_cut_file_gives_others_and_us_the_same_measurements(folder: Path) -> None:
    whole = (folder / "run.mcap").read_bytes()
    for part in (0.3, 0.55, 0.8):
        cut = folder / f"cut{part}.mcap"
        cut.write_bytes(whole[: int(part * len(whole))])
        topics: dict[int, str] = {}
        seen = 0
        try:
            with cut.open("rb") as f:
                for record in StreamReader(f, emit_chunks=False).records:
                    if type(record).__name__ == "Channel":
                        topics[record.id] = record.topic
                    elif type(record).__name__ == "Message" and topics[record.channel_id] == "/measurement":
                        seen += 1
        except Exception as e:  # the reader of others ends with whatever error a cut file gives it
            assert seen or part < 0.5, e
        done = subprocess.run(
            [program(), "convert", cut.name, f"cut{part}.csv"], cwd=folder, check=True, capture_output=True, text=True
        )
        assert "damaged or incomplete" in done.stderr
        ours = len(rows_of(folder / f"cut{part}.csv"))
        assert seen <= ours < TOUCHES, (part, seen, ours)
