"""Proper scores, and what was told as training data: probabilities against what was so.

Each told finding becomes a line of findings.jsonl. `role`: `target` (answers for a true effect at its place), `false`
(nothing true there), `background` (on a real recording: said without the addition too, of this part of it or of
another). Whether a name that is said without the addition is right nobody knows: `right` and its like are null.
"""

from __future__ import annotations

import json
import re
from collections import defaultdict
from dataclasses import replace
from pathlib import Path

import numpy as np

from effects import FAMILY_OF
from plant import DEG, MM
from score import Case, Tables, is_part, same, share

FLOOR = 1e-3  # the least probability that a log score is asked of
STEP_POSES = 20  # moments of a step that are as good as one
SHARES = ("confidence", "place_confidence", "family_confidence")

# ---- size ------------------------------------------------------------------------------------------------------------


def waves(finding: dict) -> dict[float, np.ndarray]:
    """Cycles a turn -> (sine, cosine; their sd), deg, of the waves that a finding has."""
    c = [x for x in finding["coefficients"] if "sin" in x["name"] or "cos" in x["name"]]
    # "15, 30 and 100 cycles per turn of joint 4"
    lists = re.findall(r"((?:[\d.]+(?:, | and ))*[\d.]+) (?:cycle|wave)", finding.get("located") or "")
    named = [float(x) for numbers in lists for x in re.split(", | and ", numbers)]
    out = {}
    for i, (s, k) in enumerate(zip(c[::2], c[1::2], strict=False)):
        n = s.get("cycles") or (named[i] if i < len(named) else None)
        m = re.match(r"(?:\w*_)?sine_(\d+)_\d+$", s["name"])
        n = n or (float(m[1]) if m else None)
        if n:
            out[float(n)] = np.array([s["value"], k["value"], s["sd"], k["sd"]])
    return out


def expected(truth: dict, case: dict) -> dict[str, float] | None:
    """What the program's coefficients should be, by the beginning of their names, in the units it prints; `None`
    where a coefficient hangs on a shape constant that the program chooses, or another simulator on other ones."""
    if case.get("kind") == "mujoco":
        return None
    p, what, site = truth["p"], truth["effect"], truth["site"]
    j = site.get("joint")
    if what == "lost_motion_direction":
        return {f"half_gap_{j}": 0.5 * p["gap"] / DEG}
    if what == "load_friction":
        return {f"friction_{j}": 0.5 * p["gap"] / DEG, f"friction_by_load_{j}": p["per_nm"] / DEG}
    if what == "lost_motion_gravity":
        return {f"half_gap_gravity_{j}": 0.5 * p["gap"] / DEG}
    if what == "gear_ratio":
        return {f"ratio_{j}": p["k"]}
    if what == "joint_coupling":
        return {f"coupling_{j}_from_{site['from']}": p["k"]}
    if what == "axis_twist":
        return {f"beta_{j - 1}": p["beta"] / DEG}
    # on a real arm its moment is that of a load nobody knows, too
    if what == "cross_axis_compliance" and "background" not in case:
        return {"cross_": p["k"] / DEG}
    if what == "joint_zero_shift":
        return {f"zero_shift_{j}": p["size"] / DEG}
    if what == "tool_shift":
        return {f"tool_shift_{a}": x / MM for a, x in zip("xyz", p["by"], strict=True)}
    if what == "tool_drift" and case.get("span"):
        return {f"tool_drift_{a}": x / MM / case["span"] for a, x in zip("xyz", p["by"], strict=True)}
    if what == "payload" and "background" not in case:  # on a real arm its size hangs on compliances nobody knows
        moment = np.multiply(p["at"], p["mass"] or case.get("tool_mass", 0.0)) / MM
        return {"payload_mass": p["mass"], **dict(zip((f"payload_moment_{a}" for a in "xyz"), moment, strict=True))}
    if what in ("thermal_growth", "thermal_zero_drift") and case.get("rise_k"):
        return {"expansion": p["per_k"]} if what == "thermal_growth" else {f"thermal_zero_{j}": p["per_k"] / DEG}
    return None


