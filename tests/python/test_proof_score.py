"""The proof suite's scorer: does it count as one expects."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import proper
import score
import write
from plant import DEG, MM
from proof_cases import FRICTION2, GAP2, RIPPLE4, TWIST, WOBBLE5, found


def scored(tmp_path: Path, kind: str, cases: list[tuple[list[dict], list[dict] | None]]) -> str:
    """The tables for hand-made truths and findings; `None`: the program gave no answer."""
    truths, where = {}, tmp_path / kind
    (where / "answers").mkdir(parents=True)
    for i, (effects, findings) in enumerate(cases):
        truths[f"c{i}"] = {
            "kind": kind,
            "measurements": 150,
            "touch": True,
            "sigma_mm": 0.01,
            "noise": "white",
            "rows": {},
            "unseen": [TWIST],
            "session": dict(
                balls=3, order="path", sides="both", commanded=False, thermometer=True, payload_schedule=False
            ),
            "effects": [{"lambda": 9.0, "lambda_apart": 9.0, "p": {}, "alike": [], **e} for e in effects],
        }
        answer = (
            findings
            if findings is None
            else {
                "findings": findings,
                "baseline": {"holdout_rms_mm": 0.05},
                "final": {"parameters": 32, "holdout_rms_mm": 0.0173},
                "blind_to": [TWIST],
                "unexplained": None,
            }
        )
        (where / "answers" / f"c{i}.json").write_text(json.dumps({"answer": answer, "error": "", "seconds": 1.0}))
    digest = write.seal({"seed": 1, "kind": kind, "cases": truths}, where / "sealed" / "truth.json")
    (where / "truth.sha256").write_text(digest + "\n")
    return score.score([where])[0]


def row(text: str, title: str, first: str) -> list[str]:
    """Cells after the first of a table's row."""
    table = text.split(title, 1)[1].split("\n\n")[1]
    (line,) = [x for x in table.splitlines() if x.startswith(f"| {first} |")]
    return [c.strip() for c in line.strip("|").split("|")][1:]


def test_the_scorer_tells_right_from_alias_wrong_and_nothing(tmp_path: Path) -> None:
    text = scored(
        tmp_path,
        "single",
        [
            ([GAP2], [found(GAP2)]),
            ([GAP2], [found(FRICTION2)]),  # a declared alias
            ([RIPPLE4], [found(WOBBLE5, 0.6, (RIPPLE4,))]),  # the truth among the rivals
            ([{**RIPPLE4, "alike": [WOBBLE5]}], [found(WOBBLE5)]),  # nothing can tell these apart here
            ([RIPPLE4], [found(WOBBLE5)]),  # wrong, and sure of it
            ([RIPPLE4], [found(RIPPLE4), found(WOBBLE5)]),  # right, and one too many
            ([RIPPLE4], []),
            ([RIPPLE4], None),
        ],
    )
    # cases, right, with aliases, with alikes, nothing named, extra names, wrong and sure, mean number of rivals
    assert row(text, "### One effect, >= 150 touches", "8-10") == [
        *("8", "25.0 %", "50.0 %", "62.5 %", "25.0 %", "1", "2", "0.2"),
    ]
    confusion = "### One effect: confusion at lambda >= 6 (= alias, ~ alike)"
    assert row(text, confusion, "lost_motion_direction") == ["2", "1", "=load_friction 1"]
    assert row(text, confusion, "gear_ripple")[:2] == ["6", "1"]
    assert "| One effect, lambda >= 6, >= 150 touches: right | >= 97 % | 25.0 % of 8 (7-59) | **missed** |" in text
    assert "8 cases, 1 without an answer" in text
    assert row(text, "### Declared in `blind_to`", "axis_twist") == ["7", "100.0 %"]
    # two are right; the last column counts the alias and the alike too; the one at 0.6 stands alone
    assert row(text, "### Stated confidence against", "0.6-0.7")[:1] == ["1"]
    sure = row(text, "### Stated confidence against", "0.9-1.0")
    assert sure[2].startswith("33.3 %") and sure[3] == "66.7 %"


def test_the_scorer_counts_false_alarms(tmp_path: Path) -> None:
    text = scored(tmp_path, "none", [*[([], [])] * 3, ([], [found(WOBBLE5)])])
    assert row(text, "### No effect", ">= 150")[:3] == ["white", "4", "1"]
    assert "| No effect, >= 150 touches: false alarms | <= 2 % | 25.0 % of 4 (5-70) | **missed** |" in text


