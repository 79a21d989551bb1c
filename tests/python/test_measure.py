"""Measuring from Python, on a virtual cell: plans driven, stopped, taken up; gauges, controllers, setting up a cell."""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import trical
from threads import ticks_during

ARM = Path(__file__).resolve().parents[2] / "cells" / "irb120"
FILES: Any = {"robot": ARM / "robot.toml", "cell": ARM / "cell.toml"}


@pytest.fixture(scope="module")
def plan() -> trical.Plan:
    return trical.plan(**FILES, per_ball=12, pool=40)


@pytest.fixture
def cell() -> Iterator[trical.VirtualCell]:
    with trical.virtual_cell(**FILES, seed=3) as running:
        yield running


def test_a_receiver_answers_on_a_port_of_the_network() -> None:
    with trical.virtual_cell(**FILES, seed=3, gauge_port=0) as cell:
        assert cell.gauge.startswith("uwave://127.0.0.1:")
        with trical.Gauge(cell.gauge) as gauge:
            assert gauge.read().shape == (3,)
    with pytest.raises(trical.TricalError, match="gauge_port is 70000, expected 0 to 65535"):
        trical.virtual_cell(**FILES, gauge_port=70000)


def links(cell: trical.VirtualCell) -> dict[str, str]:
    return {"gauge": cell.gauge, "controller": cell.controller}


def test_a_plan_is_driven_and_the_hidden_arm_found(plan: trical.Plan, cell: trical.VirtualCell, tmp_path: Path) -> None:
    said: list[tuple[float, str]] = []
    run = trical.measure(
        plan,
        tmp_path / "run.mcap",
        **FILES,
        **links(cell),
        go=True,
        temperature=21.0,
        payload=0.0,
        progress=lambda f, what: said.append((f, what)),
    )
    assert (run.measured, run.skipped, run.steps) == (len(plan), 0, [])
    assert run.path == str(tmp_path / "run.mcap") and f"{len(plan)} touches" in repr(run)
    touches = run.recording
    assert touches.kind.tolist() == ["touch"] * len(plan) and touches.ball.tolist() == plan.ball.tolist()
    assert np.linalg.norm(touches.indicators, axis=1).max() < 2e-5
    assert set(touches.payload.tolist()) == {0.0} and touches.temperature.min() > 21.5, "the controller's own sensor"
    assert said[-1][0] == 1.0 and any("reading" in what and "ball 2" in what for _, what in said)

    fit = trical.identify(touches, **FILES)
    q = trical.poses(50, **FILES, sphere=[0.15, 0.1, 0.1, 0.2], seed=5)
    off = [
        np.linalg.norm(model.forward(q)[0] - cell.truth.forward(q)[0], axis=1).mean()
        for model in (trical.Model.nominal(**FILES), fit.model)
    ]
    assert off[0] > 0.5e-3 and off[1] < 0.05e-3, off


def test_without_go_nothing_moves(plan: trical.Plan, cell: trical.VirtualCell, tmp_path: Path) -> None:
    plan.save(tmp_path / "plan.csv")
    run = trical.measure(tmp_path / "plan.csv", tmp_path / "run.mcap", **FILES, **links(cell))
    assert cell.motions == 0 and not (tmp_path / "run.mcap").exists()
    assert run.measured == 0 and len(run.steps) >= len(plan) and "nothing has moved" in repr(run)
    with pytest.raises(trical.TricalError, match="go=True"):
        _ = run.recording
    # a device that is not there yet is a warning, a URL that nobody could use is not
    away = trical.measure(plan, tmp_path / "r.mcap", **FILES, gauge="uwave:///dev/nowhere", controller=cell.controller)
    assert any("/dev/nowhere" in w for w in away.warnings) and "note: " in repr(away)
    with pytest.raises(trical.TricalError, match="known are uwave"):
        trical.measure(plan, tmp_path / "r.mcap", **FILES, gauge="ruler:///dev/x", controller=cell.controller)


def test_a_recording_of_measurements_is_an_mcap(plan: trical.Plan, cell: trical.VirtualCell, tmp_path: Path) -> None:
    with pytest.raises(trical.TricalError, match=r"run\.csv, expected a name that ends in \.mcap"):
        trical.measure(plan, tmp_path / "run.csv", **FILES, **links(cell), go=True)
    assert not (tmp_path / "run.csv").exists()


class EnoughError(Exception):
    pass