def values(finding: dict | None, wanted: dict) -> tuple[np.ndarray, np.ndarray]:
    """Values and standard deviations of the coefficients that are wanted; several of one name (steps) are summed."""
    out = np.zeros((len(wanted), 2))
    for i, name in enumerate(wanted):
        pattern = re.compile(name + r"\w*" if name.endswith("_") else name + r"(_\d+)?")
        for c in finding["coefficients"] if finding else []:
            if pattern.fullmatch(c["name"]):
                out[i] = out[i, 0] + c["value"], np.hypot(out[i, 1], c["sd"])
    return out[:, 0], out[:, 1]


def sized(found: dict, before: dict | None, truth: dict, case: dict) -> tuple[bool, bool] | None:
    """Whether what was told, less what is told without the addition, is the true size: within 3 sd, within 20 %."""
    if not found.get("coefficients"):
        return None
    if "n" in truth["p"] and truth["effect"] in ("joint_harmonic", "gear_ripple", "encoder_error"):
        n = [float(x) for x in np.atleast_1d(truth["p"]["n"])]
        true = np.stack([np.atleast_1d(truth["p"][k]) for k in ("sin", "cos")], 1) / DEG
        told, was = waves(found), waves(before) if before else {}
        if not told:
            return None
        nothing = np.zeros(4)
        rows = [(told.get(x, nothing), was.get(x, nothing)) for x in n]
        got = np.array([a[:2] - b[:2] for a, b in rows])
        sd = np.array([np.hypot(a[2:], b[2:]) for a, b in rows])
    else:
        wanted = expected(truth, case)
        if wanted is None:
            return None
        true = np.array(list(wanted.values()))
        (a, sa), (b, sb) = values(found, wanted), values(before, wanted)
        got, sd = a - b, np.hypot(sa, sb)
    far = np.abs(got - true)
    # masses and moments have units of their own: sizes are compared by the largest of each unit
    whole = np.abs(true).max() if truth["effect"] != "payload" else np.where(np.arange(4) == 0, *_payload(true))
    return bool((far <= 3 * sd + 1e-12).all()), bool((far <= 0.2 * np.maximum(whole, 1e-12)).all())


def _payload(true: np.ndarray) -> tuple[float, float]:
    moment = float(np.abs(true[1:]).max())
    return max(float(abs(true[0])), moment / 60.0), moment


# ---- what a finding answers for --------------------------------------------------------------------------------------


def place(site: dict) -> dict:
    return {k: v for k, v in site.items() if k in ("joint", "link", "base", "tool", "fixture", "ball", "axis", "frame")}


def family(finding: dict) -> str:
    return finding.get("family") or FAMILY_OF.get(finding["effect"], "?")


def changed(found: dict, before: dict | None) -> bool:
    """Whether a finding says something else than without the addition: another coefficient, or by more than 3 sd."""
    if before is None:
        return True
    if not found.get("coefficients"):  # the naive selection's
        return abs(found["lambda"] - before["lambda"]) > 0.2 * before["lambda"]
    a, b = ({c["name"]: c for c in f["coefficients"]} for f in (found, before))
    return set(a) != set(b) or any(abs(a[k]["value"] - b[k]["value"]) > 3 * np.hypot(a[k]["sd"], b[k]["sd"]) for k in a)


def elsewhere(a: dict, b: dict) -> bool:
    """Whether two findings of one effect are steps at different moments."""
    at = [re.search(r"at pose (\d+)", f.get("located") or "") for f in (a, b)]
    return all(at) and abs(int(at[0][1]) - int(at[1][1])) > STEP_POSES


def session_of(finding: dict) -> int | None:
    """The session (from 1) that a finding belongs to, where it is one's alone."""
    return finding.get("session") or finding["site"].get("session")


