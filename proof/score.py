#!/usr/bin/env python3
"""Compares answers with the sealed truth and prints the tables.

    score.py DIR... [--out tables.md] [--failures failures.md]

Refuses a truth that is not the one whose hash was printed. "Right" means effect and site. "Alias" also takes the sets
that the project's list of effects declares, and the truth among the answer's own rivals. "Alike" also takes
explanations that this suite's own simulation leaves less than 3 sigma from the truth: no diagnosis can tell them apart
with certainty.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import re
import sys
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

LAMBDAS = [(0, 2), (2, 3), (3, 4), (4, 5), (5, 6), (6, 8), (8, 10), (10, 15), (15, 30), (30, np.inf)]
SURE = 0.9

# ---- what counts as the same -------------------------------------------------------------------------------------


def J(effect, *joints, **more):
    return [(effect, {"joint": j, **more}) for j in joints]


DECLARED = [
    *[[*J("lost_motion_direction", j), *J("load_friction", j)] for j in (2, 3)],
    *[[*J("joint_harmonic", j), *J("gear_ratio", j)] for j in (1, 2)],
    [*J("joint_zero_shift", 1, 2, 3), ("fixture_shift", {"fixture": True})],
    [*J("joint_zero_shift", 6), ("tool_shift", {"tool": True})],
    [*J("thermal_zero_drift", 2), ("fixture_drift", {"fixture": True})],
    [*J("thermal_zero_drift", 3), ("thermal_growth", {"links": True})],
    [*J("cross_axis_compliance", 2), ("payload", {"tool": True})],
    J("cross_axis_compliance", 5, 6),
    [*J("gear_ratio", 3), *J("joint_coupling", 3, **{"from": 2})],
    [("ball_position", {"ball": k}) for k in (1, 2, 3)],  # a triangle has three shapes to err in, balls have six
]


# What has every shape that another effect has at its place: several of these together are it, in other words.
WHOLE = {
    "indicator_drift": "tool_drift",  # along three axes of the device
    "joint_harmonic": "encoder_error",
    "lost_motion_direction": "load_friction",
}


def same(a: dict, b: dict) -> bool:
    """Effect and site; whose session it was is another question."""
    sites = [{k: v for k, v in x["site"].items() if k != "session"} for x in (a, b)]
    return a["effect"] == b["effect"] and sites[0] == sites[1]


def is_part(effect: dict, whole: dict) -> bool:
    """Whether `whole` has every shape that `effect` has, at its place."""
    here = "tool" in whole["site"] or whole["site"] == effect["site"]
    return here and WHOLE.get(effect["effect"]) == whole["effect"]


def declared(a: dict, b: dict) -> bool:
    x, y = (a["effect"], a["site"]), (b["effect"], b["site"])
    return any(x in group and y in group for group in DECLARED)


def alias(finding: dict, truth: dict) -> bool:
    return same(finding, truth) or declared(finding, truth) or any(same(r, truth) for r in finding.get("rivals", []))


def alike(finding: dict, truth: dict) -> bool:
    return alias(finding, truth) or any(same(a, finding) for a in truth.get("alike", []))


# ---- cases -------------------------------------------------------------------------------------------------------


@dataclass
class Case:
    id: str
    where: Path
    truth: dict
    answer: dict | None
    error: str
    seconds: float

    @property
    def effects(self) -> list[dict]:
        return self.truth["effects"]

    @property
    def findings(self) -> list[dict]:
        return self.answer["findings"] if self.answer else []

    @property
    def unexplained(self) -> list[dict]:
        if not self.answer:
            return []
        return [u for u in [self.answer.get("unexplained"), *self.answer.get("more_unexplained", [])] if u]

    @property
    def size(self) -> str:
        if not self.truth["touch"]:
            return "tracker"
        return ">= 150" if self.truth["measurements"] >= 150 else "< 150"


@dataclass
class Tables:
    text: list[str] = field(default_factory=list)
    targets: list[tuple[str, str, str, str]] = field(default_factory=list)

    def table(self, title: str, head: list[str], rows: list[list]):
        if rows:
            self.text += [f"### {title}", "", "| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
            self.text += ["| " + " | ".join(str(c) for c in r) + " |" for r in rows] + [""]

    def target(
        self, what: str, want: str, hits: int, n: int, at_least: float | None = None, at_most: float | None = None
    ):
        if not n:
            return
        share = hits / n
        ok = share >= at_least - 1e-12 if at_least is not None else share <= at_most + 1e-12
        low, high = wilson(hits, n)
        got = f"{100 * share:.1f} % of {n} ({100 * low:.0f}-{100 * high:.0f})"
        self.targets.append((what, want, got, "met" if ok else "**missed**"))


def wilson(hits: int, n: int, z: float = 1.96) -> tuple[float, float]:
    """95 % interval of a share."""
    p, d = hits / n, 1 + z**2 / n
    mid, half = (p + z**2 / (2 * n)) / d, z * np.sqrt(p * (1 - p) / n + z**2 / (4 * n**2)) / d
    return max(0.0, mid - half), min(1.0, mid + half)


def share(hits, n) -> str:
    return f"{100 * hits / n:.1f} %" if n else "-"


def load(where: Path) -> tuple[dict, list[Case]]:
    data = (where / "sealed" / "truth.json").read_bytes()
    digest = hashlib.sha256(data).hexdigest()
    if digest != (where / "truth.sha256").read_text().strip():
        raise SystemExit(f"{where}: sealed/truth.json is not the truth whose hash was printed")
    truth = json.loads(data)
    cases = []
    for case_id, t in sorted(truth["cases"].items()):
        path = where / "answers" / f"{case_id}.json"
        result = json.loads(path.read_text()) if path.exists() else {"answer": None, "error": "not run", "seconds": 0.0}
        cases.append(Case(case_id, where, t, result["answer"], result.get("error", ""), result["seconds"]))
    return {"seed": truth["seed"], "kind": truth["kind"], "sha256": digest, "count": len(cases)}, cases


# ---- tables ------------------------------------------------------------------------------------------------------


def label(site: dict) -> str:
    if "joint" in site:
        return f"joint {site['joint']}" + (f" < {site['from']}" if "from" in site else "")
    key, value = next(iter(site.items()), ("", ""))
    return key if value is True else f"{key} {value}"


def first(case: Case) -> dict | None:
    return case.findings[0] if case.findings else None


def score_single(cases: list[Case], title: str, t: Tables, targets: bool):
    """One effect a case: by lambda, then who was taken for whom."""
    for size in (">= 150", "< 150", "tracker"):
        group = [c for c in cases if c.size == size]
        rows = []
        for low, high in LAMBDAS:
            xs = [c for c in group if low <= c.effects[0]["lambda"] < high]
            if not xs:
                continue
            named = [c for c in xs if first(c)]
            count = lambda f, among=named: sum(f(first(c), c.effects[0]) for c in among)  # noqa: E731
            rows.append(
                [
                    f"{low}-{high}" if high < np.inf else f"> {low}",
                    len(xs),
                    share(count(same), len(xs)),
                    share(count(alias), len(xs)),
                    share(count(alike), len(xs)),
                    share(len(xs) - len(named), len(xs)),
                    sum(len(c.findings[1:]) for c in xs),
                    sum(f["confidence"] >= SURE and not alike(f, c.effects[0]) for c in xs for f in c.findings),
                    f"{np.mean([len(first(c).get('rivals', [])) for c in named]):.1f}" if named else "-",
                ]
            )
        what = "tracker points" if size == "tracker" else f"{size} touches"
        head = [
            "lambda",
            "cases",
            "right",
            "with aliases",
            "with alikes",
            "nothing named",
            "extra names",
            "wrong and sure",
            "rivals",
        ]
        t.table(f"{title}, {what}", head, rows)
        seen = [c for c in group if c.effects[0]["lambda"] >= 6]
        if targets and seen:
            right = sum(bool(first(c)) and same(first(c), c.effects[0]) for c in seen)
            near = sum(bool(first(c)) and alias(first(c), c.effects[0]) for c in seen)
            near3 = sum(bool(first(c)) and alike(first(c), c.effects[0]) for c in seen)
            want = 0.93 if size == "< 150" else 0.97
            t.target(f"{title}, lambda >= 6, {what}: right", f">= {100 * want:.0f} %", right, len(seen), at_least=want)
            if size != "< 150":
                t.target(f"{title}, lambda >= 6, {what}: with aliases", ">= 99 %", near, len(seen), at_least=0.99)
            t.target(
                f"{title}, lambda >= 6, {what}: with aliases and alikes", ">= 99 %", near3, len(seen), at_least=0.99
            )
    rows = []
    by = defaultdict(list)
    for c in cases:
        if c.effects[0]["lambda"] >= 6:
            by[c.effects[0]["effect"]].append(c)
    for effect, xs in sorted(by.items()):
        taken = Counter()
        for c in xs:
            f, e = first(c), c.effects[0]
            if f is None:
                taken["unexplained" if c.unexplained else "nothing"] += 1
            elif not same(f, e):
                mark = "=" if alias(f, e) else "~" if alike(f, e) else ""
                taken[f"{mark}{f['effect']} {'' if f['site'] == e['site'] else label(f['site'])}".strip()] += 1
        right = sum(bool(first(c)) and same(first(c), c.effects[0]) for c in xs)
        wrong = ", ".join(f"{k} {v}" for k, v in taken.most_common())
        rows.append([effect, len(xs), right, wrong])
    t.table(
        f"{title}: confusion at lambda >= 6 (= alias, ~ alike)", ["true effect", "cases", "right", "taken for"], rows
    )


SESSION = ("balls", "order", "sides", "commanded", "thermometer", "payload_schedule")


def score_sessions(cases: list[Case], title: str, keys: tuple[str, ...], t: Tables):
    """One visible effect, by what the session was like."""
    rows = []
    seen = [c for c in cases if c.effects[0]["lambda"] >= 6]
    for key in keys:
        groups = defaultdict(list)
        for c in seen:
            groups[c.truth["session"][key]].append(c)
        for value, xs in sorted(groups.items(), key=lambda g: str(g[0])):
            hits = [sum(bool(first(c)) and rule(first(c), c.effects[0]) for c in xs) for rule in (same, alike)]
            what = {True: "yes", False: "no"}.get(value, value)
            rows.append([key.replace("_", " "), what, len(xs), *(share(h, len(xs)) for h in hits)])
    t.table(f"{title} at lambda >= 6, by session", ["", "", "cases", "right", "with alikes"], rows)


def score_none(cases: list[Case], title: str, t: Tables, targets: bool):
    rows = []
    groups = defaultdict(list)
    for c in cases:
        groups[(c.size, c.truth["noise"])].append(c)
    for (size, noise), xs in sorted(groups.items()):
        alarms = [c for c in xs if c.findings]
        loose = [c for c in xs if c.unexplained and not c.findings]
        names = Counter(f["effect"] for c in alarms for f in c.findings)
        rejected = sum(len(c.answer.get("rejected", [])) for c in xs if c.answer)
        rows.append(
            [
                size,
                noise,
                len(xs),
                len(alarms),
                len(loose),
                rejected,
                ", ".join(f"{k} {v}" for k, v in names.most_common()),
            ]
        )
        if targets:
            limit = 0.05 if size == "< 150" else 0.02
            what = "tracker points" if size == "tracker" else f"{size} touches"
            t.target(f"{title}, {what}: false alarms", f"<= {100 * limit:.0f} %", len(alarms), len(xs), at_most=limit)
    head = ["touches", "noise", "cases", "named something", "only unexplained", "rows rejected", "names"]
    t.table(title, head, rows)


def matching(case: Case, rule) -> tuple[int, int]:
    """How many true effects are named, and how many findings are right; each finding used once, the strictest rule
    first."""
    left, hits = list(range(len(case.findings))), 0
    todo = list(case.effects)
    for r in (same, rule):
        for e in list(todo):
            k = next((i for i in left if r(case.findings[i], e)), None)
            if k is not None:
                left.remove(k)
                todo.remove(e)
                hits += 1
    return hits, len(case.findings) - len(left)


def score_several(cases: list[Case], title: str, t: Tables, targets: bool, want: float):
    rows = []
    for size in (">= 150", "< 150"):
        xs = [c for c in cases if c.size == size]
        if not xs:
            continue
        for name, rule in (("right", same), ("with aliases", alias), ("with alikes", alike)):
            hits = [matching(c, rule) for c in xs]
            every = sum(h[0] == len(c.effects) for h, c in zip(hits, xs, strict=True))
            named = sum(h[0] for h in hits)
            total, found = sum(len(c.effects) for c in xs), sum(len(c.findings) for c in xs)
            precision = share(sum(h[1] for h in hits), found)
            rows.append([size, name, len(xs), share(every, len(xs)), share(named, total), precision])
        if targets and size == ">= 150":
            both = sum(matching(c, alias)[0] == len(c.effects) for c in xs)
            t.target(
                f"{title}, {size} touches: all named (aliases as one)",
                f">= {100 * want:.0f} %",
                both,
                len(xs),
                at_least=want,
            )
            apart = [c for c in xs if min(e["lambda_apart"] for e in c.effects) >= 6]
            both = sum(matching(c, alias)[0] == len(c.effects) for c in apart)
            what = f"{title}, {size} touches: all named, each lambda >= 6 beside the others"
            t.target(what, f">= {100 * want:.0f} %", both, len(apart), at_least=want)
    t.table(title, ["touches", "rule", "cases", "all named", "recall", "precision"], rows)


def threshold(region: str) -> list[float]:
    return [float(x) for x in re.findall(r"-?\d+(?:\.\d+)?", re.sub(r"q\d", "", region or ""))]


def score_outside(cases: list[Case], t: Tables):
    groups = defaultdict(list)
    for c in cases:
        groups[c.effects[0]["effect"]].append(c)
    rows, wrong, located, n_located, errors = [], 0, 0, 0, []
    located_at: list[tuple[float, bool]] = []
    for effect, xs in sorted(groups.items()):
        sure = [c for c in xs if any(f["confidence"] >= SURE for f in c.findings)]
        names = Counter(f["effect"] for c in xs for f in c.findings if f["confidence"] >= SURE)
        both = joint = known = 0
        mine = []
        for c in xs:
            e = c.effects[0]
            hits = [u for u in c.unexplained if u.get("site", {}).get("joint") == e["site"]["joint"]]
            joint += bool(hits)
            if e["variables"]:
                known += 1
                good = [u for u in hits if u.get("variable") in e["variables"]]
                both += bool(good)
                located_at.append((e["lambda"], bool(good)))
                if good and e["threshold_deg"] is not None:
                    edges = [x for u in good for x in threshold(u.get("region", ""))]
                    if edges:
                        mine.append(min(abs(x - e["threshold_deg"]) for x in edges))
        wrong, located, n_located = wrong + len(sure), located + both, n_located + known
        errors += mine
        rows.append(
            [
                effect[4:],
                len(xs),
                len(sure),
                joint,
                f"{both} of {known}" if known else "-",
                f"{np.median(mine):.2f}" if mine else "-",
                ", ".join(f"{k} {v}" for k, v in names.most_common(5)),
            ]
        )
    by_lambda = []
    for low, high in ((6.0, 10.0), (10.0, 20.0), (20.0, np.inf)):
        here = [good for at, good in located_at if low <= at < high]
        by_lambda.append(
            [f"{low:.0f}-{high:.0f}" if high < np.inf else f"> {low:.0f}", len(here), share(sum(here), len(here))]
        )
    head = [
        "family",
        "cases",
        "named and sure",
        "joint right",
        "joint and variable",
        "threshold off (median, deg)",
        "names",
    ]
    t.table("Outside the catalogue (lambda >= 6)", head, rows)
    t.table("Outside the catalogue, by lambda", ["lambda", "cases", "joint and variable"], by_lambda)
    t.target("Outside the catalogue: a name at confidence >= 0.9", "<= 10 %", wrong, len(cases), at_most=0.10)
    t.target("Outside the catalogue: joint and variable right", ">= 95 %", located, n_located, at_least=0.95)
    good = sum(x <= 2.5 for x in errors)
    t.target("Outside the catalogue: threshold within 2.5 deg, where located", "all", good, len(errors), at_least=1.0)


def score_dirty(cases: list[Case], t: Tables):
    found, total, clean = Counter(), Counter(), 0
    for c in cases:
        rejected = {r["line"] - 2 for r in c.answer.get("rejected", [])} if c.answer else set()
        dirty = set()
        for kind, rows in c.truth["rows"].items():
            total[kind] += len(rows)
            found[kind] += len(rejected & set(rows))
            dirty |= set(rows)
        clean += len(rejected - dirty)
    rows = [[k, total[k], found[k], share(found[k], total[k])] for k in sorted(total)]
    rows.append(["clean rows rejected", "", clean, ""])
    t.table("Rejected rows", ["row", "planted", "rejected", "share"], rows)


def score_blind(cases: list[Case], t: Tables):
    by, hits, total = defaultdict(lambda: [0, 0]), 0, 0
    hidden = [0, 0]
    boast = [0, 0]
    for c in cases:
        if not c.answer:
            continue
        blind = c.answer.get("blind_to", [])
        for u in c.truth["unseen"]:
            ok = any(same(u, b) for b in blind)
            by[u["effect"]][0] += ok
            by[u["effect"]][1] += 1
            hits, total = hits + ok, total + 1
        for e in c.effects:
            if e["lambda"] < 2 and any(same(u, e) for u in c.truth["unseen"]):
                hidden[0] += any(same(e, b) for b in blind)
                hidden[1] += 1
            if e["lambda"] >= 10:
                boast[0] += any(same(e, b) for b in blind)
                boast[1] += 1
    rows = [[k, v[1], share(v[0], v[1])] for k, v in sorted(by.items())]
    rows.append(["present in the case and not to be seen", hidden[1], share(*hidden)])
    rows.append(["present at lambda >= 10 and yet declared", boast[1], share(*boast)])
    t.table("Declared in `blind_to`", ["effect that cannot be seen", "effect and site", "declared"], rows)
    t.target("Effects that cannot be seen: declared in blind_to", ">= 95 %", hits, total, at_least=0.95)


def score_holdout(cases: list[Case], t: Tables):
    rows = []
    for size in (">= 150", "< 150", "tracker"):
        xs = [c for c in cases if c.size == size and c.answer and c.effects[0]["lambda"] >= 6]
        if not xs:
            continue
        # a position error has three components
        floor = np.array([np.sqrt(3) * c.truth["sigma_mm"] for c in xs])
        n = np.array([c.truth["measurements"] for c in xs])
        p = np.array([c.answer["final"]["parameters"] for c in xs])
        before = np.array([c.answer["baseline"].get("holdout_rms_mm") or np.nan for c in xs]) / floor
        after = np.array([c.answer["final"].get("holdout_rms_mm") or np.nan for c in xs]) / floor
        fair = after / np.sqrt(1 + p / (3 * 0.75 * n))
        q = lambda v: f"{np.nanmedian(v):.3f} / {np.nanquantile(v, 0.9):.3f}"  # noqa: E731
        rows.append([size, len(xs), q(before), q(after), q(fair)])
        if size != "< 150":
            what = "tracker points" if size == "tracker" else f"{size} touches"
            hits = int((after <= 1.05).sum())
            t.target(f"Held-out rms after, {what}: within 1.05 of the noise", "all", hits, len(xs), at_least=1.0)
            hits = int((fair <= 1.05).sum())
            t.target(f"... beside what fitting that many parameters costs, {what}", "all", hits, len(xs), at_least=1.0)
    head = ["size", "cases", "before", "after", "after, less the price of fitting"]
    t.table("Held-out rms over the noise's rms (median / 90th percentile)", head, rows)


def score_confidence(cases: list[Case], t: Tables):
    stated, right, near = [], [], []
    for c in cases:
        left = list(c.effects)
        for f in c.findings:
            exact = next((e for e in left if same(f, e)), None)
            hit = exact or next((e for e in left if alike(f, e)), None)
            if hit:
                left.remove(hit)
            stated.append(f["confidence"])
            right.append(exact is not None)
            near.append(hit is not None)
    stated, right, near = np.array(stated), np.array(right), np.array(near)
    rows, good, bins = [], 0, 0
    decile = np.minimum((stated * 10 + 1e-9).astype(int), 9)
    for k in range(10):
        low, m = k / 10, decile == k
        if not m.any():
            continue
        a, b = stated[m].mean(), right[m].mean()
        lo, hi = wilson(int(right[m].sum()), int(m.sum()))
        rows.append(
            [
                f"{low:.1f}-{low + 0.1:.1f}",
                int(m.sum()),
                f"{100 * a:.1f} %",
                f"{100 * b:.1f} % ({100 * lo:.0f}-{100 * hi:.0f})",
                f"{100 * near[m].mean():.1f} %",
            ]
        )
        if m.sum() >= 20:
            bins += 1
            good += abs(a - b) <= 0.05
    head = ["decile", "findings", "stated", "effect and site right", "alikes too"]
    t.table("Stated confidence against what was right", head, rows)
    t.target("Deciles of confidence (20 findings or more) within 5 points", "all", good, bins, at_least=1.0)


def failures(cases: list[Case]) -> str:
    """Every case that is not plainly right, for whoever works on the diagnosis."""
    out = []
    for c in cases:
        truth = c.effects
        ok = c.answer is not None and len(c.findings) == len(truth) and matching(c, same)[0] == len(truth)
        if ok:
            continue
        size = f"{c.truth['measurements']} {'touches' if c.truth['touch'] else 'points'}"
        out.append(f"- `{c.where.name}/{c.id}` {size}, sigma {c.truth['sigma_mm']:.4f} mm, {c.truth['noise']}")
        if c.answer is None:
            out.append(f"  - no answer: {c.error[:200]}")
        for e in truth:
            apart = f", apart {e['lambda_apart']:.1f}" if "lambda_apart" in e else ""
            out.append(
                f"  - true: {e['effect']} {label(e['site'])}, lambda {e['lambda']:.1f}{apart}, {json.dumps(e['p'])}"
            )
        for f in c.findings:
            rivals = ", ".join(f"{r['effect']} {label(r['site'])}" for r in f.get("rivals", [])) or "none"
            out.append(
                f"  - said: {f['effect']} {label(f['site'])}, {f['confidence']:.2f}, lambda {f['lambda']:.1f}; "
                f"rivals {rivals}"
            )
        for u in c.unexplained:
            out.append(f"  - unexplained: {label(u.get('site', {}))}, {u.get('variable')}, {u.get('region')}")
    return "\n".join(out) + "\n"


def score(dirs: list[Path]) -> tuple[str, str, list[Case]]:
    heads, cases = [], []
    for d in dirs:
        head, cs = load(d)
        heads.append(head)
        cases += cs
    by = defaultdict(list)
    for c in cases:
        by[c.truth["kind"]].append(c)
    t = Tables()
    score_single(by["single"], "One effect", t, True)
    points = [c for c in by["tracker"] if c.effects]
    score_single(points, "One effect", t, True)
    score_single(by["strong"], "One strong effect", t, False)
    score_single([c for c in by["mujoco"] if c.effects], "One mechanical effect in MuJoCo", t, True)
    others = by["arms"]
    score_single([c for c in others if c.effects], "One effect, other arms", t, True)
    score_none([c for c in others if not c.effects], "No effect, other arms", t, True)
    score_sessions([c for c in others if c.effects], "One effect, other arms", ("arm",), t)
    score_sessions(by["single"] + points, "One effect", SESSION, t)
    score_none(by["none"] + [c for c in by["tracker"] if not c.effects], "No effect", t, True)
    score_none([c for c in by["mujoco"] if not c.effects], "No effect, in MuJoCo", t, True)
    score_several(by["pair"], "Two effects", t, True, 0.92)
    score_several(by["five"], "Five effects", t, False, 0.0)
    score_several(by["many"], "Six to twelve effects", t, False, 0.0)
    if by["outside"]:
        score_outside(by["outside"], t)
    score_none([c for c in by["nonwhite"] if not c.effects], "No effect, noise not white", t, False)
    score_single([c for c in by["nonwhite"] if c.effects], "One effect, noise not white", t, False)
    score_single(by["dirty"], "One effect under outliers, stale rows and a wrong ball", t, False)
    if by["dirty"]:
        score_dirty(by["dirty"], t)
    score_holdout(by["single"] + points, t)
    score_confidence(by["none"] + by["single"] + by["pair"] + by["tracker"], t)
    score_blind(by["none"] + by["single"] + by["tracker"], t)
    import proper

    proper.score_proper(by, t)
    silent = [c for c in cases if c.answer is None]
    seconds = [c.seconds for c in cases] or [0.0]
    sealed = ["| kind | seed | cases | SHA-256 of the sealed truth |", "|---|---|---|---|"]
    sealed += [f"| {h['kind']} | {h['seed']} | {h['count']} | `{h['sha256']}` |" for h in heads]
    text = ["## Targets", "", "| claim | target | got (95 % interval) | |", "|---|---|---|---|"]
    text += ["| " + " | ".join(r) + " |" for r in t.targets] + [
        "",
        "## Tables",
        "",
        *t.text,
        "## What was sealed",
        "",
        *sealed,
    ]
    text += [
        "",
        f"{len(cases)} cases, {len(silent)} without an answer; "
        f"median {np.median(seconds):.1f} s, longest {max(seconds):.1f} s.",
    ]
    return "\n".join(text) + "\n", failures(cases), cases


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dirs", nargs="+", type=Path)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--failures", type=Path, help="where to list every case that is not plainly right")
    parser.add_argument("--findings", type=Path, help="where to write a line of JSON for every finding that was told")
    a = parser.parse_args()
    text, wrong, cases = score(a.dirs)
    if a.out:
        a.out.write_text(text)
    else:
        print(text)
    if a.failures:
        a.failures.write_text(wrong)
    if a.findings:
        import proper

        proper.write_lines(cases, a.findings)
    return 0


if __name__ == "__main__":
    sys.exit(main())
