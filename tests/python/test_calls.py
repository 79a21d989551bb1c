"""The long calls, from plan to diagnosis: what they find, show and say."""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import trical
from conftest import PROGRAM
from terms import link, lost_motion, term
from threads import ticks_during

ROOT = Path(__file__).resolve().parents[2]
ARM = ROOT / "cells" / "irb120"
FILES = {"robot": ARM / "robot.toml", "cell": ARM / "cell.toml"}

# the arm lags behind: the other sign would not be lost motion
TRUTH = lost_motion(2, 0.02) + term("a_2", "geometry", 0.7, "mm", link(2, "a"))


@pytest.fixture(scope="module")
def truth() -> trical.Model:
    return trical.Model.nominal(**FILES).with_terms(TRUTH)


@pytest.fixture(scope="module")
def plan() -> trical.Plan:
    return trical.plan(**FILES, per_ball=30, pool=60)


@pytest.fixture(scope="module")
def touches(truth: trical.Model, plan: trical.Plan) -> trical.Recording:
    return trical.simulate(truth, plan.q, ball=plan.ball, directions=plan.directions, noise=5e-6, seed=1)


@pytest.fixture(scope="module")
def fitted(touches: trical.Recording) -> trical.Identified:
    return trical.identify(touches, **FILES, folds=4, hold_out_last=25)


@pytest.fixture(scope="module")
def diagnosis(touches: trical.Recording) -> trical.Diagnosis:
    return trical.diagnose(touches, **FILES)


def test_a_plan_touches_the_balls_by_the_nominal_arm(plan: trical.Plan, tmp_path: Path) -> None:
    assert len(plan) == 90 and plan.q.shape == plan.approach.shape == plan.directions.shape == (90, 6)
    assert len(plan.via) == 90 and all(v.ndim == 2 and v.shape[1] == 6 for v in plan.via)
    balls = trical.Cell.load(FILES["cell"]).balls
    positions, _ = trical.Model.nominal(**FILES).forward(plan.q)
    np.testing.assert_allclose(positions, balls[plan.ball - 1], atol=1e-7)
    assert np.array_equal(np.sign(plan.q - plan.approach)[plan.directions != 0], plan.directions[plan.directions != 0])
    again = trical.plan(**FILES, per_ball=30, pool=60)
    assert again.text == plan.text
    plan.save(tmp_path / "plan.csv")
    if PROGRAM.is_file():
        args = ["--robot", FILES["robot"], "--cell", FILES["cell"], "--per-ball", "30", "--pool", "60"]
        subprocess.run([PROGRAM, "plan", *args, "--out", "p.csv"], cwd=tmp_path, check=True, capture_output=True)
        assert (tmp_path / "p.csv").read_bytes() == (tmp_path / "plan.csv").read_bytes()


def test_what_was_hidden_in_a_simulation_is_found(
    fitted: trical.Identified, diagnosis: trical.Diagnosis, truth: trical.Model
) -> None:
    a_2 = next(p for p in fitted.parameters if p["name"] == "a_2")
    assert abs(a_2["value"] - a_2["nominal"] - 0.7) < 6 * a_2["sd"] + 0.02
    first = diagnosis.findings[0]
    assert (first["effect"], first["site"]) == ("lost_motion_direction", {"joint": 2})
    assert first["coefficients"][0]["value"] == pytest.approx(0.02, rel=0.05)
    # the same by names that an editor completes
    assert (first.effect, str(first.site), first.site.joint) == ("lost_motion_direction", "joint 2", 2)
    assert (
        first.coefficients[0].unit == "deg"
        and first.evidence.holdout_rms_after_mm == diagnosis.findings[0]["evidence"]["holdout_rms_after_mm"]
    )
    with pytest.raises(AttributeError):
        first.effect = "another"  # type: ignore[misc]
    with pytest.raises(KeyError):
        first["effects"]
    elsewhere = trical.poses(100, **FILES, seed=9)
    senses = np.ones((100, 6))
    miss = [
        np.linalg.norm(
            m.forward(elsewhere, directions=senses)[0] - truth.forward(elsewhere, directions=senses)[0], axis=1
        )
        for m in (trical.Model.nominal(**FILES), fitted.model, diagnosis.model)
    ]
    # without the lost motion, what was fitted to touches goes wrong elsewhere
    assert miss[2].mean() < 0.2 * min(miss[0].mean(), miss[1].mean())


