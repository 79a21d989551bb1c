"""What Python tells as the command line does: reports, studies, what a plan is blind to, the error map."""

from __future__ import annotations

import csv
import hashlib
import io
import json
import pickle
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

import trical
from conftest import program
from terms import link, lost_motion, term

ROOT = Path(__file__).resolve().parents[2]
ARM = ROOT / "cells" / "irb120"
FILES = {"robot": ARM / "robot.toml", "cell": ARM / "cell.toml"}
ARGS = ["--robot", str(FILES["robot"]), "--cell", str(FILES["cell"])]


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a plan's touches of an arm with a hidden flaw."""
    folder = tmp_path_factory.mktemp("told")
    truth = trical.Model.nominal(**FILES).with_terms(
        lost_motion(2, 0.02) + term("a_2", "geometry", 0.7, "mm", link(2, "a"))
    )
    plan = trical.plan(**FILES)
    plan.save(folder / "plan.csv")
    plan.report(folder / "plan.html")
    touches = trical.simulate(truth, plan.q, ball=plan.ball, directions=plan.directions, noise=5e-6, seed=1)
    touches.save(folder / "touches.csv")
    return folder


def body(page: Path) -> str:
    """A report without its last part, which tells the call."""
    text = page.read_text()
    assert text.startswith("<!DOCTYPE html>") and text.rstrip().endswith("</html>")
    return re.sub(r"<footer>.*?</footer>", "", text, flags=re.DOTALL)