def answers_without(case: Case) -> dict[str, dict]:
    """What is said of recordings of the same arm without the addition, by background."""
    name = case.truth.get("background", "")
    files = (case.where / "without").glob(f"{name.split('.')[0]}*.json") if name else []
    answers = {p.stem: json.loads(p.read_text())["answer"] for p in files}
    return {k: a for k, a in answers.items() if a}


def without(case: Case) -> dict[str, list[dict]]:
    """What is named there."""
    return {k: a["findings"] for k, a in answers_without(case).items()}


def nameless_without(case: Case) -> list[dict]:
    """Places at which something without a name is said to be there."""
    answers = answers_without(case).values()
    told = [u for a in answers for u in [a.get("unexplained"), *a.get("more_unexplained", [])] if u]
    return [place(u["site"]) for u in told if u.get("site")]


def judged(right: bool, open_question: bool, said: bool = False) -> int | None:
    """Whether a claim is right; None where nobody knows: it is open anyway, or `said` without the addition too."""
    return None if open_question else 1 if right else None if said else 0


def told(case: Case, said: dict[str, list[dict]] | None = None) -> list[dict]:
    """Every finding of a case, with what it answers for; `said`: findings without the addition, by background."""
    said = without(case) if said is None else said
    was, out = said.get(case.truth.get("background"), []), []
    arms = [b for findings in said.values() for b in findings]
    nameless = nameless_without(case)
    left = list(case.effects)
    total = sum(f["lambda"] ** 2 for f in case.findings) or 1.0
    for f in case.findings:
        before = next((b for b in was if same(b, f) and not elsewhere(b, f)), None)
        exact = next((e for e in left if same(f, e)), None)
        size = sized(f, before, exact, case.truth) if exact else None
        if exact and before and not (any(size) if size else changed(f, before)):
            exact = None  # it was said already, and its size has not moved by what was added
        if exact:
            left.remove(exact)
        fresh = changed(f, before)
        # one name that says what several effects do: nobody could tell it from them
        parts = [e for e in left if is_part(e, f)] if fresh else []
        if len(parts) + (exact is not None) + (before is not None) < 2:
            parts = []
        for e in parts:
            left.remove(e)
        says = parts + ([exact] if exact else [])
        here = [e for e in case.effects if e in says or place(e["site"]) == place(f["site"])] if fresh else []
        kin = [e for e in here if family(e) == family(f)]
        evidence = {k: v for k, v in f.get("evidence", {}).items() if isinstance(v, (int, float))}
        # what another part of the recording says too may well be so
        known = any(same(b, f) for b in arms)
        known_here = [b for b in arms if place(b["site"]) == place(f["site"])]
        known_kin = any(family(b) == family(f) for b in known_here)
        role = "target" if says or here else "background" if known else "false"

        open_question = known and not says
        replicated = f.get("replicated")
        out.append(
            {
                "case": case.id,
                "kind": case.truth["kind"],
                "background": case.truth.get("background"),
                "effect": f["effect"],
                "site": f["site"],
                "family": family(f),
                "scope": f.get("scope"),
                "confidence": f["confidence"],
                "place_confidence": f.get("place_confidence", f["confidence"]),
                "family_confidence": f.get("family_confidence", f["confidence"]),
                "lambda": f["lambda"],
                "share": f.get("share", f["lambda"] ** 2 / total),
                "replicated": replicated,
                "coefficients": len(f.get("coefficients", [])),
                "rivals": len(f.get("rivals", [])),
                "findings": len(case.findings),
                "measurements": case.truth["measurements"],
                "parameters": case.answer["final"]["parameters"],
                **evidence,
                "session": session_of(f),
                "role": role,
                "true_lambda": (says[-1:] or kin or here or [{}])[0].get("lambda"),
                "size_3sd": size[0] if size and says == [exact] else None,
                "size_20": size[1] if size and says == [exact] else None,
                "right": judged(bool(says), open_question),
                "says": [{"effect": e["effect"], "site": e["site"]} for e in says],
                "place_right": judged(
                    bool(says or here), open_question, bool(known_here) or place(f["site"]) in nameless
                ),
                "family_right": judged(bool(says or kin), open_question, known_kin),
            }
        )
    return out