def test_touches_that_would_decide_are_planned(touches: trical.Recording, tmp_path: Path) -> None:
    found = trical.diagnose(touches, **FILES, next=12)
    assert found.next is not None and len(found.next) == 12 and found.next.q.shape == (12, 6)
    assert found.next.effect in [f["effect"] for f in found.findings] and len(found.next.explanations) >= 2
    assert found.next.separation >= found.next.random_separation > 0
    assert "standard deviations apart" in repr(found)
    found.next.save(tmp_path / "next.csv")
    assert (tmp_path / "next.csv").read_text().startswith("order,ball,q1_deg")
    again = pickle.loads(pickle.dumps(found))
    assert again.next is not None and again.next.text == found.next.text


def test_errors_one_by_one_are_those_of_the_summary(
    fitted: trical.Identified, diagnosis: trical.Diagnosis, touches: trical.Recording
) -> None:
    assert fitted.errors_mm is not None and fitted.errors_mm.shape == (90, 2)
    assert fitted.errors_mm.mean(axis=0) == pytest.approx([fitted.before["mean_mm"], fitted.errors["mean_mm"]])
    assert fitted.cross_validation is not None and fitted.forward_in_time is not None
    p = len(fitted.parameters)
    assert fitted.covariance.shape == (p, p)
    sd_m = next(q["sd"] for q in fitted.parameters if q["name"] == "a_2") * 1e-3
    k = [q["name"] for q in fitted.parameters].index("a_2")
    assert np.sqrt(fitted.covariance[k, k]) == pytest.approx(sd_m, rel=1e-6)
    v = trical.validate(fitted.model, touches)
    assert v.after["mean_mm"] == v["after"]["mean_mm"] == pytest.approx(v.errors_mm[:, 1].mean())
    assert diagnosis.errors_mm[:, 1].mean() < diagnosis.errors_mm[:, 0].mean()
    with pytest.raises(KeyError):
        v["model"]


def test_results_are_readable(
    fitted: trical.Identified, diagnosis: trical.Diagnosis, plan: trical.Plan, touches: trical.Recording
) -> None:
    v = trical.validate(fitted.model, touches)
    o = trical.observability(touches, **FILES)
    for result, words in [
        (fitted, ["nominal arm", "poses that the fit did not see", "parameters from 90"]),
        (v, ["after: the model", "90 measurements"]),
        (diagnosis, ["Backlash or friction wind-up at joint 2", "poses that the fit did not see"]),
        (plan, ["90 touches of 3 balls", "expected in the sphere"]),
        (o, ["condition", "o5"]),
    ]:
        text, html = repr(result), result._repr_html_()
        assert all(w in text for w in words), text
        assert html.count("<table>") >= 1 and html.count("<tr>") == html.count("</tr>") >= 2, html
        assert not any(line != line.rstrip() for line in text.splitlines())
    assert "a_2" in fitted._repr_html_() and "ball 2" in v._repr_html_()


@pytest.mark.parametrize("name", ["fitted", "diagnosis", "plan", "touches"])
def test_results_pickle(name: str, request: pytest.FixtureRequest) -> None:
    result = request.getfixturevalue(name)
    assert repr(pickle.loads(pickle.dumps(result))) == repr(result)