def test_what_progress_raises_ends_a_run_in_order_and_resume_goes_on(
    plan: trical.Plan, cell: trical.VirtualCell, tmp_path: Path
) -> None:
    out = tmp_path / "run.mcap"

    def stop(fraction: float, what: str) -> None:
        if fraction > 0.2:
            raise EnoughError

    with pytest.raises(EnoughError) as raised:
        trical.measure(plan, out, **FILES, **links(cell), go=True, progress=stop)
    cause = raised.value.__cause__
    # the run may have ended a touch before it heard
    assert cause is None or (isinstance(cause, trical.MeasuringError) and "stopped by the user" in str(cause))
    part = trical.Recording.load(out)
    assert 0 < len(part) < len(plan), "the recording is whole, and not all was measured"
    with pytest.raises(trical.RecordingError, match="exists already"):
        trical.measure(plan, out, **FILES, **links(cell), go=True)
    rest = trical.measure(plan, out, **FILES, **links(cell), go=True, resume=True)
    assert rest.skipped == len(part) and rest.measured == len(plan) - len(part)
    assert "had been done before" in repr(rest)
    assert sorted(rest.recording.pose.tolist()) == list(range(len(plan)))


MEASURE = """
import signal, sys, traceback, trical
signal.signal(signal.SIGINT, signal.default_int_handler)  # which a shell's background job ignores, and its children
files = {"robot": sys.argv[1], "cell": sys.argv[2]}
with trical.virtual_cell(**files, pace=0.05) as cell:
    try:
        trical.measure(sys.argv[3], sys.argv[4], **files, gauge=cell.gauge, controller=cell.controller, go=True,
                       progress=lambda fraction, what: print(fraction, what, flush=True))
    except KeyboardInterrupt as e:
        at = cell.motions
        print("interrupted:", e.__cause__, flush=True)
        assert cell.motions == at, "the arm stands"
"""