def names(line: dict, effect: dict) -> bool:
    """Whether a line says a true effect, by itself or together with others."""
    return any(same(e, effect) for e in line["says"])


def lines_at(lines: list[dict], effect: dict) -> list[dict]:
    """What answers for something true at the place of a true effect."""
    here = place(effect["site"])
    return [x for x in lines if x["role"] == "target" and (names(x, effect) or place(x["site"]) == here)]


# ---- scores ----------------------------------------------------------------------------------------------------------


def calibration_error(p: np.ndarray, y: np.ndarray, equal_mass: bool) -> float:
    if not len(p):
        return float("nan")
    if equal_mass:
        bins = np.array_split(np.argsort(p, kind="stable"), min(10, len(p)))
    else:
        k = np.minimum((p * 10 + 1e-9).astype(int), 9)
        bins = [np.flatnonzero(k == i) for i in range(10)]
    return float(sum(abs(p[b].mean() - y[b].mean()) * len(b) for b in bins if len(b)) / len(p))


def largest_calibration_error(p: np.ndarray, y: np.ndarray) -> float:
    return max(calibration_error(p, y, equal_mass) for equal_mass in (True, False))


def calibration_error_by_chance(p: np.ndarray) -> tuple[float, float]:
    """5 and 95 % of the larger calibration error if each is so as often as it is stated: even right probabilities
    have one, and few of them a large one (Broecker & Smith 2007)."""
    drawn = np.random.default_rng(1).random((1000, len(p))) < p
    low, high = np.quantile([largest_calibration_error(p, y) for y in drawn.astype(float)], (0.05, 0.95))
    return float(low), float(high)


def auroc(p: np.ndarray, y: np.ndarray) -> float:
    """How often what is so has a higher number than what is not."""
    a, b = p[y == 1], p[y == 0]
    if not len(a) or not len(b):
        return float("nan")
    return float(((a[:, None] > b).sum() + 0.5 * (a[:, None] == b).sum()) / (len(a) * len(b)))


def number(x: float, digits: int = 3) -> str:
    return "-" if np.isnan(x) else f"{x:.{digits}f}"


def score_probabilities(lines: list[dict], title: str, t: Tables, limit: float | None = None):
    """Stated probabilities of findings whose truth is known, against the truth; `limit`: on their calibration error."""
    rows, risks = [], []
    for stated, true in zip(SHARES, ("right", "place_right", "family_right"), strict=True):
        judged = [x for x in lines if x[true] is not None]
        p, y = (np.array([x[k] for x in judged], float) for k in (stated, true))
        if not len(p):
            return
        log = -np.log(np.clip(np.where(y == 1, p, 1 - p), FLOOR, 1))
        sure = p >= 0.9
        rows.append(
            [
                stated,
                len(p),
                share(y.sum(), len(y)),
                number(p.mean()),
                number(log.mean()),
                number(((p - y) ** 2).mean()),
                number(calibration_error(p, y, True)),
                number(calibration_error(p, y, False)),
                number(auroc(p, y)),
                f"{int((1 - y[sure]).sum())} of {int(sure.sum())}",
            ]
        )
        if limit and stated == "confidence":
            error = largest_calibration_error(p, y)
            met = "met" if error <= limit else "**missed**"
            low, high = calibration_error_by_chance(p)
            got = f"{error:.3f} of {len(p)} ({low:.3f}-{high:.3f} if all are as probable as stated)"
            t.targets.append((f"{title}: expected calibration error", f"<= {limit}", got, met))
            wrong = int((1 - y[sure]).sum())
            met = "**missed**" if wrong else "met"
            t.targets.append((f"{title}: names at 0.9 or more that are wrong", "none", f"{wrong} of {len(p)}", met))
        order = np.argsort(-p, kind="stable")
        risk = [number(1 - y[order[: max(1, round(c * len(p)))]].mean()) for c in (0.25, 0.5, 0.75, 1.0)]
        risks.append([stated, *risk])
    head = ["probability", "findings", "so", "mean stated", "log score", "Brier", "ECE, equal mass"]
    t.table(f"{title}: probabilities", [*head, "ECE, equal width", "AUROC", "wrong at >= 0.9"], rows)
    t.table(f"{title}: share wrong among the surest", ["probability", "25 %", "50 %", "75 %", "all"], risks)