def test_plots_are_figures(
    fitted: trical.Identified, diagnosis: trical.Diagnosis, touches: trical.Recording, plan: trical.Plan
) -> None:
    pytest.importorskip("matplotlib", reason="matplotlib is not installed")
    import io

    for figure, axes in [
        (fitted.plot(), 1),
        (trical.validate(fitted.model, touches).plot(), 1),
        (diagnosis.plot(), 2),
        (diagnosis.plot(1), 1),
        (diagnosis.residuals_by_joint(), 6),
        (fitted.residuals_by_joint(), 6),
        (plan.plot(), 2),
    ]:
        assert len(figure.axes) == axes
        out = io.BytesIO()
        figure.savefig(out, format="png")
        assert len(out.getvalue()) > 5000
    # the gap of joint 2: without it the errors of both senses lie apart
    (without, with_it) = diagnosis.plot(1).axes[0].lines
    assert "last move of joint 2" in diagnosis.plot(1).axes[0].get_xlabel()
    assert np.std(without.get_ydata()) > 3 * np.std(with_it.get_ydata())
    # effects by their titles, as in the reports
    assert diagnosis.plot(1).axes[0].get_title().startswith("Backlash or friction wind-up at joint 2 (")
    bars = [label.get_text() for label in diagnosis.plot().axes[1].get_yticklabels()]
    assert bars[-1] == "Backlash or friction wind-up at joint 2"
    unseen = [label.get_text() for label in plan.plot().axes[1].get_yticklabels()]
    assert unseen and not [label for label in unseen if "_" in label]
    with pytest.raises(trical.TricalError, match="found no finding 9"):
        diagnosis.plot(9)
    with pytest.raises(trical.TricalError, match="draw it where it was made"):
        pickle.loads(pickle.dumps(diagnosis)).plot(1)


def test_a_rail_is_drawn_in_millimetres() -> None:
    pytest.importorskip("matplotlib", reason="matplotlib is not installed")
    from types import SimpleNamespace
    from typing import Any

    from trical._plots import by_joint

    told: Any = SimpleNamespace(
        joint_values=lambda: np.array([[0.5, np.pi / 2], [1.5, np.pi]]), slides=lambda: [True, False]
    )
    rail, joint = by_joint(told, np.ones((2, 2)), ("before", "after")).axes[:2]
    assert (rail.get_xlabel(), joint.get_xlabel()) == ("joint 1, mm", "joint 2, deg")
    assert np.allclose(rail.lines[0].get_xdata(), [500, 1500]) and np.allclose(joint.lines[0].get_xdata(), [90, 180])


def test_sizes_and_orders_that_no_arm_has_are_noticed(touches: trical.Recording, tmp_path: Path) -> None:
    q = trical.poses(60, **FILES, seed=3)
    poses = trical.simulate(trical.Model.nominal(**FILES), q, full_pose=True, seed=1)
    assert poses.orientation is not None and poses.position is not None
    trical.identify(poses, **FILES)
    turned = trical.Recording(q=q, position=poses.position, orientation=np.roll(poses.orientation, -1, axis=1))
    with pytest.raises(trical.TricalError, match="only with quaternions in the order x, y, z, w"):
        trical.identify(turned, **FILES)
    back = poses.orientation * [1, -1, -1, -1]
    with pytest.raises(trical.TricalError, match="or as the turn of the measuring frame in the tool"):
        trical.identify(trical.Recording(q=q, position=poses.position, orientation=back), **FILES)
    with pytest.raises(trical.TricalError, match="expected rad, found what looks like deg"):
        trical.identify(trical.Recording(q=np.degrees(q), position=poses.position), **FILES)
    for unit, per_mm in (("cm", 10), ("inches", 25.4)):
        with pytest.raises(trical.TricalError, match=f"looks like {unit}"):
            trical.identify(trical.Recording(q=q, position=poses.position / per_mm), **FILES)
    # another arm's signs, or zero: the error says that joints are beyond their limits
    sample = trical.sample(tmp_path / "sample")
    arm = trical.Recording.load(sample.recording)
    other = arm.q.copy()
    other[:, 1] += np.radians(200)
    beyond = trical.Recording(q=other, ball=arm.ball, indicators=arm.indicators, directions=arm.directions)
    with pytest.raises(trical.NotConvergedError, match="beyond their limits, joint 2"):
        trical.identify(beyond, robot=sample.robot, cell=sample.cell)
    # all problems of a file in one message
    lines = str(touches.to_csv()).splitlines()
    lines[3] = lines[3].replace(".", "x", 1)
    lines[5] = "1,2"
    (tmp_path / "many.csv").write_text("\n".join(lines))
    with pytest.raises(trical.RecordingError, match=r"line 4, column .*; line 6: found 2 fields"):
        trical.Recording.load(tmp_path / "many.csv")