def test_ctrl_c_brings_the_arm_back_and_leaves_the_recording_whole(plan: trical.Plan, tmp_path: Path) -> None:
    plan.save(tmp_path / "plan.csv")
    out = tmp_path / "run.mcap"
    child = subprocess.Popen(
        [sys.executable, "-c", MEASURE, FILES["robot"], FILES["cell"], tmp_path / "plan.csv", out],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert child.stdout is not None and child.stderr is not None
    try:
        while True:
            line = child.stdout.readline()
            assert line, child.stderr.read()
            if "touch 4 of" in line and "reading" in line:
                break
        os.kill(child.pid, signal.SIGINT)
        said, problems = child.communicate(timeout=60)
        assert child.returncode == 0, problems
        last = said.splitlines()[-1]
        assert last.startswith("interrupted: touch "), said
        # between two touches it has not left its place
        ends = (
            "stopped by the user; the arm went back the way it came",
            "stopped by the user; the arm had not left its place",
            "in the middle of a motion; the arm stands where it was stopped",
        )
        assert last.endswith(ends), said
    finally:
        child.kill()
    assert 3 <= len(trical.Recording.load(out)) < len(plan)


SLOW = """
import signal, sys, threading, time, trical
signal.signal(signal.SIGINT, signal.default_int_handler)
files = {"robot": sys.argv[1], "cell": sys.argv[2]}
with trical.virtual_cell(**files, pace=1.0) as cell:
    try:
        if sys.argv[4] == "jog":
            with trical.Controller(cell.controller) as robot:
                print("begins", flush=True)
                robot.jog(joint=1, by=0.08, speed=1e-3, go=True)
        else:
            print("begins", flush=True)
            trical.measure(sys.argv[3], sys.argv[4], **files, gauge=cell.gauge, controller=cell.controller, go=True,
                           travel_speed=0.02)
    except KeyboardInterrupt as e:
        print("interrupted:", e.__cause__, flush=True)
        with trical.Controller(cell.controller) as robot:
            at = robot.joints()
            time.sleep(0.3)
            assert abs(robot.joints() - at).max() == 0.0 and abs(at).max() > 0.0, at
"""


@pytest.mark.parametrize("what", ["run.mcap", "jog"])
def test_ctrl_c_stops_a_motion_under_way(plan: trical.Plan, tmp_path: Path, what: str) -> None:
    plan.save(tmp_path / "plan.csv")
    child = subprocess.Popen(
        [sys.executable, "-c", SLOW, FILES["robot"], FILES["cell"], tmp_path / "plan.csv", what],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
    )
    assert child.stdout is not None
    try:
        child.stdout.readline()
        time.sleep(1.0)
        begin = time.monotonic()
        os.kill(child.pid, signal.SIGINT)
        said, problems = child.communicate(timeout=30)
        # a motion that is not stopped takes half a minute
        assert child.returncode == 0 and time.monotonic() - begin < 10, problems
        assert "stopped by the user in the middle of a motion" in said
    finally:
        child.kill()


def test_other_threads_run_while_the_arm_moves(plan: trical.Plan, tmp_path: Path) -> None:
    with trical.virtual_cell(**FILES, pace=0.002) as cell:
        ticks = ticks_during(lambda: trical.measure(plan, tmp_path / "run.mcap", **FILES, **links(cell), go=True))
    assert ticks > 5


def test_a_run_that_fails_says_what_and_where_the_arm_is(plan: trical.Plan, tmp_path: Path) -> None:
    script = tmp_path / "faults.toml"
    script.write_text('[[fault]]\nwhat = "stale"\naxis = "y"\nafter_motions = 30\n')
    out = tmp_path / "run.mcap"
    with trical.virtual_cell(**FILES, faults=script) as cell:
        with pytest.raises(trical.MeasuringError, match=r"indicator y .*measured is safe, resume=True goes on"):
            trical.measure(plan, out, **FILES, **links(cell), go=True)
    part = len(trical.Recording.load(out))
    assert 0 < part < len(plan)
    with trical.virtual_cell(**FILES) as cell:
        assert trical.measure(plan, out, **FILES, **links(cell), go=True, resume=True).skipped == part
    with pytest.raises(trical.DeviceError, match=r"cannot be opened|cannot connect"):
        trical.measure(plan, tmp_path / "r.mcap", **FILES, **links(cell), go=True)
    assert not (tmp_path / "r.mcap").exists()


def test_repeat_visits(cell: trical.VirtualCell, tmp_path: Path) -> None:
    few = trical.plan(**FILES, per_ball=4, pool=20)
    run = trical.measure(few, tmp_path / "run.mcap", **FILES, **links(cell), go=True, visits=3)
    assert run.measured == 3 * len(few)
    told = trical.repeatability(run.path, **FILES)
    assert trical.repeatability(run.path) == told, "arm and cell are in the file"
    assert all(b["visits"] == 3 * b["places"] for b in told["by_ball"]), told["by_ball"]


def test_a_virtual_cell_ends_with_its_block() -> None:
    with trical.virtual_cell(**FILES, hide="lost_motion_direction@2*3", start=[0, 0.1, 0, 0, 0.2, 0]) as cell:
        assert cell.running and cell.gauge.startswith("uwave://") and cell.gauge in repr(cell)
        assert np.allclose(cell.q, [0, 0.1, 0, 0, 0.2, 0])
        position, rotation = cell.tool
        assert np.allclose(rotation @ rotation.T, np.eye(3))
        known = trical.Model.nominal(**FILES).forward(cell.q)[0]
        assert 0 < np.linalg.norm(position - known) < 0.02
        assert "lost_motion_direction" in cell.truth.to_toml()
        with pytest.raises(TypeError, match="pickle"):
            pickle.dumps(cell)
    assert not cell.running and "stopped" in repr(cell)
    cell.stop()
    with pytest.raises(trical.TricalError, match="was stopped"):
        _ = cell.q
    with pytest.raises(trical.DeviceError, match="cannot connect"):
        trical.Controller(cell.controller)
    # the same seed is the same arm, and what is true can be given
    with trical.virtual_cell(**FILES, truth=cell.truth) as again:
        assert again.truth.to_toml() == cell.truth.to_toml()


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"hide": "backlash"}, "hide: backlash: no such effect; known are"),
        (
            {"hide": ["lost_motion_direction@9"]},
            "hide: .*expected EFFECT@SITE; this arm can have lost_motion_direction at",
        ),
        ({"port": 70000}, "port is 70000, expected 0 to 65535"),
        ({"pace": -1}, "pace is -1, expected 0 to 100"),
        ({"unsettled": [0.1, 0.1]}, "unsettled has 2 numbers, expected 3"),
        ({"start": [0, 0]}, "q has the shape"),
        ({"faults": "nowhere.toml"}, "nowhere.toml: cannot be read"),
    ],
)
def test_a_virtual_cell_says_what_is_wrong(wrong: dict[str, Any], said: str) -> None:
    with pytest.raises(trical.TricalError, match=said):
        trical.virtual_cell(**FILES, **wrong)


def test_a_port_that_is_taken(cell: trical.VirtualCell) -> None:
    port = int(cell.controller.split("?")[0].rsplit(":", 1)[1])
    with pytest.raises(trical.DeviceError, match="in use by another program"):
        trical.virtual_cell(**FILES, port=port)