def test_the_scorer_wants_both_of_two(tmp_path: Path) -> None:
    text = scored(
        tmp_path,
        "pair",
        [
            ([GAP2, RIPPLE4], [found(RIPPLE4), found(GAP2)]),
            ([GAP2, RIPPLE4], [found(FRICTION2), found(RIPPLE4)]),
            ([GAP2, RIPPLE4], [found(RIPPLE4)]),
            ([GAP2, FRICTION2], [found(GAP2)]),  # one finding cannot stand for both
        ],
    )
    table = text.split("### Two effects", 1)[1]
    strict = next(x for x in table.splitlines() if x.startswith("| >= 150 | right |"))
    loose = next(x for x in table.splitlines() if x.startswith("| >= 150 | with aliases |"))
    assert strict == "| >= 150 | right | 4 | 25.0 % | 62.5 % | 83.3 % |"
    assert loose == "| >= 150 | with aliases | 4 | 50.0 % | 75.0 % | 100.0 % |"


def test_an_effect_that_was_said_before_is_found_only_where_its_size_moves(tmp_path: Path) -> None:
    def gap(half_deg: float) -> dict:
        size = {"name": "half_gap_2", "value": half_deg, "sd": 0.0005, "unit": "deg"}
        return {
            **found(GAP2, 0.4),
            "coefficients": [size],
            "located": "",
            "evidence": {"delta_bic": 9.0, "p_value": None},
        }

    truth = {"kind": "real", "background": "b", "measurements": 150}
    truth["effects"] = [{**GAP2, "lambda": 9.0, "alike": [], "p": {"gap": 0.01 * DEG}}]
    (tmp_path / "without").mkdir()
    (tmp_path / "without" / "b.json").write_text(
        json.dumps({"answer": {"findings": [gap(0.020), found(RIPPLE4) | {"coefficients": []}]}})
    )

    def lines(*findings: dict) -> list[dict]:
        answer = {"findings": list(findings), "final": {"parameters": 31}}
        return proper.told(score.Case("c", tmp_path, truth, answer, "", 1.0))

    (moved,) = lines(gap(0.025))
    assert (moved["role"], moved["right"], moved["size_3sd"], moved["size_20"]) == ("target", 1, True, True)
    (still,) = lines(gap(0.020))
    assert (still["role"], still["right"]) == ("background", None)
    (wild,) = lines(gap(0.050))
    assert (wild["role"], wild["right"], wild["place_right"]) == ("target", None, None)
    (rival,) = lines({**gap(0.025), **FRICTION2})
    assert (rival["right"], rival["place_right"], rival["family_right"]) == (0, 1, 1)
    (elsewhere,) = lines(found(WOBBLE5) | {"coefficients": []})
    assert (elsewhere["role"], elsewhere["place_right"]) == ("false", 0)


def test_what_was_said_before_of_another_wave_or_moment_is_another_effect(tmp_path: Path) -> None:
    def ripple(located: str, *size: float) -> dict:
        names = [f"ripple_{k}_4{n}" for n in ("", "_2") for k in ("sine", "cosine")]
        told = [{"name": k, "value": v, "sd": 2e-4, "unit": "deg"} for k, v in zip(names, size, strict=False)]
        return {**found(RIPPLE4, 0.9), "coefficients": told, "located": located}

    def slipped(pose: int, x: float) -> dict:
        told = [
            {"name": f"tool_shift_{a}", "value": v, "sd": 2e-3, "unit": "mm"}
            for a, v in zip("xyz", (x, 0, 0), strict=True)
        ]
        return {
            **found({"effect": "tool_shift", "site": {"tool": True}}, 0.9),
            "coefficients": told,
            "located": f"changes at once at pose {pose}",
        }

    before = [ripple("100 cycles per turn of joint 4", 0.003, 0.003), slipped(41, 0.03)]
    (tmp_path / "without").mkdir()
    (tmp_path / "without" / "b.json").write_text(json.dumps({"answer": {"findings": before}}))

    def line(effect: dict, p: dict, finding: dict) -> dict:
        truth = {"kind": "real", "background": "b", "measurements": 150}
        truth["effects"] = [{**effect, "lambda": 20.0, "alike": [], "p": p}]
        answer = {"findings": [finding], "final": {"parameters": 31}}
        (told,) = proper.told(score.Case("c", tmp_path, truth, answer, "", 1.0))
        return told

    added = {"n": 15, "sin": 0.006 * DEG, "cos": 0.002 * DEG}
    both = ripple("15 and 100 cycles per turn of joint 4", 0.006, 0.002, 0.003, 0.003)
    assert line(RIPPLE4, added, both)["right"] == 1
    assert line(RIPPLE4, added, before[0])["role"] == "background"
    shift = {"at": 0.5, "by": [0.03 * MM, 0.0, 0.0]}
    effect = {"effect": "tool_shift", "site": {"tool": True}}
    assert line(effect, shift, slipped(75, 0.03))["right"] == 1
    assert line(effect, shift, slipped(41, 0.03))["role"] == "background"