def test_recordings_are_joined(touches: trical.Recording) -> None:
    first, second = touches[:40], touches[40:]
    joined = first + second
    assert joined == touches and len(trical.concat([first, second, first])) == 130
    # what one of them lacks is missing in its rows
    bare = trical.Recording(q=second.q, ball=second.ball, indicators=second.indicators, name="bare")
    mixed = trical.concat([bare, first], name="mixed")
    assert mixed.name == "mixed" and mixed.directions is not None
    assert np.all(mixed.directions[:50] == 0) and np.all(mixed.directions[50:] == first.directions)
    # times and numbers of poses go on
    timed = trical.Recording(q=np.zeros((2, 6)), distance=[1.0, 1.1], time=[0.0, 5.0], pose=[0, 1], place=["a", "b"])
    twice = timed + timed
    assert twice.time is not None and twice.pose is not None and twice.place is not None
    assert twice.time.tolist() == [0, 5, 5, 10] and twice.pose.tolist() == [0, 1, 2, 3]
    assert twice.place.tolist() == ["a", "b", "a", "b"]
    with pytest.raises(trical.TricalError, match=r"arms with \[2, 6\] joints"):
        trical.concat([timed, trical.Recording(q=np.zeros((1, 2)), distance=1.0)])
    with pytest.raises(trical.TricalError, match="found no recording"):
        trical.concat([])
    # joined with itself, it has every measurement twice
    again = "rows 91 to 180 hold the same measurements as rows 1 to 90; expected each measurement once"
    for call in (trical.identify, trical.diagnose):
        with pytest.raises(trical.TricalError, match=again):
            call(touches + touches, **FILES)
    with pytest.raises(trical.TricalError, match="holds the same measurements as"):
        trical.identify([touches, trical.concat([touches], name="copy")], **FILES)


def test_an_arm_may_have_one_joint() -> None:
    turned = np.radians(np.linspace(-90.0, 90.0, 12))
    circle = np.stack([0.3 * np.cos(turned), 0.3 * np.sin(turned), np.full(12, 0.1)], axis=1)
    r = trical.Recording(q=turned[:, None], commanded=turned[:, None], position=circle, target=1)
    assert r.joints == 1 and np.array_equal(r.q, turned[:, None])
    assert r.commanded is not None and r.commanded.shape == (12, 1)
    again = pickle.loads(pickle.dumps(r))
    assert again == r and np.array_equal(again.q, r.q)


def test_an_arm_is_compared_with_what_it_was(truth: trical.Model, plan: trical.Plan, fitted: trical.Identified) -> None:
    few = slice(0, 90, 8)
    again = trical.simulate(
        truth, plan.q[few], ball=plan.ball[few], directions=plan.directions[few], noise=5e-6, seed=11
    )
    told = trical.compare(fitted.model, again)
    assert told["verdict"] in ("unchanged", "setup changed", "arm changed", "wrong touches", "nothing visible")
    assert told["summary"] and told["mean_mm"] > 0 and told["visible"]
    # joint 3 is 0.2 deg off since
    turned = again.q.copy()
    turned[:, 2] += np.radians(0.2)
    moved = trical.Recording(
        q=turned, ball=again.ball, indicators=again.indicators, directions=again.directions, name="moved"
    )
    changed = trical.compare(fitted.model, moved)
    assert changed["verdict"] != "unchanged" and changed["mean_mm"] > 3 * told["mean_mm"]
    history = trical.history(fitted.model, [again, moved], need_mm=0.1)
    assert [s["verdict"] for s in history["sessions"]] == [told["verdict"], changed["verdict"]]
    assert history["due"].startswith("The next calibration is due now:") and len(history["sessions"]) == 2


