"""Frames of an adapter that python-can drives, as lines: the other end is `bus/python_can.rs`.

    python3 bridge.py INTERFACE CHANNEL [KEY=VALUE...]    a bus, until standard input ends
    python3 bridge.py                                     the adapters that are plugged in

What the harness writes is a frame a line, `605#4000100000000000`. What it reads:

    ready VERSION                 the bus is open
    frame STAMP FRAME             a frame, own ones too; the stamp in seconds, or `-`
    sent                          the oldest frame written was handed to the adapter
    refused WHY                   or it was not
    error STAMP ID                an error frame
    failed WHY                    nothing more comes
    adapter INTERFACE CHANNEL     one that is plugged in
"""

import os
import sys
import threading

# How often the reader looks whether standard input has ended, in seconds.
TURN = 0.2
# Found in another way, or no adapters.
NOT_LISTED = {"socketcan", "virtual", "udp_multicast", "serial", "gs_usb"}

writing = threading.Lock()


def say(*words):
    line = " ".join(" ".join(str(word).split()) or "-" for word in words)
    with writing:
        sys.stdout.write(line + "\n")
        sys.stdout.flush()


def fail(why):
    say("failed", why)
    end(1)


def end(code):
    # Drivers have threads of their own, which need not end.
    os._exit(code)


def words(error):
    return f"{type(error).__name__}: {error}"


def opened(interface, channel, options):
    arguments = {"interface": interface, **options}
    if channel:
        arguments["channel"] = channel
    # Drivers that cannot be told to echo say so, or take no notice; some echo in any case.
    try:
        return can.Bus(receive_own_messages=True, **arguments)
    except (NotImplementedError, TypeError):
        return can.Bus(**arguments)


def parsed(line):
    identifier, _, data = line.partition("#")
    remote = data.startswith("R")
    return can.Message(
        arbitration_id=int(identifier, 16),
        is_extended_id=len(identifier) == 8,
        is_remote_frame=remote,
        dlc=int(data[1:] or 0) if remote else None,
        data=None if remote else bytes.fromhex(data),
    )


def written(message):
    identifier = format(message.arbitration_id, "08X" if message.is_extended_id else "03X")
    if message.is_remote_frame:
        return f"{identifier}#R{message.dlc}"
    return f"{identifier}#{bytes(message.data).hex().upper()}"


def receive(bus, ended):
    try:
        while not ended.is_set():
            message = bus.recv(TURN)
            if message is None or message.is_fd:
                continue
            stamp = format(message.timestamp, ".6f") if message.timestamp > 0 else "-"
            if message.is_error_frame:
                say("error", stamp, format(message.arbitration_id, "X"))
            else:
                say("frame", stamp, written(message))
    except Exception as error:
        if not ended.is_set():
            say("failed", words(error))


def bridge(interface, channel, options):
    try:
        bus = opened(interface, channel, options)
    except Exception as error:
        fail(words(error))
    say("ready", can.__version__)
    ended = threading.Event()
    receiver = threading.Thread(target=receive, args=(bus, ended), daemon=True)
    receiver.start()
    for line in sys.stdin:
        try:
            bus.send(parsed(line.strip()))
            say("sent")
        except can.CanError as error:
            say("refused", words(error))
        # An adapter that was unplugged is an error of whatever library the driver is made of.
        except Exception as error:
            fail(words(error))
    ended.set()
    receiver.join(2 * TURN)
    bus.shutdown()


def list_adapters():
    kinds = [kind for kind in can.VALID_INTERFACES if kind not in NOT_LISTED]
    for found in can.detect_available_configs(kinds):
        say("adapter", found.get("interface"), found.get("channel"))


def cast(option):
    key, _, value = option.partition("=")
    return key, can.util.cast_from_string(value)


if __name__ == "__main__":
    try:
        import can
        import can.util
    except ImportError as missing:
        fail(f"{words(missing)}: `{sys.executable} -m pip install python-can`")
    if len(sys.argv) == 1:
        list_adapters()
        end(0)
    else:
        bridge(sys.argv[1], sys.argv[2], dict(map(cast, sys.argv[3:])))