def on_truth(case: Case, lines: list[dict], effect: dict) -> tuple[float, float, float]:
    """Probabilities put on a true effect, on its place with its family, and on its place."""
    at = lines_at(lines, effect)
    exact = [x["confidence"] for x in at if names(x, effect)]
    kin = [x["family_confidence"] for x in at if x["family"] == FAMILY_OF.get(effect["effect"])]
    return tuple(max(x, default=0.0) for x in (exact, kin, [x["place_confidence"] for x in at]))


def score_added(
    cases: list[Case],
    lines: dict[str, list[dict]],
    title: str,
    t: Tables,
    by: str = "background",
    aim: bool = True,
    brief: bool = False,
):
    """Effects one by one: named, place and family, place, size; by lambda and by what they were added to."""
    groups = defaultdict(list)
    for c in cases:
        for e in c.effects:
            if e["effect"].startswith("out_"):
                continue  # it has no name in the catalogue
            groups["all"].append((c, e))
            low = next(x for x in (30, 10, 6, 0) if e["lambda"] >= x)
            groups[f"lambda >= {low}" if low == 30 else f"lambda {low} to {({0: 6, 6: 10, 10: 30})[low]}"].append(
                (c, e)
            )
            if not brief:
                groups[f"{by} {c.truth.get(by, '')}"].append((c, e))
                groups[f"effect {e['effect']}"].append((c, e))
    rows = []
    for name, xs in sorted(groups.items()):
        hits, sizes, p, at_left = np.zeros(3, int), [], [], 0
        for c, e in xs:
            mine = lines_at(lines[c.id], e)
            exact = [x for x in mine if names(x, e)]
            kin = [x for x in mine if x["family"] == FAMILY_OF.get(e["effect"])]
            hits += [bool(exact), bool(exact or kin), bool(mine)]
            sizes += [(x["size_3sd"], x["size_20"]) for x in exact[:1] if x["size_3sd"] is not None]
            p.append(on_truth(c, lines[c.id], e))
            at_left += not mine and any(place(u.get("site", {})) == place(e["site"]) for u in c.unexplained)
        n = len(xs)
        log = -np.log(np.clip([x[0] for x in p], FLOOR, 1)).mean()
        p = np.array(p).mean(0)
        size = [f"{sum(x[k] for x in sizes)} of {len(sizes)}" for k in (0, 1)]
        rows.append([name, n, *(share(h, n) for h in hits), at_left, *size, *(number(x, 2) for x in p), number(log, 2)])
        for key, what in (("lambda", ""), ("lambda_apart", " beside what is said there")):
            loud = [(c, e) for c, e in xs if e.get(key, 0.0) >= 10]
            if name != "all" or not aim or not loud:
                continue
            right = [any(names(x, e) for x in lines[c.id]) for c, e in loud]
            kin = [on_truth(c, lines[c.id], e)[1] > 0 or r for (c, e), r in zip(loud, right, strict=True)]
            for claim, so, least in (("effect", right, 0.95), ("family", kin, 0.98)):
                title_of = f"{title}, lambda >= 10{what}: {claim} and place"
                t.target(title_of, f">= {least:.0%}".replace("%", " %"), sum(so), len(loud), at_least=least)
    head = ["", "effects", "right", "place and family", "place", "place, no name", "size in 3 sd", "size in 20 %"]
    t.table(f"{title}: effects", [*head, "p(truth)", "p(family)", "p(place)", "log score"], rows)