def test_one_name_for_what_several_effects_do_together_answers_for_all_of_them(tmp_path: Path) -> None:
    tool = {"effect": "tool_drift", "site": {"tool": True}}
    drifts = [{"effect": "indicator_drift", "site": {"axis": k}} for k in "xy"]
    told_before = found(FRICTION2) | {"coefficients": [{"name": "gap", "value": 0.01, "sd": 1e-4, "unit": "deg"}]}
    (tmp_path / "without").mkdir()
    (tmp_path / "without" / "b.json").write_text(json.dumps({"answer": {"findings": [told_before]}}))

    def lines(effects: list[dict], *findings: dict, background: str = "") -> list[dict]:
        truth = {"kind": "many", "background": background, "measurements": 150}
        truth["effects"] = [{**e, "lambda": 9.0, "alike": [], "p": {}} for e in effects]
        answer = {"findings": [{"coefficients": [], **f} for f in findings], "final": {"parameters": 31}}
        return proper.told(score.Case("c", tmp_path, truth, answer, "", 1.0))

    (both,) = lines([*drifts, TWIST], found(tool))
    assert (both["right"], both["place_right"]) == (1, 1)
    assert [proper.names(both, e) for e in (*drifts, TWIST)] == [True, True, False]
    assert [len(proper.lines_at([both], e)) for e in (*drifts, TWIST)] == [1, 1, 0]
    (with_whole,) = lines([drifts[0], tool], found(tool))
    assert proper.names(with_whole, drifts[0]) and proper.names(with_whole, tool)
    (alone,) = lines([drifts[0]], found(tool))
    assert alone["right"] == 0 and not proper.names(alone, drifts[0])
    # its own name is as right, and then nothing is left for the other
    own, other = lines(drifts, found(drifts[0]), found(tool))
    assert (own["right"], other["right"]) == (1, 0)
    (elsewhere,) = lines([GAP2, FRICTION2], found(FRICTION2 | {"site": {"joint": 3}}))
    assert elsewhere["right"] == 0
    # of a real arm that has friction already, a gap more
    more = told_before | {"coefficients": [told_before["coefficients"][0] | {"value": 0.02}]}
    (friction,) = lines([GAP2], more, background="b")
    assert friction["right"] == 1
    (still,) = lines([GAP2], told_before, background="b")
    assert still["right"] is None


def test_probabilities_are_scored_against_what_was_so() -> None:
    p, y = np.repeat([0.2, 0.8], 50), np.tile([0, 0, 0, 0, 1], 20)
    y[50:] = 1 - y[50:]
    for equal_mass in (True, False):
        assert proper.calibration_error(p, y, equal_mass) == pytest.approx(0.0, abs=1e-12)
        assert proper.calibration_error(np.full(100, 0.9), y, equal_mass) == pytest.approx(0.4, abs=1e-12)
    low, high = proper.calibration_error_by_chance(p)
    assert 0.0 < low < high
    many = proper.calibration_error_by_chance(np.repeat(p, 25))
    assert many[1] == pytest.approx(high / 5.0, rel=0.2), "it falls with the root of how many are judged"
    drawn = (np.random.default_rng(3).random((200, len(p))) < p).astype(float)
    within = [low <= proper.largest_calibration_error(p, of) <= high for of in drawn]
    assert 0.82 < np.mean(within) < 0.97
    sure = np.full(100, 0.9)
    assert proper.largest_calibration_error(sure, y) > proper.calibration_error_by_chance(sure)[1]
    assert proper.auroc(p, y) == pytest.approx(0.8)
    assert proper.auroc(y, y) == 1.0


def test_sizes_of_another_simulator_are_not_compared() -> None:
    truth = {"effect": "load_friction", "site": {"joint": 2}, "p": {"per_n": 1.0}}
    assert proper.expected(truth, {"kind": "mujoco"}) is None
    closed = {**truth, "p": {"gap": 2.0 * DEG, "per_nm": DEG}}
    assert proper.expected(closed, {"kind": "single"}) == {"friction_2": 1.0, "friction_by_load_2": 1.0}