def test_a_gauge_is_read_tested_and_mastered(cell: trical.VirtualCell) -> None:
    with trical.Gauge(cell.gauge) as gauge:
        assert "uwave" in gauge.name and gauge.url == cell.gauge and gauge.name in repr(gauge)
        assert gauge.read().shape == (3,) and np.allclose(gauge.settled(), gauge.read())
        watched = list(gauge.watch(count=3, every=0.0))
        assert [r.shape for _, r in watched] == [(3,)] * 3 and watched[0][0] <= watched[2][0]
        test = gauge.test(count=5)
        assert test.readings.shape == (5, 3) and [a["axis"] for a in test.axes] == ["x", "y", "z"]
        assert test.seconds_each > 0 and "5 readings" in repr(test) and "<table>" in test._repr_html_()
        assert pickle.loads(pickle.dumps(test)).axes == test.axes
        assert gauge.warnings() == []
        with pytest.raises(trical.DeviceError, match="axis x did not move"):
            gauge.wait_for_stem("x", timeout=0.05)
        with pytest.raises(trical.TricalError, match="axis is 'w'"):
            gauge.wait_for_stem("w")
        with pytest.raises(trical.TricalError, match="count is 1, expected 2"):
            gauge.test(count=1)
    assert gauge.closed and "closed" in repr(gauge)
    with pytest.raises(trical.TricalError, match="this gauge is closed"):
        gauge.read()
    url = trical.master(cell.gauge)
    assert "zero_mm=" in url and trical.master(url).count("zero_mm=") == 1
    with trical.Gauge(url) as gauge:
        assert np.abs(gauge.settled()).max() < 1e-6


def test_ports_and_urls_that_are_none() -> None:
    assert all(set(port) == {"port", "device", "url"} for port in trical.gauges())
    with pytest.raises(trical.DeviceError, match="/dev/nowhere: cannot be opened"):
        trical.Gauge("uwave:///dev/nowhere?x=00&y=01&z=02")
    with pytest.raises(trical.TricalError, match="unknown gauge"):
        trical.Gauge("ruler:///dev/x")
    with pytest.raises(trical.TricalError, match="known are rapid"):
        trical.Controller("robot://here")


def test_a_controller_answers_and_jogs(cell: trical.VirtualCell) -> None:
    with trical.Controller(cell.controller) as robot:
        answer = robot.ping()
        assert answer["answers_in"] < 1 and answer["temperature"] > 20
        assert robot.dof == 6 and "6 joints" in repr(robot)
        assert np.allclose(robot.joints(), 0)
        assert np.allclose(robot.jog(joint=2, by=0.05), [0, 0.05, 0, 0, 0, 0]) and cell.motions == 0
        assert np.allclose(robot.jog(joint=2, by=0.05, go=True), [0, 0.05, 0, 0, 0, 0], atol=1e-4)
        assert np.allclose(robot.jog(to=[0.01, 0.05, 0, 0, 0, 0], go=True, robot=FILES["robot"])[0], 0.01, atol=1e-4)
        before = cell.tool[0]
        robot.jog(tool=[0, 0, -0.002], go=True)
        assert abs(np.linalg.norm(cell.tool[0] - before) - 2e-3) < 1e-4
        moved = cell.motions
        for keywords, said in [
            ({"joint": 2, "by": 0.5}, r"joint 2 would go 28.648 deg, the limit is 5 deg \(max_angle\)"),
            ({"joint": 7, "by": 0.01}, "joint: found joint 7, expected 1 to 6"),
            ({"joint": 2}, "joint and by together"),
            ({"to": [0, 0]}, "to: found 2 numbers, expected 6"),
            ({"tool": [0, 0, 0.009]}, "5 mm at most"),
            ({"tool": [0, 0]}, "tool has 2 numbers"),
            ({"joint": 2, "by": 3.0, "max_angle": 4.0, "robot": FILES["robot"]}, "outside its limits"),
            ({"joint": 2, "by": 0.01, "speed": 0.5}, "up to 250"),
            ({}, "expected one of joint"),
            ({"joint": 1, "by": 0.01, "to": [0] * 6}, "expected one of joint"),
        ]:
            with pytest.raises(trical.TricalError, match=said):
                robot.jog(**keywords, go=True)
        assert cell.motions == moved
    with pytest.raises(trical.TricalError, match="this controller is closed"):
        robot.joints()


def turned(rotation: np.ndarray, x: float, y: float) -> np.ndarray:
    cx, sx, cy, sy = np.cos(x), np.sin(x), np.cos(y), np.sin(y)
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    return rotation @ about_x @ np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])