def score_knowing(cases: list[Case], title: str, t: Tables):
    """Can one tell from the answer whether the physics has a name: the surest name, where it has one and where not."""
    p = np.array([max((f["confidence"] for f in c.findings), default=0.0) for c in cases])
    y = np.array([not c.effects[0]["effect"].startswith("out_") for c in cases], int)
    if 0 < y.sum() < len(y):
        t.table(
            f"{title}: known or unknown",
            ["known", "unknown", "AUROC"],
            [[y.sum(), len(y) - y.sum(), number(auroc(p, y))]],
        )


def score_many(cases: list[Case], lines: dict[str, list[dict]], t: Tables):
    """Recall and precision where each effect is seen well beside the others."""
    loud = [(c, e) for c in cases for e in c.effects if e["lambda_apart"] >= 10]
    right = sum(any(names(x, e) for x in lines[c.id]) for c, e in loud)
    told_loud = [x for c in cases for x in lines[c.id] if x["lambda"] >= 10]
    t.target("Six to twelve effects, lambda >= 10: recall", ">= 97 %", right, len(loud), at_least=0.97)
    precise = sum(x["right"] for x in told_loud)
    t.target("Six to twelve effects, lambda >= 10: precision", ">= 95 %", precise, len(told_loud), at_least=0.95)


def tried(case: Case) -> dict:
    """Name -> mean error (mm) of models on recordings that were kept back; errors left out."""
    path = case.where / "answers" / f"{case.id}.json"
    said = json.loads(path.read_text()).get("tried", {}) if path.is_file() else {}
    return {k: v for k, v in said.items() if isinstance(v, float)}


def score_sessions(cases: list[Case], lines: dict[str, list[dict]], t: Tables):
    """What belongs to the arm named once and called the arm's, what belongs to a day called so, and what travels."""
    rows, day_right, day = [], 0, 0
    for scope in ("arm", "setup", "course"):
        xs = [(c, e) for c in cases for e in c.effects if e["scope"] == scope]
        at = [[x for x in lines[c.id] if same(x, e)] for c, e in xs]
        named, once = [bool(x) for x in at], [len(x) == 1 for x in at]
        scoped = [any(x["scope"] == scope for x in f) for f in at]
        # of two sessions that differ, which one is off is convention
        days = [any(x["session"] == e["session"] for x in f) for f, (_, e) in zip(at, xs, strict=True)]
        n = len(xs)
        rows.append([scope, n, *(share(sum(k), n) for k in (named, once, scoped, days))])
        if scope != "arm":
            seen = [(s and d) for s, d, f in zip(scoped, days, at, strict=True) if f]
            day_right, day = day_right + sum(seen), day + len(seen)
    head = ["scope", "effects", "named", "named once", "scope said", "session said"]
    t.table("Sessions: whose effect it is", head, rows)
    t.target("Sessions: what is named and belongs to the day, called so", ">= 95 %", day_right, day, at_least=0.95)
    pairs = [(r["diagnose"], r["identify"]) for c in cases if {"diagnose", "identify"} <= (r := tried(c)).keys()]
    if pairs:
        ratio = np.array([a / b for a, b in pairs])
        q = " / ".join(f"{x:.2f}" for x in np.quantile(ratio, [0.1, 0.5, 0.9]))
        head = ["cases", "tried", "diagnosis over plain calibration, 10 / 50 / 90 %", "worse"]
        t.table(
            "Sessions: the last, by models of the others", head, [[len(cases), len(pairs), q, int((ratio > 1).sum())]]
        )
        # a thousandth is the last digit's
        good = int((ratio <= 1.001).sum())
        t.target("Sessions: never worse than plain calibration", "all", good, len(cases), at_least=1.0)


