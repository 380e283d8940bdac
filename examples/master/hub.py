#!/usr/bin/env python3
"""A bus without a CAN interface: what one sends, all others get.

    hub.py [--log FILE] [--bench FOLDER] HARNESS DEVICE@NODE ...

HARNESS is the program, and each DEVICE a reference device that `harness serve DEVICE --stdio`
runs. The master is whoever starts the hub: it writes lines of candump to the standard input of the
hub, and reads those of all devices from its standard output. The hub ends with its standard input.
The log has every line with the time at which it came, as `harness decode` and `harness monitor`
read it. In the folder each device has a bench socket with its name, such as `em66@7`. The exit
code is 1 when a line of the master is no frame, or a device has ended before.
"""

import argparse
import os
import re
import subprocess
import sys
import threading
import time


# `123#01FF`, `123#R`, `12345678#`, as candump writes them.
FRAME = re.compile(r"([0-9A-F]{3}|[0-9A-F]{8})#(R[0-8]?|([0-9A-F]{2}){0,8})", re.IGNORECASE)


class Hub:
    """Everybody has a name, and a stream to write to. One line is handed on at a time."""

    def __init__(self, log):
        self.log = log
        self.streams = {}
        self.one_at_a_time = threading.Lock()

    def hand_on(self, sender, line):
        """`line` is `(seconds) interface id#data`; its time need not be right."""
        frame = line.split()[-1]
        with self.one_at_a_time:
            stamped = f"({time.time():.6f}) can0 {frame}\n"
            if self.log:
                self.log.write(stamped)
                self.log.flush()
            for name, stream in self.streams.items():
                if name != sender:
                    try:
                        stream.write(stamped)
                        stream.flush()
                    except BrokenPipeError:
                        give_up(f"{name} has ended")

    def listen(self, sender, stream):
        for line in stream:
            if not line.strip():
                continue
            if not FRAME.fullmatch(line.split()[-1]):
                give_up(f"{sender} wrote a line that ends with no frame: {line.strip()}")
            self.hand_on(sender, line)


def give_up(why):
    """Ends the hub from any thread; `sys.exit` would end the thread alone."""
    print(f"hub: {why}", file=sys.stderr, flush=True)
    os._exit(1)


def partner(program, named, bench):
    """Starts a device; `em66@7` is an em66 with the node id 7."""
    device, _, node = named.partition("@")
    command = [program, "serve", device, "--stdio"] + (["--node", node] if node else [])
    command += ["--bench-socket", os.path.join(bench, named)] if bench else []
    pipe = subprocess.PIPE
    return subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True, bufsize=1)


def main():
    arguments = argparse.ArgumentParser(description="A bus without a CAN interface.")
    arguments.add_argument("--log", type=argparse.FileType("w"))
    arguments.add_argument("--bench", metavar="FOLDER")
    arguments.add_argument("harness")
    arguments.add_argument("devices", nargs="+", metavar="DEVICE@NODE")
    given = arguments.parse_args()
    hub = Hub(given.log)
    partners = {named: partner(given.harness, named, given.bench) for named in given.devices}
    hub.streams["the master"] = sys.stdout
    hub.streams.update({named: process.stdin for named, process in partners.items()})
    for named, process in partners.items():
        threading.Thread(target=hub.listen, args=(named, process.stdout), daemon=True).start()
    hub.listen("the master", sys.stdin)
    failed = []
    for named, process in partners.items():
        process.stdin.close()
        if process.wait() != 0:
            failed.append(f"hub: {named} has ended with exit code {process.returncode}")
    sys.exit("\n".join(failed) or 0)


if __name__ == "__main__":
    main()
