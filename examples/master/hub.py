#!/usr/bin/env python3
"""A bus without a CAN interface: what one sends, all others get.

    hub.py [--log FILE] HARNESS DEVICE@NODE ...

HARNESS is the program, and each DEVICE a reference device that `harness serve DEVICE --stdio`
runs. The master is whoever starts the hub: it writes lines of candump to the standard input of the
hub, and reads those of all devices from its standard output. The hub ends with its standard input.
The log has every line with the time at which it came, as `harness decode` and `harness monitor`
read it.
"""

import argparse
import subprocess
import sys
import threading
import time


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
                    stream.write(stamped)
                    stream.flush()

    def listen(self, sender, stream):
        for line in stream:
            if line.strip():
                self.hand_on(sender, line)


def partner(program, named):
    """Starts a device; `em66@7` is an em66 with the node id 7."""
    device, _, node = named.partition("@")
    command = [program, "serve", device, "--stdio"] + (["--node", node] if node else [])
    pipe = subprocess.PIPE
    return subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True, bufsize=1)


def main():
    arguments = argparse.ArgumentParser(description="A bus without a CAN interface.")
    arguments.add_argument("--log", type=argparse.FileType("w"))
    arguments.add_argument("harness")
    arguments.add_argument("devices", nargs="+", metavar="DEVICE@NODE")
    given = arguments.parse_args()
    hub = Hub(given.log)
    partners = {named: partner(given.harness, named) for named in given.devices}
    hub.streams["the master"] = sys.stdout
    hub.streams.update({named: process.stdin for named, process in partners.items()})
    for named, process in partners.items():
        threading.Thread(target=hub.listen, args=(named, process.stdout), daemon=True).start()
    hub.listen("the master", sys.stdin)
    for process in partners.values():
        process.stdin.close()
        process.wait()


if __name__ == "__main__":
    main()
