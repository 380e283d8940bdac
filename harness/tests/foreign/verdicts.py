"""Prints the cases whose verdicts differ in two journals, one a line.

    verdicts.py JOURNAL JOURNAL

What is undecided in one of them has no verdict there.
"""

import json
import sys

def verdicts(journal):
    """The verdict of each case, by its name; that of a case that ran again is the last one."""
    name, found = None, {}
    for line in open(journal, encoding="utf-8"):
        ((kind, what),) = json.loads(line).items()
        if kind == "case-started":
            instance = f"[{what['instance']}]" if what["instance"] else ""
            name = f"{what['suite']}/{what['case']}{instance}"
        elif kind == "case-ended":
            found[name] = verdict(what["outcome"])
    return found


def verdict(outcome):
    """Its name; what is waived has that of what it would be."""
    if isinstance(outcome, str):
        return outcome
    ((name, what),) = outcome.items()
    return verdict(what["outcome"]) if name == "waived" else name


def main(one, other):
    one, other = verdicts(one), verdicts(other)
    for name in one.keys() & other.keys():
        both = {one[name], other[name]}
        if len(both) > 1 and "undecided" not in both:
            print(f"{name}: {one[name]}, then {other[name]}")


main(*sys.argv[1:])
