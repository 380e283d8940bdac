#!/bin/sh
# A lamp behind a relay: `switch` stands for what drives the relay, `seen` for what a sensor says.
switch() { lamp=$1; }
seen() { echo "$lamp"; }
switch false
while read -r request; do
    case $request in
        '{"names":true}') echo '{"names":["lamp"]}' ;;
        '{"set":{"lamp":true}}') switch true && echo '{"ok":true}' ;;
        '{"set":{"lamp":false}}') switch false && echo '{"ok":true}' ;;
        '{"get":"lamp"}') echo "{\"value\":$(seen)}" ;;
        *) echo '{"error":"this rig has a lamp, which is true or false"}' ;;
    esac
done