def test_a_model_may_be_given_by_its_file(fitted: trical.Identified, touches: trical.Recording, tmp_path: Path) -> None:
    path = tmp_path / "fitted.toml"
    fitted.model.save(path)
    assert trical.validate(path, touches).after == trical.validate(fitted.model, touches).after
    moved = trical.Recording(q=touches.q[::9] + 1e-4, ball=touches.ball[::9], indicators=touches.indicators[::9])
    assert trical.compare(path, moved) == trical.history(str(path), [moved])["sessions"][0]
    for call in (trical.validate, trical.compare, trical.history):
        with pytest.raises(TypeError, match="model: found int, expected a Model or the path of a model file"):
            call(7, touches)  # type: ignore[operator]


def test_a_plan_that_does_not_determine_its_parameters_is_readable() -> None:
    assert "does not determine the" in repr(trical.plan(**FILES, per_ball=3, pool=10))


def test_what_is_known_beforehand_counts(touches: trical.Recording, tmp_path: Path) -> None:
    known = tmp_path / "known.toml"
    known.write_text("[[parameter]]\nname = 'a_2'\nvalue = 271.0\nsd = 1e-4\n[[parameter]]\nname = 'c_2'\nmin = 1.0\n")
    values = {p["name"]: p for p in trical.identify(touches, **FILES, known=known).parameters}
    assert values["a_2"]["value"] == pytest.approx(271.0, abs=1e-3)
    assert values["c_2"]["value"] == pytest.approx(1.0) and values["c_2"]["sd"] is None


def test_observability_is_that_of_the_singular_values(truth: trical.Model, touches: trical.Recording) -> None:
    o = trical.observability(touches, **FILES, noise=5e-6)
    fitted = trical.identify(touches, **FILES, keep_outliers=True)
    found = fitted.observability
    for k in ("o1", "o2", "o3", "o4", "o5"):
        assert getattr(o, k) == pytest.approx(found[k], rel=0.02), k
    assert o.noise_amplification == o.o4 and o.condition == pytest.approx(1 / o.o2)
    assert [p["name"] for p in o.parameters] == [p["name"] for p in fitted.parameters]
    # planned touches, before anything is measured
    before = trical.Recording(q=touches.q, ball=touches.ball, indicators=[0, 0, 0])
    assert trical.observability(before, **FILES).o1 == pytest.approx(o.o1, rel=1e-3)
    # half the noise, half the standard deviations
    sd = np.array([[p["sd"] for p in trical.observability(before, **FILES, noise=n).parameters] for n in (1e-5, 5e-6)])
    np.testing.assert_allclose(sd[0], 2 * sd[1])


def test_repeat_visits_scatter_as_their_noise(tmp_path: Path) -> None:
    model = trical.Model.nominal(**FILES)
    q = np.repeat(trical.poses(4, **FILES), 50, axis=0)
    rec = trical.simulate(model, q, target=1, noise=1e-5, seed=4, time=np.arange(200.0))
    said = trical.repeatability(rec)
    assert [p["visits"] for p in said["places"]] == [50] * 4
    # the mean of a three-dimensional normal's length is 1.596 sd
    assert said["by_ball"][0]["mean_rp_mm"] == pytest.approx(0.01596 + 3 * 0.00673, rel=0.15)
    with pytest.raises(trical.NotEnoughDataError, match="no place was visited twice"):
        trical.repeatability(trical.simulate(model, trical.poses(4, **FILES), target=1))
    # places a degree apart are two by default, and one within three degrees
    near = np.concatenate([q[:50], q[:50] + np.radians(2.0)])
    rec = trical.simulate(model, near, target=1, noise=1e-5, seed=4, time=np.arange(100.0))
    assert [p["visits"] for p in trical.repeatability(rec)["places"]] == [50, 50]
    assert [p["visits"] for p in trical.repeatability(rec, same=np.radians(3.0))["places"]] == [100]