def command(place: Path, *args: str) -> str:
    done = subprocess.run([program(), *args], cwd=place, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_both_ways_say_that_no_arm_errs_like_this(place: Path) -> None:
    rows = list(csv.reader(io.StringIO((place / "touches.csv").read_text())))
    second, third = rows[0].index("q2_deg"), rows[0].index("q3_deg")
    for row in rows[1:]:
        row[second], row[third] = row[third], row[second]
    (place / "swapped.csv").write_text("\n".join(map(",".join, rows)) + "\n")
    for row in rows[1:]:
        row[second], row[third] = row[third], row[second]
    fifth = rows[0].index("q5_deg")
    for k, row in enumerate(rows[1:]):
        row[fifth] = str(float(row[fifth]) + (7 if k % 2 else -7))
    (place / "bent.csv").write_text("\n".join(map(",".join, rows)) + "\n")
    for name in ("identify", "diagnose"):
        # what no arm does at all is refused
        done = subprocess.run([program(), name, "swapped.csv", *ARGS], cwd=place, capture_output=True, text=True)
        assert done.returncode == 2 and re.search(r"the tool is still \d+ mm off, more than any arm", done.stderr)
        told = {f: json.loads(command(place, name, f"{f}.csv", *ARGS, "--json")) for f in ("bent", "touches")}
        assert re.match(r"after identification the tool is still \d+ mm off", told["bent"]["cautions"][0])
        assert not any("still" in c for c in told["touches"]["cautions"])
    # before the verdict
    printed = command(place, "diagnose", "bent.csv", *ARGS)
    assert printed.startswith("Caution: after identification the tool is still")


def test_reports_are_those_of_the_command_line(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(place)
    fit = trical.identify("touches.csv", **FILES, folds=4, hold_out_last=25)
    fit.report("fit.html")
    fit.model.save("fitted.toml")
    trical.validate(fit.model, "touches.csv", **FILES).report("validation.html")
    found = trical.diagnose("touches.csv", **FILES)
    found.report(place / "diagnosis.html")

    footer = (place / "fit.html").read_text().split("<footer>")[1].replace("&#x27;", "'").replace("&#x2f;", "/")
    assert "trical.identify('touches.csv', robot=" in footer and "folds=4, hold_out_last=25)" in footer
    assert "joints=" not in footer, "as by default"
    for file in (place / "touches.csv", *FILES.values()):
        assert hashlib.sha256(file.read_bytes()).hexdigest() in footer

    command(
        place, "identify", "touches.csv", *ARGS, "--cross-validate", "4", "--hold-out-last", "25", "--report", "a.html"
    )
    command(place, "validate", "touches.csv", *ARGS, "--model", "fitted.toml", "--report", "b.html")
    command(place, "diagnose", "touches.csv", *ARGS, "--report", "c.html")
    command(place, "plan", *ARGS, "--out", "p.csv", "--report", "d.html")
    for ours, theirs in [("fit", "a"), ("validation", "b"), ("diagnosis", "c"), ("plan", "d")]:
        assert body(place / f"{ours}.html") == body(place / f"{theirs}.html"), ours


def test_a_report_is_written_where_the_result_was_made(place: Path, tmp_path: Path) -> None:
    fit = trical.identify(place / "touches.csv", **FILES)
    again = pickle.loads(pickle.dumps(fit))
    assert repr(again) == repr(fit)
    with pytest.raises(trical.TricalError, match="where it was made"):
        again.report(tmp_path / "fit.html")
    fit.report(tmp_path / "fit.html")
    for write in (fit.report, fit.certificate):
        with pytest.raises(trical.TricalError, match=r"fit\.pdf, expected a name that ends in \.html"):
            write(tmp_path / "fit.pdf")
    with pytest.raises(trical.TricalError, match="nowhere"):
        fit.report(tmp_path / "nowhere" / "fit.html")


def test_objects_and_arrays_are_told_by_name(place: Path, tmp_path: Path) -> None:
    robot, cell = trical.Robot.load(FILES["robot"]), trical.Cell.load(FILES["cell"])
    touches = trical.Recording.load(place / "touches.csv")
    trical.identify([touches], robot=robot, cell=cell).report(tmp_path / "fit.html")
    text = (tmp_path / "fit.html").read_text()
    assert "SHA-256" not in text.split("<footer>")[1], "no file was read"
    assert "trical.Robot ABB IRB 120" in text


def test_a_plan_says_what_it_would_be_blind_to(place: Path) -> None:
    plan = trical.plan(**FILES)
    blind = plan.blind_to
    assert blind and all({"effect", "lambda"} <= set(b) and ("advice" in b) != ("lacks" in b) for b in blind)
    assert all(0 <= b["lambda"] < 3 for b in blind)
    assert not any("--" in (b.advice or "") for b in blind), "an option of the command line"
    assert f"would not show {len({b['effect'] for b in blind})} effects" in repr(plan)
    # twice the noise, half as visible: nothing that was hidden appears
    louder = trical.plan(**FILES, noise=2e-5).blind_to
    where = {(b["effect"], str(b.site)): b.lambda_ for b in louder}
    for b in blind:
        assert where[b.effect, str(b.site)] == pytest.approx(b["lambda"] / 2, abs=1e-9)
    said = json.loads(command(place, "plan", *ARGS, "--out", "p.csv", "--json"))["blind_to"]
    assert [(b["effect"], b["lambda"]) for b in said] == [(b["effect"], b["lambda"]) for b in blind]


SMALL = {"trials": 3, "pool": 30}


def test_a_study_of_touches_is_that_of_the_command_line(place: Path) -> None:
    heard: list[float] = []
    study = trical.study_touches(**FILES, **SMALL, per_ball=[9, 15], progress=lambda f, _: heard.append(f))
    assert heard == sorted(heard) and heard[-1] == 1.0
    noisy = [s for s in study.settings if s["noise"]]
    assert len(noisy) == 8 and {s["per_ball"] for s in noisy} == {9, 15}
    silent = next(s for s in study.settings if not s["noise"] and s["arm"] == "described")
    assert silent["workspace_mean_mm"] < 1e-6 < min(s["workspace_mean_mm"] for s in noisy)
    rows = list(csv.DictReader(io.StringIO(study.csv)))
    assert len(rows) == 3 * len(study.settings)
    of = [r for r in rows if (r["arm"], r["design"], r["per_ball"], r["noise"]) == ("any", "chosen", "15", "yes")]
    mean = np.mean([float(r["sphere_mean_mm"]) for r in of])
    setting = next(s for s in noisy if (s["arm"], s["design"], s["per_ball"]) == ("any", "chosen", 15))
    assert mean == pytest.approx(setting["sphere_mean_mm"])
    assert study.verdict in repr(study) and "<svg" in study._repr_html_()
    study.save(place / "ours")
    command(place, "study", "touches", *ARGS, "--trials", "3", "--pool", "30", "--per-ball", "9,15", "--out", "theirs")
    for name in ("study.csv", "study.svg"):
        assert (place / "ours" / name).read_bytes() == (place / "theirs" / name).read_bytes()
    assert body(place / "ours" / "study.html") == body(place / "theirs" / "study.html")


def test_platforms_are_compared() -> None:
    study = trical.study_platforms(
        **FILES, **SMALL, touches=45, balls=[3], side_mm=[300, 3000], height_mm=[0], raise_mm=[0]
    )
    good, far = study.settings
    assert good["problem"] is None and good["sphere_mean_mm"] > 0
    assert far["problem"] and far["sphere_mean_mm"] is None and any("3000" in n for n in study.notes)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"length_mm": 50}, "length_mm: found 50, expected 0 to 20"),
        ({"compliance_deg_per_nm": [0.1]}, "expected a least and a largest one above 0"),
        ({"trials": 0}, "trials: found 0"),
        ({"trials": -1}, "trials is -1, expected a whole number, 0 or more"),
        ({"per_ball": [200]}, "expected numbers of 1 to 30"),
        ({"model": "nominal"}, "expected 'geometry', 'compliance' or 'complete'"),
        ({"criterion": "x"}, "criterion is 'x'"),
    ],
)
def test_a_study_says_what_is_wrong(wrong: dict[str, object], words: str) -> None:
    with pytest.raises(trical.TricalError, match=re.escape(words)):
        trical.study_touches(**{**FILES, **SMALL, "per_ball": [15], **wrong})


def test_the_error_map_of_a_turned_first_joint_is_a_rotation() -> None:
    site = link(1, "theta")
    model = trical.Model.nominal(**FILES).with_terms(term("t", "geometry", np.degrees(1e-3), "deg", site))
    q, at, off = model.error_map(50)
    assert q.shape == (50, 6) and at.shape == off.shape == (50, 3)
    assert ((model.limits[:, 0] <= q) & (q <= model.limits[:, 1])).all()
    turned = 1e-3 * np.stack([-at[:, 1], at[:, 0], 0 * at[:, 2]], axis=1)
    np.testing.assert_allclose(off, turned, atol=1e-6)
    assert np.array_equal(model.error_map(10)[0], q[:10])
    with pytest.raises(trical.TricalError, match="n is 0"):
        model.error_map(0)