def score_clusters(cases: list[Case], t: Tables):
    """The error that is said to be held out over the error on fresh poses of the same arm."""
    rows = []
    for name in ("inside", "anywhere"):
        for key in ("holdout_mean_mm", "forward_mean_mm", "worst"):
            ratio = []
            for c in cases:
                final = c.answer["final"] if c.answer else {}
                means = {k: v for k, v in final.items() if k.endswith("_mean_mm") and isinstance(v, float)}
                said = max(means.values(), default=None) if key == "worst" else means.get(key)
                if said and name in tried(c):
                    ratio.append(said / tried(c)[name])
            if ratio:
                q = " / ".join(f"{x:.2f}" for x in np.quantile(ratio, [0.1, 0.5, 0.9]))
                rows.append([name, key, len(ratio), q])
                if (name, key) == ("inside", "worst"):
                    good = sum(x >= 0.9 for x in ratio)
                    what = "Clusters: the worst held-out error at least 0.9 of that on fresh poses inside"
                    t.target(what, ">= 90 %", good, len(ratio), at_least=0.9)
    t.table("Clusters: said over found on fresh poses", ["fresh poses", "said", "cases", "10 / 50 / 90 %"], rows)
    false = [x for c in cases for x in told(c) if not x["right"]]
    sure = sum(x["confidence"] >= 0.9 for x in false)
    effects = sum(len(c.effects) for c in cases)
    head = ["cases", "effects", "named", "false names", "at 0.9 or more"]
    named = sum(x["right"] for c in cases for x in told(c))
    t.table("Clusters: names", head, [[len(cases), effects, named, len(false), sure]])


def naively(case: Case) -> tuple[Case, list[dict]] | None:
    """The case as the naive selection answers it, and its lines."""
    kept = case.where / "naive"
    if not (kept / f"{case.id}.json").is_file():
        return None
    name = case.truth.get("background", "")
    files = kept.glob(f"{name.split('.')[0]}*.json") if name else []
    said = {p.stem: json.loads(p.read_text()) for p in files}
    answer = {"findings": json.loads((kept / f"{case.id}.json").read_text()), "final": {"parameters": 0}}
    other = replace(case, answer=answer)
    return other, told(other, said)


def score_naive(cases: list[Case], title: str, t: Tables):
    """Forward selection by BIC on the same cases."""
    both = [x for c in cases if (x := naively(c))]
    if both:
        lines = {c.id: x for c, x in both}
        score_added([c for c, _ in both], lines, f"{title}, naive selection by BIC", t, aim=False, brief=True)
        score_probabilities([y for x in lines.values() for y in x], f"{title}, naive selection by BIC", t)


def score_proper(by: dict[str, list[Case]], t: Tables) -> None:
    lines = {c.id: told(c) for cases in by.values() for c in cases}
    if by.get("real"):
        score_added(by["real"], lines, "Added to real recordings", t)
    if by.get("curves"):
        score_added(by["curves"], lines, "Curves of one joint", t, "kind")
        wrong = [c for c in by["curves"] if c.effects[0]["effect"] == "out_turn_curve"]
        named = sum(any(f["effect"] == "encoder_error" and f["confidence"] >= 0.5 for f in c.findings) for c in wrong)
        t.target(
            "Curves that differ from turn to turn: called encoder_error", "<= 5 %", named, len(wrong), at_most=0.05
        )
    if by.get("many"):
        score_many(by["many"], lines, t)
        score_added(by["many"], lines, "Six to twelve effects, one by one", t, "kind", False)
    if by.get("sessions"):
        score_sessions(by["sessions"], lines, t)
        score_added(by["sessions"], lines, "Sessions", t, "sessions", False)
    if by.get("clusters"):
        score_clusters(by["clusters"], t)
    known = [c for kind in ("single", "tracker", "outside", "curves", "arms") for c in by.get(kind, []) if c.effects]
    score_knowing(known, "Drawn arms", t)
    drawn = [c for kind, cases in by.items() if kind != "real" for c in cases]
    for title, cases, limit in (("Drawn arms", drawn, 0.02), ("Real recordings", by.get("real", []), 0.03)):
        score_probabilities([x for c in cases for x in lines[c.id]], title, t, limit)
        score_naive(cases, title, t)


def write_lines(cases: list[Case], path: Path) -> None:
    """findings.jsonl: a line for each told finding."""
    path.write_text("".join(json.dumps(x, sort_keys=True) + "\n" for c in cases for x in told(c)))
