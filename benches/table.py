"""From results, one JSON object a line, to the tables of docs/benchmarks.md. Standard library only."""

import math
import statistics

#: Rows in the order of the table, and what each asks for.
ROWS = {
    "forward kinematics": "pose of the tool at one configuration",
    "Jacobian": "6 x 6, of the tool to the joints, forward kinematics included",
    "parameter Jacobian": "of the tool point to the geometric parameters, at one configuration",
    "parameter Jacobian with compliance": "the same with five compliances, gravity torques included unless said",
    "identification, 45 touches, 26 parameters": "three balls, 20 um of noise",
    "identification, 45 touches, 31 parameters": "and five compliances",
    "identification, 1000 poses, 26 parameters": "tracker points all over the workspace",
    "identification, 1000 poses, 31 parameters": "and five compliances",
    "identification, 1000000 poses, 31 parameters": "the arrays are in memory",
    "identification, 1000000 poses from CSV": "from a 107 MB file to a model, the process as a whole",
    "identification, 45 touches from CSV, from Python": "from a file to a model in a running interpreter",
    "loading, 1000000 poses from CSV": "from a 107 MB file to joint values in rad and positions in m, NumPy arrays",
    "loading, 1000000 poses from MCAP": "the same from 240 MB: a message of JSON for each pose, not compressed",
    "loading, 1000000 poses from Parquet": (
        "the same from 74 MB. TriCal does not read Parquet: ours is what a user does instead, the time of a "
        "peer's reader included"
    ),
    "identifiability": "which candidates are independent",
    "observability": "condition of the Jacobian at 45 touches, columns of unit length",
    "collision check, capsules": "45 pairs at one configuration, forward kinematics included, until one meets",
    "collision check, boxs": "the same with boxes",
    "collision check, hulls": "the same with hulls of 48 points",
    "choice of configurations": "45 of 900 by the determinant, Jacobians included",
    "inverse kinematics": "all solutions of a nominal arm with a spherical wrist",
    "inverse kinematics, one solution from near": "from 2 deg away in every joint",
}

#: Programs written by hand for this comparison are no packages that users have.
BY_HAND = "by hand"


def quantity(seconds):
    """A time with three digits and a unit."""
    units = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
    unit, size = next((x for x in units.items() if seconds >= 0.9995 * x[1]), ("ns", 1e-9))
    value = seconds / size
    return f"{value:.{2 if value < 9.995 else 1 if value < 99.95 else 0}f} {unit}"


def ratio(value):
    """A ratio with two digits, or as many as an integer has."""
    return f"{value:.1f}" if value < 10 else f"{value:,.0f}".replace(",", " ")


def title(row):
    """A row's name as people read it."""
    return row.replace("boxs", "boxes").replace("1000000", "a million")


def over_rounds(results):
    """The lines of one program on one task in several rounds as one: the median of the times, and the time of each."""
    merged = {}
    for r in results:
        line = merged.setdefault((r["row"], r["who"]), {**r, "rounds": {}})
        if r.get("seconds"):
            line["rounds"][r.get("round", 1)] = r["seconds"]
            line["seconds"] = statistics.median(line["rounds"].values())
    return list(merged.values())


def times_ours(peer, ours):
    """How many times ours is faster: the median of the rounds in which both took part, the least and the largest."""
    every = [peer["rounds"][k] / ours["rounds"][k] for k in peer["rounds"] if k in ours["rounds"]]
    every = every or [peer["seconds"] / ours["seconds"]]
    return statistics.median(every), min(every), max(every)


def spread(times):
    """A median and its range in words: `1.5 (1.4 to 1.7)`, or the one where it says the same."""
    median, low, high = map(ratio, times)
    said = f"**{median}**" if times[0] < 1 else median
    return said if low == high else f"{said} ({low} to {high})"


def put_between(text, mark, told):
    """A text with `told` in place of what stands between the comments `mark` and `end of the table`."""
    before, rest = text.split(f"<!-- {mark} -->", 1)
    end = "<!-- end of the table -->"
    _, after = rest.split(end, 1)
    return f"{before}<!-- {mark} -->\n\n{told}\n\n{end}{after}"


def ours_of(results):
    """The line of ours that does the whole of the task: the first."""
    return next((r for r in results if r.get("ours") and r.get("seconds")), None)


def best(results, by_hand):
    """The fastest peer among packages, or among programs written by hand."""
    some = [r for r in results if not r.get("ours") and r.get("seconds") and (BY_HAND in r["who"]) == by_hand]
    return min(some, key=lambda r: r["seconds"], default=None)


def grouped(results):
    """Results by row, rows in the order of `ROWS`, unknown ones at the end."""
    rows = {name: [] for name in ROWS}
    for r in results:
        if "row" in r:
            rows.setdefault(r["row"], []).append(r)
    return {name: over_rounds(list_) for name, list_ in rows.items() if list_}


def summary(results):
    """One line a row: ours, the fastest package and program by hand, and how many times faster ours is."""
    lines = [
        "| task | ours | fastest package | times ours | fastest written by hand | times ours |",
        "|---|---:|---|---:|---|---:|",
    ]
    for name, list_ in grouped(results).items():
        ours = ours_of(list_)
        if ours is None:
            continue
        cells = [title(name), quantity(ours["seconds"])]
        for by_hand in (False, True):
            peer = best(list_, by_hand)
            if peer is None:
                cells += ["", ""]
            else:
                cells += [f"{peer['who']}, {quantity(peer['seconds'])}", spread(times_ours(peer, ours))]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def behind(results):
    """Rows in which a peer is faster: (row, peer, median ratio)."""
    found = []
    for name, list_ in grouped(results).items():
        ours = ours_of(list_)
        for by_hand in (False, True):
            peer = best(list_, by_hand)
            if ours and peer and (times := times_ours(peer, ours)[0]) < 1:
                found.append((name, peer["who"], times))
    return found