def test_joints_are_chosen_by_the_data(truth: trical.Model) -> None:
    q = trical.poses(60, **FILES, seed=3)
    seen = trical.simulate(truth, q, target=1, noise=5e-6, directions=np.zeros((60, 6)))
    rng = np.random.default_rng(1)
    early = trical.Recording(q=q + rng.normal(0, 1e-3, q.shape), commanded=q, position=seen.position, target=1)
    assert trical.identify(early, **FILES, joints="auto").joints == "commanded"
    assert trical.identify(early, **FILES, joints="auto").model.joints == "commanded"


def test_progress_is_told_and_what_it_raises_ends_the_call(
    touches: trical.Recording, capfd: pytest.CaptureFixture[str]
) -> None:
    heard: list[tuple[float, str]] = []
    trical.diagnose(touches, **FILES, progress=lambda f, what: heard.append((f, what)))
    assert heard[0][0] == 0.0 and heard[-1] == (1.0, "done")
    assert [f for f, _ in heard] == sorted(f for f, _ in heard)

    class Enough(Exception):
        pass

    def stop(fraction: float, what: str) -> None:
        if fraction > 0.05:
            raise Enough(what)

    with pytest.raises(Enough, match="searching"):
        trical.diagnose(touches, **FILES, progress=stop)
    with pytest.raises(Enough):
        trical.plan(**FILES, per_ball=5, pool=20, progress=stop)
    trical.identify(touches, **FILES, progress=True)
    assert "identifying 100 % done" in capfd.readouterr().err


def test_other_threads_run_meanwhile(touches: trical.Recording) -> None:
    assert ticks_during(lambda: trical.diagnose(touches, **FILES)) > 5


SLEEPER = """
import signal, sys, trical
signal.signal(signal.SIGINT, signal.default_int_handler)  # which a shell's background job ignores, and its children
say = lambda fraction, what: print(what, flush=True)
try:
    while True:
        trical.diagnose(sys.argv[1], robot=sys.argv[2], cell=sys.argv[3], progress=say)
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""


def test_ctrl_c_in_the_midst_of_a_diagnosis_is_a_keyboard_interrupt(touches: trical.Recording, tmp_path: Path) -> None:
    touches.save(tmp_path / "r.csv")
    child = subprocess.Popen(
        [sys.executable, "-c", SLEEPER, tmp_path / "r.csv", FILES["robot"], FILES["cell"]],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert child.stdout is not None and child.stderr is not None
    try:
        while child.stdout.readline().strip() != "searching":
            assert child.poll() is None, child.stderr.read()
        start = time.monotonic()
        os.kill(child.pid, signal.SIGINT)
        out, err = child.communicate(timeout=60)
        assert out.splitlines()[-1] == "interrupted", err
        assert "done" not in out, "it went on to the end"
        assert child.returncode == 0 and time.monotonic() - start < 30
    finally:
        child.kill()


STUDENT = """
import signal, sys, trical
signal.signal(signal.SIGINT, signal.default_int_handler)  # which a shell's background job ignores, and its children
try:
    # hours of one setting
    trical.study_touches(robot=sys.argv[1], cell=sys.argv[2], per_ball=[8, 9], trials=200_000, pool=20,
                         progress=lambda fraction, what: print("said", fraction, flush=True))
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""


def test_ctrl_c_in_the_midst_of_a_setting_ends_a_study() -> None:
    command = [sys.executable, "-c", STUDENT, FILES["robot"], FILES["cell"]]
    child = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        time.sleep(6)  # candidates are found by then, trials run
        assert child.poll() is None
        os.kill(child.pid, signal.SIGINT)
        start = time.monotonic()
        out, err = child.communicate(timeout=60)
        assert out.splitlines()[-1] == "interrupted", err
        assert "said" not in out, "a setting has ended"
        assert child.returncode == 0 and time.monotonic() - start < 10
    finally:
        child.kill()


