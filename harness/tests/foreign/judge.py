"""Compares what a run found with the waivers of a device.

    judge.py WAIVERS JOURNAL            exit code 1 when a cause appeared or vanished
    judge.py --propose JOURNAL          print a waiver for each cause, without its reason

A finding is an instance of a case that is not PASS and not SKIP. A waiver covers it when the globs
of both `cases` and `cause` fit, in which * alone is special, and it is no worse than `verdict`. The
cause of a finding is what its case checks, what was expected and what came. A waiver that covers
nothing has vanished, unless it says that its cause is there `sometimes`.
"""

import json
import re
import sys
from collections import Counter
from pathlib import Path

import yaml

GREEN = ("pass", "skip")
LATE = "the tester was late"
# From the mildest to the worst.
VERDICTS = ("lenient", "fail", "error")


class Finding:
    def __init__(self, case, verdict, checks, detail):
        self.case = case
        self.verdict = verdict
        if isinstance(detail, list):
            detail = detail[0]
        if isinstance(detail, dict):
            came = re.sub(r" after [\d.]+ (us|ms|s)\b", "", str(detail.get("actual")))
            detail = f"expected {detail.get('expected')}, came {came}"
        self.cause = f"{checks}: {detail}".replace("\n", " ")


def findings(journal):
    started = None
    for line in Path(journal).read_text().splitlines():
        event = json.loads(line)
        started = event.get("case-started", started)
        outcome = event.get("case-ended", {}).get("outcome", "pass")
        outcome = outcome if isinstance(outcome, dict) else {outcome: ""}
        verdict, detail = next(iter(outcome.items()))
        if verdict == "error" and detail["problem"] is None:
            detail = detail["reason"]
            # Says nothing about the device.
            if detail.startswith(LATE):
                continue
        if verdict not in GREEN:
            instance = f"[{started['instance']}]" if started["instance"] else ""
            case = f"{started['suite']}/{started['case']}{instance}"
            checks = " ".join(check["id"] for check in started["checks"])
            yield Finding(case, verdict, checks, detail)


def ended(journal):
    """Whether the run came to its end."""
    return '"run-ended"' in Path(journal).read_text().splitlines()[-1]


def fits(glob, text):
    """Only * is special: names of instances have brackets."""
    return re.fullmatch(".*".join(map(re.escape, glob.split("*"))), text) is not None


def judge(waivers, journal):
    if not ended(journal):
        print(f"{journal}: the run did not come to its end")
        return 1
    waivers = yaml.safe_load(Path(waivers).read_text()) or []
    occurred, new, total = Counter(), [], 0
    for finding in findings(journal):
        total += 1
        covering = [
            number
            for number, waiver in enumerate(waivers)
            if VERDICTS.index(finding.verdict) <= VERDICTS.index(waiver["verdict"])
            and any(fits(glob, finding.case) for glob in cases(waiver))
            and fits(waiver["cause"], finding.cause)
        ]
        occurred.update(covering)
        if not covering:
            new.append(finding)
    for finding in new:
        print(f"appeared: {finding.verdict.upper()} {finding.case}\n    {finding.cause}")
    gone = [
        waiver
        for number, waiver in enumerate(waivers)
        if not occurred[number] and not waiver.get("sometimes")
    ]
    for waiver in gone:
        print(f"vanished: {' '.join(cases(waiver))}\n    {waiver['cause']}")
    print(f"{total} findings, {len(waivers)} waivers; {len(new)} appeared, {len(gone)} vanished")
    return 1 if new or gone else 0


def cases(waiver):
    return [waiver["cases"]] if isinstance(waiver["cases"], str) else waiver["cases"]


def propose(journal):
    groups = {}
    for finding in findings(journal):
        case = re.sub(r"\[.*\]$", "*", finding.case)
        cause = re.sub(r"= \S+( \(\w+h\))?", "= *", finding.cause)
        cause = re.sub(r"\b[0-9A-F]{3}#[0-9A-F. ]+", "*", cause)
        cause = re.sub(r"\b[\d.]+ (us|ms)\b", "*", cause)
        group = groups.setdefault((finding.verdict, cause), [])
        if case not in group:
            group.append(case)
    for (verdict, cause), names in groups.items():
        print(f"- cases: [{', '.join(names)}]" if len(names) > 1 else f"- cases: {names[0]}")
        print(f"  cause: {json.dumps(cause)}\n  verdict: {verdict}\n  reason:\n")
    return 0


if __name__ == "__main__":
    if sys.argv[1] == "--propose":
        sys.exit(propose(sys.argv[2]))
    sys.exit(judge(*sys.argv[1:]))