def details(results):
    """Every row with everybody in it, fastest first; those that could not be measured at the end, with the reason."""
    out = []
    for name, list_ in grouped(results).items():
        ours = ours_of(list_)
        out += [
            f"### {title(name)[0].upper()}{title(name)[1:]}",
            "",
            ROWS.get(name, "")[:1].upper() + ROWS.get(name, "")[1:] + ".",
            "",
        ]
        out += ["| who | version | CPU time | times ours | reached |", "|---|---|---:|---:|---|"]
        timed = sorted((r for r in list_ if r.get("seconds")), key=lambda r: r["seconds"])
        for r in timed:
            who = f"**{r['who']}**" if r.get("ours") else r["who"]
            times = "" if ours is None or r is ours else spread(times_ours(r, ours))
            version = f"trical {r['version']}" if r.get("ours") else r.get("version", "")
            out.append(f"| {who} | {version} | {quantity(r['seconds'])} | {times} | {r.get('accuracy') or ''} |")
        for r in list_:
            if not r.get("seconds"):
                out.append(f"| {r['who']} | | not measured | | {r.get('error') or 'no reason known'} |")
        out.append("")
    return "\n".join(out)


def targets(results):
    """Start-up and size against what was promised."""
    lines = ["| what | limit | measured | kept |", "|---|---:|---:|---|"]
    for r in results:
        if "target" in r:
            value, unit = r["value"], r["unit"]
            kept = "not measured" if value is None else "yes" if value <= r["limit"] else "**no**"
            measured = r.get("error", "") if value is None else f"{value:.3g} {unit}"
            lines.append(f"| {r['target']} | {r['limit']:g} {unit} | {measured} | {kept} |")
    return "\n".join(lines)


def slope(points):
    """Exponent b of y = a x^b by least squares in logarithms."""
    x, y = [math.log(p[0]) for p in points], [math.log(p[1]) for p in points]
    mx, my = sum(x) / len(x), sum(y) / len(y)
    return sum((a - mx) * (b - my) for a, b in zip(x, y, strict=True)) / sum((a - mx) ** 2 for a in x)


def scale(results, sentences):
    """A table for everything that grows, its fitted exponent, and a sentence that explains it."""
    out = []
    for what, (heading, sentence) in sentences.items():
        list_ = [r for r in results if r.get("scale") == what]
        if not list_:
            continue
        wall = any(r.get("wall_2") for r in list_)
        out += [
            f"### {heading}",
            "",
            f"| n | CPU time | memory, peak |{' wall, 1 thread | wall, 2 threads |' if wall else ''}",
        ]
        out.append("|---:|---:|---:|" + ("---:|---:|" if wall else ""))
        for r in list_:
            cells = [f"{r['n']:,}".replace(",", " "), quantity(r["seconds"]), f"{r['peak_mb']:.0f} MB"]
            cells += [quantity(r["wall"]), quantity(r["wall_2"]) if r.get("wall_2") else ""] if wall else []
            out.append("| " + " | ".join(cells) + " |")
        half = list_[len(list_) // 2 :] if len(list_) > 3 else list_
        text = f"Time grows as n^{slope([(r['n'], r['seconds']) for r in list_]):.2f} over all"
        if half is not list_:
            text += f", n^{slope([(r['n'], r['seconds']) for r in half]):.2f} over the upper half"
        out += ["", f"{text}. {sentence}", ""]
    return "\n".join(out)


def fleet(results):
    """A fleet of arms on threads and on Dask: medians over the rounds, and what the cluster costs, in words."""
    rounds = {}
    for r in results:
        if "fleet" in r:
            rounds.setdefault(r["fleet"], []).append(r)
    if not rounds:
        return ""
    arms, dask = next((r["arms"], r["dask"]) for list_ in rounds.values() for r in list_)
    median = {
        how: {k: statistics.median(r[k] for r in list_) for k in ("wall", "seconds")} for how, list_ in rounds.items()
    }
    start, nothing = median.pop("start", None), median.pop("nothing", None)
    two = median.get("2 threads")
    out = [f"### {arms} arms from Python: a CSV of 45 touches each, 31 parameters", ""]
    out += ["| how | wall | CPU time | CPU time, an arm | wall, two threads = 1 |", "|---|---:|---:|---:|---:|"]
    for how, m in median.items():
        to_two = f"{m['wall'] / two['wall']:.2f}" if two else ""
        cells = [how, quantity(m["wall"]), quantity(m["seconds"]), quantity(m["seconds"] / arms), to_two]
        out.append("| " + " | ".join(cells) + " |")
    text = "A call is `trical.identify`: it reads the file, looks for gross errors, fits and cross-validates."
    if start and nothing:
        wall, cpu, task = quantity(start["wall"]), quantity(start["seconds"]), quantity(nothing["wall"] / arms)
        text += (
            f" Dask {dask} takes {wall} of wall and {cpu} of CPU time to start two workers that have loaded the "
            f"library, which is not in the table, and {task} of wall a task that does nothing. Results come back by "
            "pickle."
        )
    return "\n".join([*out, "", text, ""])
