#!/usr/bin/python3
"""Makes one report of what loadtest/run measured.

Usage: loadtest/report.py FOLDER    reads its .json, writes report.md, with its .svg of loadtest/plot, and report.json
"""

import bisect
import json
import pathlib
import random
import sys


def read(folder, name):
    path = folder / name
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else None


def finding(name, value, limit, at_most, detail):
    holds = value <= limit if at_most else value >= limit
    return {"name": name, "value": value, "limit": limit, "at_most": at_most, "holds": holds, "detail": detail}


def errors_of(run):
    return sum(run["total"]["errors"].values()) + run["wrong"] + run["abandoned"]


def ideal_p99_s(load):
    """What requests with these arrivals and solve times get from as many workers that lose no time between them."""
    plan, solve, chance = load["run"]["plan"], load["run"]["total"]["server_solve"], random.Random(1)
    parts = [0, 0.5, 0.75, 0.9, 0.95, 0.99, 0.999, 1]
    times = [solve[name] for name in ("least_s", "p50_s", "p75_s", "p90_s", "p95_s", "p99_s", "p99.9_s", "most_s")]

    def one_solve():
        part = chance.random()
        at = bisect.bisect(parts, part)
        return times[at - 1] + (times[at] - times[at - 1]) * (part - parts[at - 1]) / (parts[at] - parts[at - 1])

    free, now, latencies = [0.0] * load["server"]["workers"], 0.0, []
    for _ in range(200_000):
        now += 1 / plan["rate_per_s"] if plan["arrivals"] == "fixed" else chance.expovariate(plan["rate_per_s"])
        worker = free.index(min(free))
        free[worker] = max(now, free[worker]) + one_solve()
        latencies.append(free[worker] - now)
    return sorted(latencies)[int(0.99 * len(latencies))]


def steady_findings(steady):
    run = steady["run"]
    latency, solve = run["total"]["latency"], run["total"]["server_solve"]["p50_s"]
    memory = [second["resident_bytes"] for second in run["seconds"]]
    early, late = memory[len(memory) // 4], memory[-1]
    arrivals = {"poisson": "Poisson", "fixed": "even"}[run["plan"]["arrivals"]]
    what = f"70 % of capacity, {arrivals} arrivals, {run['measured_s']:.0f} s: "
    return [
        finding(what + "errors and wrong answers", errors_of(run), 0, True,
                f"{run['sent']} requests at {run['plan']['rate_per_s']:.1f}/s, {run['checked']} answers checked"),
        finding(what + "p99 over the median solve", latency["p99_s"] / solve, 3, True,
                f"p50 {1e3 * latency['p50_s']:.2f} ms, p99 {1e3 * latency['p99_s']:.2f} ms, "
                f"median solve {1e3 * solve:.2f} ms; workers that lose no time: p99 "
                f"{1e3 * ideal_p99_s(steady):.2f} ms"),
        finding(what + "memory at the end over that after a quarter", late / early, 1.05, True,
                f"{early / 2**20:.1f} MiB, then {late / 2**20:.1f} MiB"),
    ]


def busy(load):
    """The part of the workers' time that solves took: what is left of a rate when the machine changes its speed."""
    return load["run"]["answers_per_s"] * load["run"]["total"]["server_solve"]["mean_s"] / load["server"]["workers"]


def overload_findings(capacity, overload):
    run = overload["run"]
    solve = run["total"]["server_solve"]["p50_s"]
    refused, planner = run["total"]["errors_after"], run["entries"]["planner"]
    codes = run["total"]["errors"]
    others = sum(times for code, times in codes.items() if code != "resource_exhausted")
    sent_realtime = planner["answers"] + sum(planner["errors"].values())
    count = codes.get("resource_exhausted", 0)
    what = "200 % of capacity: "
    return [
        finding(what + "busy share of the workers over that at capacity", busy(overload) / busy(capacity), 0.95, False,
                f"{run['answers_per_s']:.1f}/s of {run['plan']['rate_per_s']:.1f}/s offered, "
                f"{1e3 * run['total']['server_solve']['mean_s']:.2f} ms a solve; before it {capacity['run']['answers_per_s']:.1f}/s, "
                f"{1e3 * capacity['run']['total']['server_solve']['mean_s']:.2f} ms"),
        finding(what + "p99 of refusals, ms", 1e3 * refused["p99_s"], 10, True,
                f"{count} refusals, p50 {1e3 * refused['p50_s']:.2f} ms"),
        finding(what + "refusals with RetryInfo over all", run["total"]["errors_with_retry_info"] / max(1, count), 1,
                False, f"other errors: {others}, wrong answers: {run['wrong']}"),
        finding(what + "realtime, p99 over the median solve", planner["latency"]["p99_s"] / solve, 3, True,
                f"{sent_realtime} requests, p50 {1e3 * planner['latency']['p50_s']:.2f} ms, "
                f"p99 {1e3 * planner['latency']['p99_s']:.2f} ms"),
        finding(what + "realtime requests that failed", sum(planner["errors"].values()), 0, True,
                f"of {sent_realtime}"),
    ]


def table(findings):
    lines = ["| figure | measured | promised | |", "| --- | --- | --- | --- |"]
    for f in findings:
        sign = "≤" if f["at_most"] else "≥"
        lines.append(f"| {f['name']} | {f['value']:.4g} | {sign} {f['limit']:g} | {'holds' if f['holds'] else 'missed'} |")
    return "\n".join(lines)


def main():
    if len(sys.argv) != 2 or sys.argv[1] in ("--help", "-h"):
        print(__doc__)
        sys.exit(0 if "--help" in sys.argv or "-h" in sys.argv else 2)
    folder = pathlib.Path(sys.argv[1])
    findings = read(folder, "findings.json") or []
    capacity, steady, ticks, overload = (read(folder, f"{name}.json") for name in ("capacity", "steady", "ticks", "overload"))
    for load in (steady, ticks):
        if load:
            findings += steady_findings(load)
    if capacity and overload:
        findings += overload_findings(capacity, overload)
    machine = capacity["machine"]
    about = (f"{machine['cores']} cores, {machine['processor']}, {machine['memory_bytes'] / 2**30:.0f} GiB, "
             f"{machine['system']}; server and load on this machine, two workers.")
    titles = {"steady": "70 % of capacity, Poisson arrivals", "ticks": "70 % of capacity, even arrivals",
              "overload": "200 % of capacity, a tenth of it realtime", "ramp": "Which rate holds p95 = 3 × the median solve"}
    plots = "".join(f"\n![{title}]({name}.svg)\n" for name, title in titles.items() if (folder / f"{name}.svg").exists())
    details = "\n".join(f"- {f['name']}: {f['detail']}" for f in findings)
    text = f"# Marble: remote solves and load\n\n{about}\n\n{table(findings)}\n\n## Details\n\n{details}\n{plots}"
    (folder / "report.md").write_text(text, encoding="utf-8")
    (folder / "report.json").write_text(json.dumps({"machine": machine, "findings": findings}, indent=1) + "\n",
                                        encoding="utf-8")
    print(table(findings))
    print(f"\n{folder}/report.md, report.json")


main()