@pytest.mark.parametrize(
    ("call", "kind", "said"),
    [
        (lambda r: trical.identify(r, **FILES, joints="late"), "TricalError", "joints is 'late', expected 'read', "),
        (lambda r: trical.identify(r, **FILES, compliant=[7]), "TricalError", "compliant: joint 7 does not exist"),
        (
            lambda r: trical.identify(r, **FILES, compliant="2,3"),
            "TricalError",
            "compliant is '2,3', expected numbers of",
        ),
        (lambda r: trical.identify(r, **FILES, folds="4"), "TricalError", "folds is '4', expected a whole number, 0"),
        (lambda r: trical.plan(**FILES, per_ball=-1), "TricalError", "per_ball is -1, expected a whole number, 0 or"),
        (lambda r: trical.Model.nominal(**FILES).error_map(-1), "TricalError", "n is -1, expected 1 to 1000000"),
        (
            lambda r: trical.identify(r, robot=FILES["robot"].read_text(), cell=FILES["cell"]),
            "TricalError",
            "found a text that begins with '.{5,60}, expected the path of a file",
        ),
        (
            lambda r: trical.Model.nominal(**FILES).save("nowhere/m.toml"),
            "TricalError",
            "folder nowhere does not exist",
        ),
        (lambda r: trical.identify("nowhere.csv", **FILES), "RecordingError", "nowhere.csv"),
        (lambda r: trical.identify(r[:9], **FILES), "NotEnoughDataError", "more measurements"),
        (lambda r: trical.identify(r, **FILES, joints="commanded"), "RecordingError", "has no commanded joints"),
        (
            lambda r: trical.identify(r, **FILES, stream=True),
            "TricalError",
            "stream reads paths of recordings only",
        ),
        (lambda r: trical.validate(trical.Model.nominal(**FILES), r, refit="all"), "TricalError", "refit holds 'all'"),
        (lambda r: trical.diagnose(r, **FILES, next=0), "TricalError", "next: expected 1 to 1000 touches"),
        (lambda r: trical.plan(**FILES, criterion="best"), "TricalError", "criterion is 'best'"),
        (lambda r: trical.plan(**FILES, sphere=[0, 0, 1]), "TricalError", "sphere has 3 numbers, expected 4"),
        (lambda r: trical.plan(**FILES, per_ball=0), "PlanningError", "per_ball: found 0"),
        (lambda r: trical.simulate(trical.Model.nominal(**FILES), r.q), "TricalError", "given none of ball, target"),
        (lambda r: trical.simulate(trical.Model.nominal(**FILES), r.q, ball=9), "RecordingError", "the cell has 3"),
        (
            lambda r: trical.Model.nominal(**FILES).with_terms("name = 'x'"),
            "WrongModelError",
            "expected .*term.* tables",
        ),
        (lambda r: trical.Model.nominal(**FILES).with_terms("name ="), "TricalError", "terms, line 1"),
        (lambda r: trical.Model.from_toml("a = 1"), "WrongModelError", "is not a model file"),
    ],
)
def test_errors_have_names_and_one_sentence(touches: trical.Recording, call, kind: str, said: str) -> None:
    with pytest.raises(getattr(trical, kind), match=said):
        call(touches)


def test_frames_are_recordings_and_results_are_certified(touches: trical.Recording, tmp_path: Path) -> None:
    pytest.importorskip("pandas", reason="pandas is not installed")
    fitted = trical.identify(touches.to_pandas(), **FILES)
    values = [p["value"] for p in trical.identify(touches, **FILES).parameters]
    assert [p["value"] for p in fitted.parameters] == pytest.approx(values, rel=1e-9)
    with pytest.raises(trical.TricalError, match="the folder nowhere does not exist"):
        fitted.report("nowhere/x.html")
    fitted.certificate(tmp_path / "c.html")
    text = (tmp_path / "c.html").read_text(encoding="utf-8")
    assert "Pose accuracy AP" in text and "a DataFrame" in text
    assert fitted.cautions and all(f"Caution: {c[:30]}" in text for c in fitted.cautions)
    trical.validate(fitted.model, touches).certificate(tmp_path / "v.html")
    assert "Distance accuracy AD" in (tmp_path / "v.html").read_text(encoding="utf-8")