def test_tool_point_and_base_are_found_by_touches_where_the_arm_stands(
    plan: trical.Plan, cell: trical.VirtualCell, tmp_path: Path
) -> None:
    out, nominal = tmp_path / "setup.mcap", trical.Model.nominal(**FILES)
    first = plan.q[plan.ball == 1][0]
    orientation = nominal.forward(first)[1]
    links_and_files: Any = {**FILES, **links(cell)}

    def touch(ball: int, x: float, y: float) -> trical.Recording:
        """A person brings the device over the ball by hand, roughly."""
        place = trical.Cell.load(FILES["cell"]).balls[ball - 1] + [3e-4, 0, -2e-4]
        q = nominal.inverse(place, turned(orientation, x, y), near=first)
        with trical.Controller(cell.controller) as robot:
            robot.jog(to=q, max_angle=7.0, speed=0.2, go=True)
        return trical.touch_here(ball, out, **links_and_files, go=True)

    a = np.radians(25)
    four = [touch(1, x, y) for x, y in [(0, 0), (a, 0), (-a, 0), (0, a)]]
    assert all(np.linalg.norm(r.indicators) < 2e-5 and r.ball.tolist() == [1] for r in four)
    touches = trical.Recording.load(out)
    assert touches.pose.tolist() == [0, 1, 2, 3]
    tool = trical.find_tool_point(touches, robot=FILES["robot"], cell=FILES["cell"])
    true = cell.truth.nominal_cell.tcp
    assert np.allclose(tool.before, true) and np.linalg.norm(tool.tcp - true) < 3e-3 and tool.rms < 1e-3
    assert np.allclose(tool.cell.tcp, tool.tcp) and pickle.loads(pickle.dumps(tool)).rms == tool.rms

    for ball in (2, 3):
        touch(ball, 0, 0)
    # the last touch of ball 1 leans; touched again as the others
    touch(1, 0, 0)
    base = trical.find_base(out, robot=FILES["robot"], cell=FILES["cell"])
    assert [d["balls"] for d in base.distances] == [(1, 2), (1, 3), (2, 3)]
    assert all(abs(d["touched"] - d["cell"]) < 2e-3 for d in base.distances)
    assert np.linalg.norm(base.cell.base[0] - trical.Cell.load(FILES["cell"]).base[0]) < 5e-3

    both = trical.Recording.load(out)
    for call, recording, said in [
        (trical.find_tool_point, both, "expected touches of one ball"),
        (trical.find_tool_point, touches[:3], "3 touches of the ball; expected four or more"),
        (trical.find_base, touches, "ball 2 was not touched"),
    ]:
        with pytest.raises(trical.TricalError, match=said):
            call(recording, robot=FILES["robot"], cell=FILES["cell"])
    with pytest.raises(trical.TricalError, match="go=True is required"):
        trical.touch_here(1, out, **links_and_files)
    with pytest.raises(trical.TricalError, match="ball is 4, expected 1 to 3"):
        trical.touch_here(4, out, **links_and_files, go=True)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"epsilon": 0.0}, "epsilon is 0 m, expected more than 0"),
        ({"visits": 0}, "visits is 0, expected 1 to 1000"),
        ({"visits": -1}, "visits is -1"),
        ({"stroke": [1e-3, -1e-3]}, "the lower first"),
        ({"stroke": [1e-3]}, "stroke has 1 numbers"),
    ],
)
def test_settings_that_make_no_sense(
    plan: trical.Plan, cell: trical.VirtualCell, tmp_path: Path, wrong: dict[str, Any], said: str
) -> None:
    with pytest.raises(trical.TricalError, match=said):
        trical.measure(plan, tmp_path / "run.mcap", **FILES, **links(cell), go=True, **wrong)
    assert cell.motions == 0 and not (tmp_path / "run.mcap").exists()


def test_plans_that_are_none_and_results_that_travel(
    plan: trical.Plan, cell: trical.VirtualCell, tmp_path: Path
) -> None:
    with pytest.raises(trical.TricalError, match=r"nowhere\.csv"):
        trical.measure(tmp_path / "nowhere.csv", tmp_path / "run.mcap", **FILES, **links(cell))
    with pytest.raises(trical.TricalError, match="away does not exist"):
        trical.measure(plan, tmp_path / "away" / "run.mcap", **FILES, **links(cell))
    (tmp_path / "plan.csv").write_text("order,ball\n0,1\n")
    with pytest.raises(trical.TricalError, match=r"plan.csv"):
        trical.measure(tmp_path / "plan.csv", tmp_path / "run.mcap", **FILES, **links(cell))
    run = trical.measure(plan, tmp_path / "run.mcap", **FILES, **links(cell))
    again = pickle.loads(pickle.dumps(run))
    assert again == run and "<table>" in run._repr_html_()
